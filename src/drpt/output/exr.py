"""EXR files."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from drpt.files import open_regular
from drpt.messages import one_line, shortened
from drpt.output.exr_size import check_size
from drpt.output.metadata import from_header
from drpt.output.quiet import nothing_printed

if TYPE_CHECKING:
    from collections.abc import Mapping
    from os import PathLike

    from numpy.typing import NDArray


CHANNELS = {"normal": "XYZ", "depth": "Z"}
"""Channels of layers, as other renderers name them; else R, G and B, or the layer's name alone."""

PICTURE = "RGB"
"""Name of the layer that is the picture itself."""
MAX_LISTED = 100
"""Characters of names of channels in an error."""


def write_exr(
    stream: BinaryIO,
    path: str | PathLike[str],
    layers: Mapping[str, NDArray[np.float32]],
    header: Mapping[str, str],
) -> None:
    """Write layers (height, width, 3) or (height, width); ``"RGB"`` is the picture itself.

    The channels of layer ``x`` are ``x.R``, ``x.G`` and ``x.B``, that of a flat one is ``x``;
    `CHANNELS` tells of others.
    """
    import OpenEXR

    layout = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION}
    channels: dict[str, NDArray[np.float32]] = {}
    for name, layer in layers.items():
        planes = layer.reshape(*layer.shape[:2], -1)
        for index, channel in enumerate(_channels_of(name, layer.ndim == 3)):
            channels[channel] = np.ascontiguousarray(planes[..., index], np.float32)
    try:
        OpenEXR.File({**layout, **header}, channels).write(stream)
    except (RuntimeError, ValueError) as error:
        problem = f"no EXR file can hold this picture ({one_line(str(error))})"
        raise ValueError(f"{path}: {problem}") from error


def _channels_of(name: str, is_colour: bool) -> list[str]:
    """Names of the channels of a layer."""
    if name == PICTURE:
        return list("RGB")
    letters = CHANNELS.get(name, "RGB")
    if is_colour or letters == "Z":
        return [f"{name}.{letter}" for letter in letters]
    return [name]


def read_exr(
    path: str | PathLike[str],
) -> tuple[NDArray[np.float32], dict[str, str | int | float]]:
    """Read an RGB picture: an image of shape (height, width, 3), and the metadata of `write`.

    Metadata comes back equal and with its types; other programs' attributes are left out.

    Raises
    ------
    OSError
        The file is missing or unreadable.
    ValueError
        It is not an EXR file with the channels R, G and B.
    """
    layers, metadata = read_exr_layers(path)
    return layers["RGB"], metadata


def read_exr_layers(
    path: str | PathLike[str],
) -> tuple[dict[str, NDArray[np.float32]], dict[str, str | int | float]]:
    """Read every layer of an RGB picture, as `write_exr` takes them; see `read_exr`.

    The picture itself is the layer ``"RGB"``, which must be there; what is in no layer of three
    channels, such as another program's alpha, is a flat layer with the name of its channel.
    """
    try:
        with open_regular(path) as stream:
            channels, header = _read_file(stream)
        metadata = from_header(header)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error
    if not {"R", "G", "B"} <= channels.keys():
        found = shortened(", ".join(channels), MAX_LISTED)
        raise ValueError(f"{path}: its channels are {one_line(found)}, not R, G and B")
    for name, plane in channels.items():
        if plane.shape != channels["R"].shape:
            named = one_line(shortened(name, MAX_LISTED))
            raise ValueError(f"{path}: its channel {named} has another size than the picture")
    return _layers(channels), metadata


def _read_file(stream: BinaryIO) -> tuple[dict[str, NDArray[np.float32]], dict[str, Any]]:
    """Return channels and attributes of the first part of a file, after a look at its header."""
    import OpenEXR

    try:
        with nothing_printed():
            header = OpenEXR.File(stream, header_only=True)
            parts = [part.header for part in header.parts]
        check_size(parts, os.fstat(stream.fileno()).st_size)
        stream.seek(0)
        with nothing_printed():
            file = OpenEXR.File(stream, separate_channels=True)
            channels = file.channels()
            planes = {name: channels[name].pixels for name in channels}
        flat = {name: plane.astype(np.float32) for name, plane in planes.items()}
    except (RuntimeError, TypeError, UnicodeDecodeError) as error:
        raise ValueError(f"this is not a readable EXR file ({one_line(str(error))})") from error
    return flat, parts[0]


def _layers(planes: dict[str, NDArray[np.float32]]) -> dict[str, NDArray[np.float32]]:
    """Take channels together that make up a layer; one that is named as a layer is left out."""
    layers: dict[str, NDArray[np.float32]] = {}
    prefixes = dict.fromkeys(name.rpartition(".")[0] for name in planes)
    for prefix in sorted(prefixes.keys() - {PICTURE}):
        name = prefix or PICTURE
        members = _channels_of(name, is_colour=True)
        if planes.keys() >= set(members):
            layer = np.stack([planes.pop(member) for member in members], axis=-1)
            layers[name] = layer[..., 0] if len(members) == 1 else layer
    return {**planes, **layers}
