"""Chooses Dr.Jit's backend, its LLVM library and its kernel folder before Dr.Jit is imported.

Importing this module does not import Dr.Jit. Whatever imports Dr.Jit or Mitsuba calls :func:`load`
first; both then use the same LLVM.
"""

import ctypes
import importlib
import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

from drpt.kernel import llvm
from drpt.kernel.llvm import BackendError

__all__ = [
    "Backend",
    "BackendError",
    "describe",
    "interrupts_put_off",
    "load",
    "set_thread_count",
]

VARIABLE = "DRPT_BACKEND"
"""The environment variable that names a backend."""
CACHE_VARIABLE = "DRJIT_CACHE_DIR"
"""The environment variable that names the folder for compiled kernels."""
CACHE_SIZE_VARIABLE = "DRJIT_CACHE_MAXSIZE"
"""The environment variable with its largest size, which Dr.Jit enforces once an hour on import."""
CACHE_SIZE = 2**30
"""Largest size of the kernel folder in bytes; the least recently used kernels are removed."""

NAMES = ("llvm", "cuda")


@dataclass(frozen=True)
class Backend:
    """What kernels are compiled and run with; LLVM's fields are None where there is none."""

    name: str
    llvm_path: Path | None
    llvm_version: str | None
    vector_width: int | None
    threads: int
    cuda: bool
    cache: Path | None
    cache_writable: bool


def load(name: str | None = None) -> ModuleType:
    """Return Dr.Jit's module of array types, ``drjit.llvm`` or ``drjit.cuda``.

    Parameters
    ----------
    name
        ``"llvm"`` or ``"cuda"``; by default what the environment variable ``DRPT_BACKEND`` says,
        else CUDA where it works, else LLVM.

    Raises
    ------
    ValueError
        The name is neither of the two.
    BackendError
        The backend cannot work here; the message says what to do.
    """
    what = "backend" if name else VARIABLE
    name = name or os.environ.get(VARIABLE) or None
    if name not in (None, *NAMES):
        raise ValueError(f"{what} must be one of {', '.join(NAMES)}, got {name!r}")
    if "drjit" not in sys.modules:
        _name_library(optional=name != "llvm" and _has_cuda_driver())
        _name_cache_folder()
        _import_drjit()
    name = name or ("cuda" if _works("CUDA") else "llvm")
    if name == "cuda" and not _works("CUDA"):
        raise BackendError(f"{what} is cuda, which needs an NVIDIA GPU and its driver: none found")
    if name == "llvm":
        _check_loaded_llvm()
    return importlib.import_module(f"drjit.{name}")


def set_thread_count(count: int) -> None:
    """Set the number of CPU threads that kernels run on."""
    if count < 1:
        raise ValueError(f"threads must be at least 1, got {count}")
    load()
    import drjit as dr

    dr.set_thread_count(count)


@contextmanager
def interrupts_put_off() -> Iterator[None]:
    """Let Ctrl-C wait: amidst an import or a loop, Dr.Jit takes it for an error, or crashes."""
    if threading.current_thread() is not threading.main_thread():  # no other is interrupted
        yield
        return
    interrupts: list[int] = []
    handler = signal.signal(signal.SIGINT, lambda number, _: interrupts.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
        if interrupts:
            signal.raise_signal(signal.SIGINT)


def describe() -> Backend:
    """Return what :func:`load` chose, loading the backend if that has not happened yet."""
    name = load().__name__.removeprefix("drjit.")
    import drjit as dr

    has_llvm = _works("LLVM")
    path = os.environ.get(llvm.VARIABLE)
    cache = _cache_folder()
    return Backend(
        name=name,
        llvm_path=Path(path).resolve() if has_llvm and path else None,
        llvm_version=".".join(map(str, dr.detail.llvm_version())) if has_llvm else None,
        vector_width=_vector_width() if has_llvm else None,
        threads=dr.thread_count(),
        cuda=_works("CUDA"),
        cache=cache,
        cache_writable=cache is not None and os.access(cache, os.W_OK | os.X_OK),
    )


def _name_library(*, optional: bool) -> None:
    try:
        library = llvm.choose(llvm.found(), os.environ.get(llvm.VARIABLE))
    except BackendError:
        if not optional:
            raise
    else:
        os.environ[llvm.VARIABLE] = str(library.path)


def _name_cache_folder() -> None:
    """Give the kernels a folder of their own and a size limit, unless the user has named one."""
    from platformdirs import user_cache_path

    folder = user_cache_path("drpt", appauthor=False) / "kernels"
    if folder.is_absolute() and not os.environ.get(CACHE_VARIABLE):  # "~" without a home folder
        os.environ[CACHE_VARIABLE] = str(folder)
        os.environ.setdefault(CACHE_SIZE_VARIABLE, str(CACHE_SIZE))


def _import_drjit() -> None:
    try:
        with interrupts_put_off():
            importlib.import_module("drjit")
    except (ImportError, NameError) as error:  # the latter: Dr.Jit 1.5 fails to report the former
        reason = str(error.__context__ or error)
        hint = "; it needs libatomic1" if "libatomic" in reason else ""
        raise BackendError(f"Dr.Jit cannot be imported ({reason}){hint}") from error


def _works(name: str) -> bool:
    import drjit as dr

    return bool(dr.has_backend(getattr(dr.JitBackend, name)))


def _check_loaded_llvm() -> None:
    """Raise unless Dr.Jit has a usable LLVM; it may have been imported before drpt could choose."""
    import drjit as dr

    version = dr.detail.llvm_version() if _works("LLVM") else ()
    if version >= llvm.OLDEST:
        return
    found = f"LLVM {'.'.join(map(str, version))}" if version else "no LLVM"
    if named := os.environ.get(llvm.VARIABLE):
        raise BackendError(f"Dr.Jit got {found} from {named}: name another in {llvm.VARIABLE}")
    raise BackendError(
        f"Dr.Jit was imported before drpt and took {found}: import drpt first, "
        f"or name a libLLVM >= {llvm.OLDEST[0]} in {llvm.VARIABLE}"
    )


def _has_cuda_driver() -> bool:
    try:
        ctypes.CDLL(os.environ.get("DRJIT_LIBCUDA_PATH") or "libcuda.so.1")
    except OSError:
        return False
    return True


def _vector_width() -> int:
    """Return the lanes of a float vector."""
    return int(_drjit_core()["_Z21jit_llvm_vector_widthv"]())


def _cache_folder() -> Path | None:
    """Return where Dr.Jit keeps compiled kernels; None if it keeps none."""
    function = _drjit_core()["_Z13jit_cache_dirv"]
    function.restype = ctypes.c_char_p
    folder: bytes | None = function()
    return Path(os.fsdecode(folder)) if folder else None


def _drjit_core() -> ctypes.CDLL:
    """Return Dr.Jit's library, for functions that Dr.Jit's Python package lacks."""
    import drjit as dr

    return ctypes.CDLL(str(next(Path(dr.__file__).parent.glob("libdrjit-core.*"))))
