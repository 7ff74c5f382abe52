"""Files that are written whole or not at all."""

from __future__ import annotations

import os
import secrets
import tempfile
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

if TYPE_CHECKING:
    from collections.abc import Iterator

BLOCK = 4096
"""Bytes that a disk must have left."""


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
def replacing(path: Path, token: str | None = None) -> Iterator[BinaryIO]:
    """Open a new file that takes the place of `path` once it is written without an error.

    Its name until then holds a ``token``, a random one by default. One that is always the same for
    a path leaves no more than one file behind, however often the process is killed; who gives it
    sees to it that no other process writes there.
    """
    target = _target(path)
    temporary = target.with_name(f".drpt-{token or secrets.token_hex(8)}.tmp")
    if token:
        temporary.unlink(missing_ok=True)
    try:
        with open(temporary, "x+b") as stream:
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(temporary, target)
    except OSError as error:
        raise OSError(f"{path}: it could not be written ({error.strerror or error})") from error
    finally:
        temporary.unlink(missing_ok=True)


def _target(path: Path) -> Path:
    """Return the file behind a link, whether it exists or not; else the path as it is."""
    return Path(os.path.realpath(path)) if path.is_symlink() else path
