"""EXR files whose attributes, channels, headers or pixels are unusual or damaged."""

from __future__ import annotations

import io
import struct
from typing import TYPE_CHECKING, Any

import numpy as np
import OpenEXR

from benchmarks.fuzz.mutations import HUGE, NUMBERS, mutate_bytes, mutate_integer
from benchmarks.fuzz.target import Target
from drpt import comparison, merging
from drpt.crosscheck import stored
from drpt.merging import merge
from drpt.output import exr, exr_size, metadata, read, write

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path
    from random import Random

HEIGHT, WIDTH = 6, 7
GOOD = {
    "spp": "16",
    "seed": "1",
    "bounces": "3",
    "scene": "x",
    "jitter": "true",
    "mode": "mis",
    "seconds": "0.5",
    "rays": "100",
    "non_finite": "0",
    "passes": "16",
}
NAMES = (*GOOD, "error", "denoised", "partial", "comment", "é", "k" * 100, "", "\x1b[31m")
VALUES: tuple[Any, ...] = (
    *("{}", "null", "[]", "true", '"x"', "NaN", "Infinity", "-1", "1e999", "1.5", "1, 2", "", "x"),
    *(*HUGE, "1" + "0" * 400, "[" * 5000, "{" * 2000, "\x1b[2J", "a\nb", '"\\ud800"'),
    *(0, 16, -(2**31), 1.5, float("nan"), (1.0, 2.0), (1, 2, 3), ["a", "b"], np.eye(3, dtype="f")),
)
CHANNELS = (
    *("normal", "normal.X", "normal.Y", "normal.Z", "depth", "depth.Z", "samples", "variance"),
    *("standard_error.R", "standard_error.G", "standard_error.B", "standard_error", "albedo.R"),
    *(
        "variance.R",
        "variance.G",
        "variance.B",
        "RGB",
        "RGB.R",
        "RGBA",
        "A",
        "Y",
        "x.y.R",
        ".",
        "é",
    ),
)
PIXELS = (0.0, 1.0, -1.0, 16.0, np.nan, np.inf, -np.inf, 3e38, 1e-40)
COMPRESSIONS = [
    getattr(OpenEXR, f"{name}_COMPRESSION")
    for name in ("NO", "RLE", "ZIPS", "ZIP", "PIZ", "PXR24", "B44", "B44A", "DWAA", "DWAB")
]


def make(random: Random) -> bytes:
    """Make a picture with some faults."""
    content = _encode(_channels(random), _attributes(random), random)
    match random.randrange(12):
        case 0:
            return mutate_bytes(content, random, random.randint(1, 3))
        case 1:
            return mutate_integer(content, random, random.choice((1, 4, 8)))
        case 2:
            return _with_window(content, random)
        case 3:
            return content[: random.randrange(len(content))]
    return content


def _attributes(random: Random) -> dict[str, Any]:
    attributes: dict[str, Any] = {f"drpt:{name}": value for name, value in GOOD.items()}
    for _ in range(random.choice((0, 0, 1, 2))):
        attributes[f"drpt:{random.choice(NAMES)}"] = random.choice(VALUES)
    if random.random() < 0.2:
        del attributes[random.choice(list(attributes))]
    return attributes


def _channels(random: Random) -> dict[str, Any]:
    names = [*"RGB", *random.sample(CHANNELS, random.choice((0, 0, 1, 3, 6)))]
    if random.random() < 0.2:
        names += [
            f"{random.choice(('normal', 'variance', 'standard_error'))}.{c}" for c in "RGBXYZ"
        ]
    if random.random() < 0.03:
        names.remove("G")
    width = WIDTH if random.random() < 0.9 else random.choice((1, 2, 300))
    kind = random.choice((np.float32, np.float32, np.float16, np.uint32))
    return {name: _plane(random, width, kind) for name in names}


def _plane(random: Random, width: int, kind: type[np.generic]) -> Any:
    plane = np.full((HEIGHT, width), random.choice((0.5, 1.0, 16.0)))
    if random.random() < 0.3 and kind is not np.uint32:
        plane[random.randrange(HEIGHT), random.randrange(width)] = random.choice(PIXELS)
    with np.errstate(over="ignore"):
        return plane.astype(kind)


def _encode(channels: dict[str, Any], attributes: dict[str, Any], random: Random) -> bytes:
    layout = {"type": OpenEXR.scanlineimage, "compression": random.choice(COMPRESSIONS)}
    stream = io.BytesIO()
    try:
        OpenEXR.File({**layout, **attributes}, channels).write(stream)
    except (RuntimeError, ValueError):  # a name or a value that it does not write
        return _encode({**channels}, {"drpt:spp": "16"}, random)
    return stream.getvalue()


def _with_window(content: bytes, random: Random) -> bytes:
    mark = b"dataWindow\0box2i\0"
    start = content.find(mark) + len(mark) + 4
    sizes = [*NUMBERS[:11], WIDTH - 1, HEIGHT - 1, 65535, 10**8]
    right, bottom = (random.choice(sizes) % 2**31 for _ in range(2))
    window = struct.pack("<4i", random.choice((0, 0, 1, -5)), 0, right, bottom)
    return content[:start] + window + content[start + 16 :]


def call(path: Path) -> None:
    """Read a picture, merge it, write it, and load it as a reference."""
    layers, attributes = read(path)
    comparison.differing_settings(attributes, {})
    image = layers.pop("RGB")
    for suffix in (".exr", ".png", ".npy"):
        write(path.with_name(f"copy{suffix}"), image, attributes, layers=layers)
    other = path.with_name("other.exr")
    if not other.exists():
        grey = np.ones((HEIGHT, WIDTH, 3), np.float32)
        write(other, grey, {"spp": 4, "seed": 2, "bounces": 3, "scene": "x", "jitter": True})
    refusals = []
    uses: tuple[Callable[[], object], ...] = (
        lambda: merge([other, path]),
        lambda: stored.load_estimate(path),
    )
    for use in uses:
        try:
            use()
        except ValueError as error:
            refusals.append(error)
    if refusals:
        raise refusals[0]


TARGET = Target(
    "exr",
    ".exr",
    make,
    call,
    (ValueError, OSError),
    metadata.from_header,
    (exr, exr_size, metadata, merging, stored),
)
