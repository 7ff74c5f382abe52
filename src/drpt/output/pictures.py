"""Pictures, written and read by the suffix of their name."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from drpt.files import check_file, open_regular, read_npy, replacing
from drpt.output.display import check_look, to_display
from drpt.output.exr import read_exr_layers, write_exr
from drpt.output.metadata import to_header

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from drpt.output.metadata import Metadata

SUFFIXES = (".exr", ".png", ".npy")
READABLE = (".exr", ".npy")
"""Of the suffixes, those of pictures that hold linear radiance."""


def check_target(
    path: str | os.PathLike[str], *, exposure: float = 0.0, curve: str = "srgb"
) -> None:
    """Find out, before anything is computed, whether `write` will accept these arguments.

    Raises
    ------
    ValueError
        `path` is no path, its suffix names no known format, the exposure is not in ±100 stops, or
        the curve is unknown.
    OSError
        The folder is missing, is no folder or may not be written to, or what is there is no file.
    """
    if not isinstance(path, str | os.PathLike):
        raise ValueError(f"{path!r} is not allowed; it must be the path of a picture")
    path = Path(path)
    if path.suffix.lower() not in SUFFIXES:
        raise ValueError(f"{path}: the name of a picture must end with {', '.join(SUFFIXES)}")
    check_look(exposure, curve)
    check_file(path)


def write(
    path: str | os.PathLike[str],
    image: NDArray[np.float32],
    metadata: Metadata,
    *,
    exposure: float = 0.0,
    curve: str = "srgb",
    layers: Mapping[str, NDArray[np.float32]] | None = None,
) -> None:
    """Write a picture; the suffix of `path` chooses the format.

    The picture appears complete under its name: until then, and after a failure, `path` is as
    it was before.

    Parameters
    ----------
    path
        ``.exr``: linear float32. ``.png``: 8-bit sRGB for display, clipped to what a display
        shows; pixels that are not a number are magenta. ``.npy``: the array, no metadata.
    image
        Linear radiance, shape (height, width, 3), row 0 at the top.
    metadata
        Stored in the header as ``drpt:NAME``: numbers in decimal, strings as they are (as JSON,
        where they would be mistaken for a number or are not ASCII).
    exposure
        Factor 2^exposure on the radiance of a PNG, in stops.
    curve
        How a PNG shows bright radiance: ``"srgb"`` clips it, ``"filmic"`` rolls it off.
    layers
        More images for an EXR, (height, width, 3) or (height, width), by the names of their layers;
        other formats have none.

    Raises
    ------
    ValueError, OSError
        See `check_target`; also OSError where writing fails, such as on a full disk.
    """
    check_target(path, exposure=exposure, curve=curve)
    image = np.ascontiguousarray(image, np.float32)
    header = to_header(metadata)
    with replacing(Path(path)) as stream:
        match Path(path).suffix.lower():
            case ".exr":
                write_exr(stream, path, {"RGB": image, **(layers or {})}, header)
            case ".png":
                write_png(stream, image, header, exposure=exposure, curve=curve)
            case _:
                np.save(stream, image)


def read(
    path: str | os.PathLike[str],
) -> tuple[dict[str, NDArray[np.float32]], dict[str, str | int | float]]:
    """Read a picture with linear radiance, by the suffix of `path`: ``.exr`` or ``.npy``.

    Returns
    -------
    layers
        Images of shape (height, width, 3) or (height, width); the picture itself is the layer
        ``"RGB"``, of the former shape, and the only one of an NPY.
    metadata
        What `write` was given; an NPY has none.

    Raises
    ------
    OSError
        The file is missing or unreadable.
    ValueError
        It has another suffix or format, or it is not a picture in colour.
    """
    match Path(path).suffix.lower():
        case ".exr":
            return read_exr_layers(path)
        case ".npy":
            return {"RGB": _read_npy(path)}, {}
    raise ValueError(f"{path}: a picture to read must end with {' or '.join(READABLE)}")


def _read_npy(path: str | os.PathLike[str]) -> NDArray[np.float32]:
    with open_regular(path) as stream:
        try:
            array = read_npy(stream)
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from error
    if array.ndim != 3 or array.shape[2] != 3 or not array.size or array.dtype.kind != "f":
        found = f"{array.dtype} {array.shape}"
        raise ValueError(f"{path}: its array is {found}; it must be of floats (height, width, 3)")
    try:
        with np.errstate(over="raise"):
            return array.astype(np.float32)
    except FloatingPointError:
        raise ValueError(f"{path}: its values are too large for float32") from None


def write_png(
    stream: BinaryIO,
    image: NDArray[np.float32],
    header: Mapping[str, str],
    *,
    exposure: float = 0.0,
    curve: str = "srgb",
) -> None:
    """Write linear radiance (height, width, 3) as an sRGB picture of 8 bits; see `write`."""
    from PIL import Image, PngImagePlugin

    chunks = PngImagePlugin.PngInfo()
    for name, text in header.items():
        chunks.add_text(name, text)
    pixels = np.empty(image.shape, np.uint8)
    for row, radiance in zip(pixels, image, strict=True):
        row[:] = to_display(radiance, exposure, curve)
    Image.fromarray(pixels).save(stream, format="PNG", pnginfo=chunks)
