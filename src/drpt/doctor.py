"""What drpt finds on this machine, and whether that is enough to render."""

import platform
import sys
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from drpt.kernel import backend, llvm

_PACKAGES = ("drpt", "drjit", "mitsuba", "numpy", "OpenEXR")


@dataclass(frozen=True)
class Report:
    """Rows of a name and what was found, and what keeps drpt from rendering, if anything does."""

    rows: tuple[tuple[str, str], ...]
    problem: str | None

    def __str__(self) -> str:
        width = max(len(name) for name, _ in self.rows)
        lines = [f"{name:<{width}}  {found}" for name, found in self.rows]
        verdict = f"drpt cannot render: {self.problem}" if self.problem else "drpt can render"
        return "\n".join([*lines, "", verdict])


def report() -> Report:
    """Look at the machine and at what is installed; Mitsuba is not imported."""
    try:
        chosen = backend.describe()
    except (backend.BackendError, ValueError) as error:
        return Report((*_others(None), *_versions()), str(error))
    return Report((*_backend(chosen), *_versions()), None)


def main() -> int:
    """Print the report; return 0 if drpt can render, else 1."""
    found = report()
    print(found)
    return 1 if found.problem else 0


def _backend(chosen: backend.Backend) -> list[tuple[str, str]]:
    library = f"{chosen.llvm_version} ({chosen.llvm_path or 'picked by Dr.Jit'})"
    return [
        ("backend", chosen.name),
        ("libLLVM", library if chosen.llvm_version else "none"),
        *_others(chosen.llvm_path),
        ("vector width", str(chosen.vector_width or "unknown")),
        ("threads", str(chosen.threads)),
        ("CUDA", "yes" if chosen.cuda else "no"),
        ("cache folder", _cache(chosen)),
    ]


def _others(chosen: Path | None) -> list[tuple[str, str]]:
    """Return the libraries that are there too, and why each was not chosen."""
    libraries = (library for library in llvm.found() if library.path != chosen)
    return [("not chosen", f"{library}: {_reason(library)}") for library in libraries]


def _reason(library: llvm.Library) -> str:
    if library.usable:
        return "usable, but not preferred"
    return f"needs to be at least {llvm.OLDEST[0]}"


def _cache(chosen: backend.Backend) -> str:
    if chosen.cache is None:
        return "none: HOME is not set"
    note = "" if chosen.cache_writable else " (not writable: kernels are not kept)"
    return f"{chosen.cache}{note}"


def _versions() -> list[tuple[str, str]]:
    python = ("Python", f"{platform.python_version()} ({sys.executable})")
    return [python, *((name, _version(name)) for name in _PACKAGES)]


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
