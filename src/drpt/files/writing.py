"""Files that are written whole or not at all."""

from __future__ import annotations

import hashlib
import os
import platform
import secrets
import stat
import tempfile
from contextlib import contextmanager, suppress
from pathlib import Path
from time import time
from typing import TYPE_CHECKING, BinaryIO

from drpt.files.locking import is_at, open_existing, try_lock

if TYPE_CHECKING:
    from collections.abc import Iterator

BLOCK = 4096
"""Number of bytes that must be free on the disk."""
ABANDONED_AFTER = 24 * 3600.0
"""Seconds without a change after which a temporary file of another host counts as abandoned."""
_HOST = hashlib.sha256(platform.node().encode()).hexdigest()[:8]


def check_file(path: Path) -> None:
    """Find out whether `replacing` will be able to write a file at `path`.

    Raises
    ------
    OSError
        The folder is missing, is no folder or may not be written to, or what is there is no file.
    """
    target = _target(path)
    if target.is_dir():
        raise IsADirectoryError(f"{path}: this is a folder, and it must be a file")
    if target.exists() and not target.is_file():
        raise OSError(f"{path}: this is a pipe or a device, and it must be a file")
    folder = target.parent
    if not folder.exists():
        raise FileNotFoundError(f"{path}: the folder {folder} does not exist")
    if not folder.is_dir():
        raise NotADirectoryError(f"{path}: {folder} is not a folder")
    try:
        with tempfile.TemporaryFile(dir=folder, buffering=0) as file:
            file.write(bytes(BLOCK))
    except OSError as error:
        reason = f"the folder {folder} cannot be written to ({error.strerror or error})"
        raise type(error)(f"{path}: {reason}") from error


@contextmanager
def replacing(path: Path) -> Iterator[BinaryIO]:
    """Open a new file that takes the place of `path` once it is written without an error.

    Until then it has a temporary name in the same folder. It gets the mode of the old file, and is
    synchronised to the disk. Temporary files of killed processes in the folder are removed.
    """
    target = _target(path)
    try:
        _remove_abandoned(target.parent)
        stream, temporary = _create(target.parent)
        try:
            with stream:
                _keep_mode(stream, target)
                yield stream
                stream.flush()
                os.fsync(stream.fileno())
                os.replace(temporary, target)
        finally:
            temporary.unlink(missing_ok=True)
        _sync_folder(target.parent)
    except OSError as error:
        raise OSError(f"{path}: it could not be written ({error.strerror or error})") from error


def write_file(path: Path, content: bytes) -> None:
    """Write a file as a whole; see `replacing`."""
    with replacing(path) as stream:
        stream.write(content)


def _create(folder: Path) -> tuple[BinaryIO, Path]:
    """Create a temporary file that is locked while it is open, which marks it as in use."""
    while True:
        path = folder / f".drpt-{_HOST}-{secrets.token_hex(8)}.tmp"
        stream = open(path, "x+b")  # noqa: SIM115 -- the caller closes it
        try:
            if try_lock(stream.fileno()) and is_at(stream.fileno(), path):
                return stream, path
        except OSError:  # the file system has no locks
            return stream, path
        stream.close()  # another process removed it before it was locked


def _remove_abandoned(folder: Path) -> None:
    """Remove temporary files of processes that have ended."""
    for path in folder.glob(".drpt-*.tmp"):
        with suppress(OSError):  # it is gone, or another user owns it
            descriptor = open_existing(path)
            try:
                if _is_abandoned(descriptor, path):
                    path.unlink()
            finally:
                os.close(descriptor)


def _is_abandoned(descriptor: int, path: Path) -> bool:
    """Whether no process writes a temporary file: it is unlocked, or it is old.

    On network file systems, locks of other hosts may be invisible, so their files must be old, too.
    """
    is_old = time() - os.fstat(descriptor).st_mtime > ABANDONED_AFTER
    try:
        is_free = try_lock(descriptor)
    except OSError:
        return is_old
    return is_free and (is_old or path.name.startswith(f".drpt-{_HOST}-"))


def _keep_mode(stream: BinaryIO, target: Path) -> None:
    with suppress(FileNotFoundError):
        os.chmod(stream.name, stat.S_IMODE(target.stat().st_mode))


def _sync_folder(folder: Path) -> None:
    """Synchronise the names in a folder to the disk, if the system can."""
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _target(path: Path) -> Path:
    """Return the file behind a link, whether it exists or not; else the path as it is."""
    return Path(os.path.realpath(path)) if path.is_symlink() else path
