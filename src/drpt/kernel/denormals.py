"""Denormal numbers count as 0 on Dr.Jit's threads; here, on the calling thread, too.

Dr.Jit runs a kernel on the calling thread where the pool has no other, or the kernel is small. The
same call gives the same bits on any number of threads only if all of them round alike.
"""

from __future__ import annotations

import ctypes
import platform
import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

FLUSH_TO_ZERO = 1 << 15 | 1 << 6
"""Of the register MXCSR: denormal results, and denormal operands, are 0."""


class _Environment(ctypes.Structure):
    """``fenv_t`` of the GNU C library on x86-64."""

    _fields_ = (("x87", ctypes.c_uint32 * 7), ("mxcsr", ctypes.c_uint32))


@contextmanager
def flush_denormals() -> Iterator[None]:
    """Make denormals 0 on this thread; does nothing but on Linux on x86-64."""
    if sys.platform != "linux" or platform.machine() != "x86_64":
        yield
        return
    libm = ctypes.CDLL("libm.so.6")
    before, during = _Environment(), _Environment()
    libm.fegetenv(ctypes.byref(before))
    libm.fegetenv(ctypes.byref(during))
    during.mxcsr |= FLUSH_TO_ZERO
    libm.fesetenv(ctypes.byref(during))
    try:
        yield
    finally:
        libm.fesetenv(ctypes.byref(before))
