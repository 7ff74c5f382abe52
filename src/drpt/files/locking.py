"""File locks that the operating system releases when their process ends.

Source: flock(2). Two descriptors in one process exclude each other, too.
"""

from __future__ import annotations

import os
import weakref
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

_FLAGS = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)


def try_lock(descriptor: int) -> bool:
    """Lock an open file; return whether that succeeds, which it does unless it is locked already.

    Closing the descriptor releases the lock. Raises `OSError` if the file system has no locks.
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
    """Open a file to lock it, without following a link or waiting for a pipe."""
    return os.open(path, os.O_RDWR | _FLAGS)


class PathLock:
    """A lock on a path, where a file exists as long as the lock is held.

    A killed process leaves the file, unlocked; the next owner of the lock removes it.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._release: weakref.finalize[[int, Path, int], PathLock] | None = None

    @property
    def is_held(self) -> bool:
        """Whether this object holds the lock."""
        return self._release is not None and self._release.alive

    def acquire(self) -> bool:
        """Return whether the lock was free and is now held; raises `OSError` without locks."""
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
        """Release the lock and remove its file."""
        if self._release:
            self._release()


def _remove(descriptor: int, path: Path, process: int) -> None:
    """Remove a locked file and close it; does nothing in a fork of the process that locked it."""
    if os.getpid() == process:
        try:
            if is_at(descriptor, path):
                path.unlink(missing_ok=True)
        finally:
            os.close(descriptor)
