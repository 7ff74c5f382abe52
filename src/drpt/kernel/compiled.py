"""Bounds how many compiled kernels stay in memory, which Dr.Jit does not do by itself."""

from __future__ import annotations

import drjit as dr

MAX_KERNELS = 256
"""Compiled kernels that stay in memory at most."""
KERNELS_PER_USER = 16
"""More than one launcher compiles: one to render, and some to learn a guide or to record paths."""


class CompiledKernels:
    """Counts who uses kernels since all of them were dropped, and drops them once there are many.

    What is still in use is then loaded from Dr.Jit's folder of compiled kernels, in milliseconds.
    """

    def __init__(self) -> None:
        self._users: set[object] = set()

    def use(self, user: object) -> None:
        """Make room for the kernels of ``user``, a token of a launcher that is about to run."""
        if user in self._users:
            return
        if len(self._users) >= MAX_KERNELS // KERNELS_PER_USER:
            dr.flush_kernel_cache()
            self._users.clear()
        self._users.add(user)


COMPILED = CompiledKernels()
"""The kernels of this process."""
