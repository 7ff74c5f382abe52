"""Arithmetic that gives the same bits on all threads and on every x86-64 CPU with FMA."""

from __future__ import annotations

import ctypes
import platform
import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING

import drjit as dr

if TYPE_CHECKING:
    from collections.abc import Iterator

FLUSH_TO_ZERO = 1 << 15 | 1 << 6
"""Of the register MXCSR: denormal results, and denormal operands, are 0."""


class _Environment(ctypes.Structure):
    """``fenv_t`` of the GNU C library on x86-64."""

    _fields_ = (("x87", ctypes.c_uint32 * 7), ("mxcsr", ctypes.c_uint32))


@contextmanager
def same_bits() -> Iterator[None]:
    """Trace and run kernels so that their bits depend neither on the thread nor on the CPU.

    FastMath lets Dr.Jit use the CPU's approximate reciprocal square root, whose bits differ between
    vectors of 16 and of 8 numbers, so it is turned off. Dr.Jit's threads treat denormal numbers as
    0. The calling thread runs a kernel if the pool has no other thread or the kernel is small, so
    it treats them as 0 here, too. Both settings belong to a thread.
    """
    with dr.scoped_set_flag(dr.JitFlag.FastMath, False), _flush_denormals():
        yield


@contextmanager
def _flush_denormals() -> Iterator[None]:
    """Treat denormals as 0 on this thread; has an effect only on Linux on x86-64."""
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
