"""Reads untrusted files: only regular ones are opened, and the number of bytes is limited."""

from __future__ import annotations

import errno
import os
import stat
from typing import TYPE_CHECKING

from drpt.messages import size_in_words

if TYPE_CHECKING:
    from os import PathLike
    from typing import BinaryIO

    Path = str | PathLike[str]

_AT_ONCE = getattr(os, "O_NONBLOCK", 0)
"""Flag against waiting for the other end of a pipe; Windows has neither."""


def open_regular(path: Path) -> BinaryIO:
    """Open a regular file to read its bytes.

    Raises `OSError` with a readable ``strerror`` if there is no file, or if it is a folder, a pipe,
    a socket or a device. It never waits.
    """
    try:
        check_regular(path, os.stat(path))  # opening a device may already change it
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_BINARY", 0) | _AT_ONCE)
    except ValueError:
        problem = "its name holds a null character"
        raise OSError(errno.EINVAL, problem, os.fspath(path)) from None
    try:
        check_regular(path, os.fstat(descriptor))
    except OSError:
        os.close(descriptor)
        raise
    return os.fdopen(descriptor, "rb")


def read_bytes(path: Path, most: int) -> bytes:
    """Return the content of a regular file of at most ``most`` bytes; raises like `open_regular`.

    A larger file raises `OSError`, before its content is read.
    """
    with open_regular(path) as stream:
        size = os.fstat(stream.fileno()).st_size
        content = b"" if size > most else _read(stream, size, most)
    size = max(size, len(content))
    if size > most:
        problem = (
            f"it has {size_in_words(size)}, and it must have no more than {size_in_words(most)}"
        )
        raise OSError(errno.EFBIG, problem, os.fspath(path))
    return content


def _read(stream: BinaryIO, size: int, most: int) -> bytes:
    """Return the content of a file that may grow, at most ``most + 1`` bytes.

    It is read in parts, as Python allocates memory for all requested bytes, also for missing ones.
    """
    content = stream.read(size + 1)
    while size < len(content) <= most:
        size = len(content)
        content += stream.read(min(max(size, 2**16), most + 1 - size))
    return content


def check_regular(path: Path, found: os.stat_result) -> None:
    """Raise `OSError` unless the status of a path is that of a regular file."""
    if stat.S_ISDIR(found.st_mode):
        problem = "this is a folder, and it must be a file"
        raise IsADirectoryError(errno.EISDIR, problem, os.fspath(path))
    if not stat.S_ISREG(found.st_mode):
        problem = "this is a pipe or a device, and it must be a file"
        raise OSError(errno.EINVAL, problem, os.fspath(path))
