"""Locks that the operating system drops with the process that holds them.

Source: flock(2); two locks of one process on different descriptors exclude each other, too.
"""

from __future__ import annotations

import os
import weakref
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

_FLAGS = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)


def try_lock(descriptor: int) -> bool:
    """Lock an open file unless another descriptor has; raises `OSError` where there are no locks.

    The lock ends where the descriptor is closed.
    """
    from filelock import lock_descriptor

    return lock_descriptor(descriptor, blocking=False)


def is_at(descriptor: int, path: Path) -> bool:
    """Whether an open file is the one that a path names now."""
    try:
        return os.path.samestat(os.fstat(descriptor), os.lstat(path))
    except FileNotFoundError:
        return False


def open_existing(path: Path) -> int:
    """Open a file to lock it; it is neither a link nor waited for."""
    return os.open(path, os.O_RDWR | _FLAGS)


class PathLock:
    """A lock that is known by the path of a file, which is there as long as it is held.

    A process that is killed leaves the file, without a lock; who locks it next removes it.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._release: weakref.finalize[[int, Path, int], PathLock] | None = None

    @property
    def is_held(self) -> bool:
        """Whether this object holds it."""
        return self._release is not None and self._release.alive

    def acquire(self) -> bool:
        """Lock it unless it is locked already; raises `OSError` where that is not possible."""
        while True:
            descriptor = os.open(self._path, os.O_RDWR | os.O_CREAT | _FLAGS, 0o666)
            try:
                locked = try_lock(descriptor)
            except OSError:
                _remove(descriptor, self._path, os.getpid())
                raise
            if locked and is_at(descriptor, self._path):
                self._release = weakref.finalize(self, _remove, descriptor, self._path, os.getpid())
                return True
            os.close(descriptor)
            if not locked:
                return False

    def release(self) -> None:
        """Let others have it, and remove its file."""
        if self._release:
            self._release()


def _remove(descriptor: int, path: Path, process: int) -> None:
    """Remove a locked file and close it; a fork of the process that has locked it does neither."""
    if os.getpid() == process:
        try:
            if is_at(descriptor, path):
                path.unlink(missing_ok=True)
        finally:
            os.close(descriptor)
