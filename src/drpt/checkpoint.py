"""The state of a render on disk, so that a killed one goes on where it was.

A file holds a line that names the format, the SHA-256 of all that follows, and a NumPy archive of
numbers (as JSON) and arrays. It appears whole under its name, or the one before stays.
"""

from __future__ import annotations

import hashlib
import json
import os
from time import monotonic
from typing import TYPE_CHECKING, Any

import numpy as np

from drpt.files import PathLock, open_regular, read_npz, replacing
from drpt.messages import one_line, shortened

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path
    from typing import BinaryIO

    from numpy.typing import NDArray

    Facts = Mapping[str, str | int | float | bool | list[int] | list[float] | None]
    Arrays = Mapping[str, NDArray[Any]]

MAX_SHOWN = 100
"""Characters of a value that an error shows."""
FORMAT = b"drpt checkpoint "
MAGIC = FORMAT + b"1\n"
BODY = len(MAGIC) + hashlib.sha256().digest_size


class CheckpointError(ValueError):
    """A file is no checkpoint, is damaged, in use, or belongs to another render."""


class Checkpoint:
    """Where the state of a render is kept.

    Parameters
    ----------
    path
        The file.
    identity
        What the render is; a state of one that differs anywhere is refused.
    interval
        Seconds between two states.
    """

    def __init__(self, path: Path, identity: Facts, interval: float) -> None:
        self.path = path
        self._identity = dict(identity)
        self._interval = interval
        self._last = monotonic()
        self._lock = PathLock(_lock_path(path))

    def lock(self) -> None:
        """Keep others off until :meth:`unlock`; raises `CheckpointError` where that fails."""
        try:
            if not self._lock.is_held and not self._lock.acquire():
                raise CheckpointError(f"{self.path}: another render is using it")
        except OSError as error:
            problem = f"it cannot be locked against other renders ({error.strerror})"
            raise CheckpointError(f"{self.path}: {problem}; keep it in another folder") from error

    def unlock(self) -> None:
        """Let others have it."""
        self._lock.release()

    def load(self) -> tuple[Mapping[str, Any], Arrays] | None:
        """Facts and arrays that were saved last; None if there is no file.

        Raises `CheckpointError` for what is no checkpoint of this render, and `OSError`.
        """
        if not self.path.exists():
            return None
        identity, facts, arrays = _read(self.path)
        _compare(self.path, identity, self._identity)
        return facts, arrays

    def is_due(self) -> bool:
        """Whether it is time to save again."""
        return monotonic() - self._last >= self._interval

    def save(self, facts: Facts, arrays: Arrays) -> None:
        """Replace what was saved before; raises `OSError` where that fails."""
        text = json.dumps({"identity": self._identity, "facts": facts})
        with replacing(self.path) as stream:
            stream.write(MAGIC.ljust(BODY, b"\0"))
            np.savez(stream, allow_pickle=False, state=np.array(text), **arrays)
            digest = _digest(stream)
            stream.seek(len(MAGIC))
            stream.write(digest)
        self._last = monotonic()


def _lock_path(path: Path) -> Path:
    """Beside the file itself, wherever links to it are; of a name that is not too long."""
    file = path.resolve()
    token = hashlib.sha256(os.fsencode(file.name)).hexdigest()[:16]
    return file.with_name(f".drpt-{token}.lock")


def _read(path: Path) -> tuple[Mapping[str, Any], Mapping[str, Any], Arrays]:
    """Return identity, facts and arrays of a file."""
    with open_regular(path) as stream:
        magic = stream.readline(len(MAGIC))
        if not magic.startswith(FORMAT):
            raise CheckpointError(f"{path}: this is no checkpoint of drpt")
        if magic != MAGIC:
            there, here = (_version(line) for line in (magic, MAGIC))
            raise CheckpointError(f"{path}: its format is {there}, and this version reads {here}")
        if stream.read(BODY - len(MAGIC)) != _digest(stream):
            raise CheckpointError(f"{path}: it is damaged: its checksum is not that of its content")
        try:
            arrays = read_npz(stream)
            return *_parse(arrays.pop("state", None)), arrays
        except (ValueError, RecursionError) as error:
            raise CheckpointError(f"{path}: its content cannot be read ({error})") from error


def _version(line: bytes) -> str:
    return one_line(line.removeprefix(FORMAT).decode("ascii", "backslashreplace"))


def _parse(state: NDArray[Any] | None) -> tuple[Mapping[str, Any], Mapping[str, Any]]:
    """Return identity and facts, which a text in an array tells as JSON."""
    if state is None or state.dtype.kind != "U" or state.shape:
        raise ValueError("the array state is missing, or no text")
    table = json.loads(str(state))
    for name in ("identity", "facts"):
        if not isinstance(table, dict) or not isinstance(table.get(name), dict):
            raise ValueError(f"{name} is missing, or no table")
    for name, value in table["identity"].items():
        if isinstance(value, list | dict):
            raise ValueError(f"identity has a list or a table for {shortened(name, MAX_SHOWN)}")
    return table["identity"], table["facts"]


def _digest(stream: BinaryIO) -> bytes:
    stream.seek(BODY)
    return hashlib.file_digest(stream, "sha256").digest()  # type: ignore[arg-type]


def _compare(path: Path, there: Facts, here: Facts) -> None:
    """Refuse the state of another render, and say what is different."""
    for name in here:
        if there.get(name) != here[name]:
            old, new = _difference(str(there.get(name)), str(here[name]))
            difference = one_line(f"{name} is {old} there and {new} here")
            raise CheckpointError(f"{path}: it belongs to another render: {difference}")


def _difference(there: str, here: str) -> tuple[str, str]:
    """The first lines that differ."""
    pairs = zip(there.splitlines(), here.splitlines(), strict=False)
    old, new = next((pair for pair in pairs if pair[0] != pair[1]), (there[-40:], here[-40:]))
    return shortened(old, MAX_SHOWN), shortened(new, MAX_SHOWN)
