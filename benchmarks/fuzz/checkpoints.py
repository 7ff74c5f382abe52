"""Checkpoints with faults, most of them with a valid checksum."""

from __future__ import annotations

import hashlib
import io
import json
import struct
import zipfile
import zlib
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.fuzz.mutations import HUGE, NUMBERS, mutate_bytes, mutate_integer
from benchmarks.fuzz.target import Target
from drpt import checkpoint, state
from drpt.checkpoint import FORMAT, MAGIC, Checkpoint, CheckpointError
from drpt.files import archives
from drpt.film import Film
from drpt.scene import Camera, Scene, Sphere
from drpt.settings import Settings
from drpt.state import State

if TYPE_CHECKING:
    from pathlib import Path
    from random import Random

WIDTH, HEIGHT, SPP = 4, 3, 100
CAMERA = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), 40, WIDTH, HEIGHT)
SETTINGS = Settings(Scene(CAMERA, [Sphere((0, 0, 0), 1, radiance=1)]), SPP)
IDENTITY: dict[str, str | int] = {"spp": SPP, "mode": "mis", "scene": "a scene\nof lines"}
FACTS = {
    "spp": 32,
    "block": 16,
    "rays": 1000,
    "non_finite": 0,
    "first_non_finite": None,
    "seconds": 0.5,
    "last_look": [32, 0.25],
}
VALUES: tuple[Any, ...] = (
    *NUMBERS,
    *(None, True, "", "32", "x" * 3000, "\x1b[2J", 0.5, -1.0, 1e308, float("nan"), float("inf")),
    *([], {}, [0, 0, 0], [1, 0.5], [99, 99, 99], [[[]]], ["x"], [1, "x"], {"spp": 1}),
)
SHAPES = ((0,), (), (12, 3), (2, 12, 3), (0, 12, 3), (12, 2), (1, 12, 3), (3, 12), (10**6,))
TYPES = ("f8", "f4", "f2", "i8", "?", "U3", "S3", "c16", "M8[s]", "f8,f4")
TEXTS = ("[" * 50000, "{", "", "null", "3", '{"identity": {}, "facts": {}}', *HUGE)


def make(random: Random) -> bytes:
    """Make a checkpoint with some faults."""
    identity, facts = dict(IDENTITY), dict(FACTS)
    table: dict[str, Any] = {"identity": identity, "facts": facts}
    for _ in range(random.choice((0, 1, 1, 2))):
        part = random.choice((facts, facts, facts, identity, table))
        _change(part, random)
    text = json.dumps(table) if random.random() < 0.95 else random.choice(TEXTS)
    body = _archive(random, {"state": np.array(text), **_arrays(random)})
    if random.random() < 0.1:
        body = mutate_bytes(body, random, random.randint(1, 3))
    if random.random() < 0.1:
        body = mutate_integer(body, random, random.choice((1, 2, 4, 8)))
    content = _magic(random) + hashlib.sha256(body).digest() + body
    return mutate_bytes(content, random) if random.random() < 0.05 else content


def _magic(random: Random) -> bytes:
    """Return the first bytes; a few times those of a format whose number is no text."""
    if random.random() < 0.98:
        return MAGIC
    start = random.choice((0, 2, len(FORMAT)))
    return MAGIC[:start] + random.randbytes(len(MAGIC) - start - 1) + b"\n"


def _change(table: dict[str, Any], random: Random) -> None:
    name = random.choice(list(table) or ["spp"])
    if random.random() < 0.2:
        table.pop(name, None)
    else:
        table[name] = random.choice(VALUES)


def _arrays(random: Random) -> dict[str, Any]:
    arrays: dict[str, Any] = {"total": np.ones((12, 3)), "blocks": np.ones((2, 12, 3), np.float32)}
    for name, array in list(arrays.items()):
        chance = random.random()
        if chance < 0.05:
            del arrays[name]
        elif chance < 0.1:
            arrays[name] = np.zeros(random.choice(SHAPES), random.choice(TYPES))
        elif chance < 0.2:
            array.flat[random.randrange(array.size)] = random.choice((np.nan, np.inf, -1, 3e38))
    return arrays


def _archive(random: Random, arrays: dict[str, Any]) -> bytes:
    body = io.BytesIO()
    method = zipfile.ZIP_STORED
    if random.random() < 0.1:
        method = random.choice((zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA))
    with zipfile.ZipFile(body, "w", method) as file:
        for name, array in arrays.items():
            file.writestr(_entry(f"{name}.npy", method), _member(random, array))
        if random.random() < 0.02:
            file.writestr(_entry("bomb.npy", method), bytes(10**7))
    content = body.getvalue()
    return _inflated(content) if random.random() < 0.01 else content


def _entry(name: str, method: int) -> zipfile.ZipInfo:
    """An entry with a fixed date, so that the same random state gives the same bytes."""
    entry = zipfile.ZipInfo(name)
    entry.compress_type = method
    return entry


def _inflated(archive: bytes) -> bytes:
    """Let the last array claim 2 GiB, in its own header and in the directory of the archive.

    Source: PKWARE, "APPNOTE.TXT", 4.3.12: checksum, size and size in memory follow 16 bytes.
    """
    entry = archive.rindex(b"PK\x01\x02")
    header = archive.rfind(b"\x93NUMPY")
    shape = archive.find(b"'shape': ", header) + len(b"'shape': ")
    end = archive.find(b"\n", shape)
    dictionary = b"(268435456, 2), }".ljust(end - shape)
    if header < 0 or len(dictionary) > end - shape:  # it is compressed
        return archive
    size = int.from_bytes(archive[entry + 24 : entry + 28], "little")
    content = (archive[header:shape] + dictionary + archive[end:])[:size]
    claimed = zlib.crc32(content), size, end + 1 - header + 2**31
    directory = archive[entry : entry + 16] + struct.pack("<3I", *claimed)
    return (
        archive[:header]
        + content
        + archive[header + size : entry]
        + directory
        + archive[entry + 28 :]
    )


def _member(random: Random, array: Any) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array, allow_pickle=False)
    content = stream.getvalue()
    if random.random() < 0.03:
        start = content.index(b"'shape': ") + 9
        shape = random.choice((b"(99999999999999,)", b"(-1,)", b"((((((", b"(True, 3)", b"(9**9,)"))
        content = content[:start] + shape + content[start + len(shape) :]
    return content


def call(path: Path) -> None:
    """Read a checkpoint, and restore the film of its state."""
    saved = Checkpoint(path, IDENTITY, 1).load()
    assert saved is not None
    try:
        found = State.checked(*saved, SETTINGS, error=True)
    except ValueError as error:
        raise CheckpointError(f"{path}: {error}") from error
    film = Film(SETTINGS.pixels)
    film.restore(found.total, found.blocks, found.spp, found.block)
    assert np.isfinite(film.mean).all() or found.non_finite
    json.dumps(found.facts)


TARGET = Target(
    "checkpoints",
    ".drpt",
    make,
    call,
    (CheckpointError,),
    checkpoint._parse,
    (checkpoint, state, archives),
)
