"""Finds the LLVM library that Dr.Jit compiles its CPU kernels with.

Left alone, Dr.Jit takes whichever ``libLLVM`` a file pattern lists first. LLVM 14 is refused by it,
and LLVM 15 aborts the process in code generation on some CPUs, so the choice is made here, from
file names alone, before Dr.Jit is imported.

The module needs nothing but Python. ``python llvm.py`` prints the chosen path, or says in one line
how to get a library.
"""

import os
import platform
import re
import shutil
import subprocess
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

VARIABLE = "DRJIT_LIBLLVM_PATH"
"""The environment variable that names a library; Dr.Jit reads it when it is imported."""

OLDEST = (16,)
"""The oldest version that is ever chosen."""

_FOLDERS = (
    f"usr/lib/{platform.machine()}-linux-gnu",  # Debian, Ubuntu
    "usr/lib/llvm*/lib",  # Debian, Ubuntu, Arch (older versions)
    "usr/lib64",  # Fedora, openSUSE, Arch
    "usr/lib64/llvm*/lib",  # Fedora (older versions)
    "usr/lib/llvm/*/lib64",  # Gentoo
    "usr/local/lib",
    "opt/homebrew/opt/llvm*/lib",
    "usr/local/opt/llvm*/lib",
    "home/linuxbrew/.linuxbrew/opt/llvm*/lib",
)

_INSTALL = {
    "apt-get": "apt-get install libllvm19",
    "dnf": "dnf install llvm-libs",
    "pacman": "pacman -S llvm-libs",
    "zypper": "zypper install libLLVM19",
    "brew": "brew install llvm",
}

# libLLVM-19.so, libLLVM-14.0.6.so.1, libLLVM.so.19.1
_VERSION_IN_NAME = re.compile(r"libLLVM(?:-(?=[\d.]+\.(?:so|dylib))|\.so\.)(\d+(?:\.\d+)*)")
# Cellar/llvm@18/18.1.8, Cellar/llvm/19.1.7, llvm-19, llvm18
_VERSION_IN_FOLDER = re.compile(r"llvm(?:@\d+/|[-@/]?)(\d+(?:\.\d+)*)")
_LDCONFIG_LINE = re.compile(r"^\s*libLLVM[-.]\S* \((.*64.*)\) => (\S+)$", re.MULTILINE)


class BackendError(RuntimeError):
    """No backend of Dr.Jit can work on this machine; the message says what to do."""


@dataclass(frozen=True)
class Library:
    """A libLLVM: its real path, and its version as far as names tell it (else empty)."""

    path: Path
    version: tuple[int, ...]

    @property
    def usable(self) -> bool:
        """Whether the version is known and new enough."""
        return self.version >= OLDEST

    def __str__(self) -> str:
        return f"{'.'.join(map(str, self.version)) or 'unknown version'} ({self.path})"


def identify(path: Path) -> Library:
    """Return the library behind a path: links are followed, the version is read off the names."""
    real = path.resolve()
    match = (
        _VERSION_IN_NAME.match(real.name)
        or _VERSION_IN_NAME.match(path.name)
        or _VERSION_IN_FOLDER.search(real.as_posix())
    )
    return Library(real, tuple(map(int, match[1].split("."))) if match else ())


def search(root: Path = Path("/"), prefix: Path = Path(sys.prefix)) -> list[Library]:
    """Return every libLLVM in the usual places, those of the Python environment first.

    Parameters
    ----------
    root
        The root of the file system.
    prefix
        The Python environment: ``lib/llvm`` in it is where the set-up unpacks a library, ``lib``
        where conda keeps its own.
    """
    folders = [prefix / "lib/llvm", prefix / "lib"]
    folders += [folder for pattern in _FOLDERS for folder in sorted(root.glob(pattern))]
    return _distinct(file for folder in folders for file in _files(folder))


def registered(listing: str) -> list[Library]:
    """Return every 64-bit libLLVM in what ``ldconfig -p`` printed."""
    return _distinct(Path(path) for _, path in _LDCONFIG_LINE.findall(listing))


def found() -> list[Library]:
    """Return every libLLVM of this machine."""
    libraries = search() + registered(_ldconfig())
    return list(dict.fromkeys(libraries))


def choose(libraries: Sequence[Library], wanted: str | None = None) -> Library:
    """Return the library to use: the wanted one, else the newest usable one.

    Parameters
    ----------
    libraries
        What was found; of equal versions the first is taken.
    wanted
        The path that the user has put into ``DRJIT_LIBLLVM_PATH``, if any.

    Raises
    ------
    BackendError
        The wanted library is missing or too old, or no usable one was found.
    """
    if wanted:
        return _checked(wanted)
    usable = [library for library in libraries if library.usable]
    if usable:
        return max(usable, key=lambda library: library.version)
    others = ", ".join(map(str, libraries))
    raise BackendError(
        f"no libLLVM >= {OLDEST[0]} found{f' (only {others})' if others else ''}: {_advice()}"
    )


def _checked(wanted: str) -> Library:
    library = identify(Path(wanted))
    if not library.path.is_file():
        raise BackendError(
            f"{VARIABLE} is {wanted!r}, which is not a file: "
            f"name a libLLVM >= {OLDEST[0]}, or unset it"
        )
    if library.version and not library.usable:
        raise BackendError(
            f"{VARIABLE} names LLVM {library}, too old: name a libLLVM >= {OLDEST[0]}, or unset it"
        )
    return library


def _advice() -> str:
    commands = [command for tool, command in _INSTALL.items() if shutil.which(tool)]
    if commands:
        return f"install it with `{commands[0]}`, or name one in {VARIABLE}"
    return f"install it with the system's package manager, or name one in {VARIABLE}"


def _files(folder: Path) -> Iterator[Path]:
    for pattern in ("libLLVM.so*", "libLLVM-[0-9]*.so*", "libLLVM*.dylib"):
        yield from sorted(folder.glob(pattern))


def _distinct(paths: Iterable[Path]) -> list[Library]:
    libraries: dict[Path, Library] = {}
    for path in paths:
        library = identify(path)
        if library.path.is_file():
            libraries.setdefault(library.path, library)
    return list(libraries.values())


def _ldconfig() -> str:
    # /sbin is not on the path of every user.
    tool = shutil.which("ldconfig", path=f"{os.environ.get('PATH', '')}:/sbin:/usr/sbin")
    if tool is None:
        return ""
    return subprocess.run([tool, "-p"], capture_output=True, text=True, check=False).stdout


if __name__ == "__main__":
    try:
        print(choose(found(), os.environ.get(VARIABLE)).path)
    except BackendError as error:
        sys.exit(str(error))
