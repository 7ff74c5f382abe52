"""Limits the number of compiled kernels in memory; Dr.Jit has no limit."""

from __future__ import annotations

import drjit as dr

MAX_KERNELS = 256
"""Largest number of compiled kernels in memory."""
KERNELS_PER_USER = 16
"""More kernels than one launcher needs to render, to train a guide and to record paths."""


class CompiledKernels:
    """Counts the users of kernels, and drops all kernels from memory once there are many users.

    Dr.Jit then loads kernels that are still used from its folder again, in milliseconds.
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
