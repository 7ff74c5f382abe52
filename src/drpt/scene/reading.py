"""Reads the files of a scene; every problem is a `SceneError`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from drpt.files import read_bytes
from drpt.scene.checks import SceneError

if TYPE_CHECKING:
    from pathlib import Path


def read_file(path: Path, most: int) -> bytes:
    """Return the content of a regular file of at most ``most`` bytes.

    Raises `SceneError`, which does not name the file, if it cannot be read.
    """
    try:
        return read_bytes(path, most)
    except FileNotFoundError:
        raise SceneError("there is no such file") from None
    except OSError as error:
        raise SceneError(f"it cannot be read: {error.strerror}") from None
