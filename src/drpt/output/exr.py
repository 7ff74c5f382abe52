"""EXR files, and metadata as text."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping
    from os import PathLike

    from numpy.typing import NDArray

    Metadata = Mapping[str, str | int | float]

CHANNELS = {"normal": "XYZ", "depth": "Z"}
"""Channels of layers, as other renderers name them; else R, G and B, or the layer's name alone."""

_PREFIX = "drpt:"


def to_header(metadata: Metadata) -> dict[str, str]:
    """Return metadata as attributes of a file."""
    return {_PREFIX + name: _to_text(value) for name, value in metadata.items()}


def from_header(header: Mapping[str, Any]) -> dict[str, str | int | float]:
    """Return the metadata among the attributes of a file: what `to_header` was given."""
    return {
        name.removeprefix(_PREFIX): _from_text(text)
        for name, text in header.items()
        if name.startswith(_PREFIX)
    }


def write_exr(
    stream: BinaryIO, layers: Mapping[str, NDArray[np.float32]], header: Mapping[str, str]
) -> None:
    """Write layers (height, width, 3) or (height, width); ``"RGB"`` is the picture itself.

    The channels of layer ``x`` are ``x.R``, ``x.G`` and ``x.B``, that of a flat one is ``x``;
    `CHANNELS` tells of others.
    """
    import OpenEXR

    layout = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION}
    channels: dict[str, NDArray[np.float32]] = {}
    for name, layer in layers.items():
        if name in CHANNELS:
            planes = layer.reshape(*layer.shape[:2], -1)
            for index, letter in enumerate(CHANNELS[name]):
                channels[f"{name}.{letter}"] = np.ascontiguousarray(planes[..., index], np.float32)
        else:
            channels[name] = np.ascontiguousarray(layer, np.float32)
    OpenEXR.File({**layout, **header}, channels).write(stream)


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
    import OpenEXR

    with open(path, "rb") as stream:
        try:
            file = OpenEXR.File(stream, separate_channels=True)
            channels, header = file.channels(), file.header()
        except (RuntimeError, ValueError) as error:
            raise ValueError(f"{path}: this is not a readable EXR file ({error})") from error
    if not {"R", "G", "B"} <= channels.keys():
        raise ValueError(f"{path}: its channels are {', '.join(channels)}, not R, G and B")
    planes = {name: channel.pixels.astype(np.float32) for name, channel in channels.items()}
    return _layers(planes), from_header(header)


def _layers(planes: dict[str, NDArray[np.float32]]) -> dict[str, NDArray[np.float32]]:
    """Take channels together that make up a layer."""
    layers: dict[str, NDArray[np.float32]] = {}
    for prefix in dict.fromkeys(["", *(name.rpartition(".")[0] for name in planes)]):
        letters = CHANNELS.get(prefix, "RGB")
        members = [f"{prefix}.{letter}" if prefix else letter for letter in letters]
        if planes.keys() >= set(members):
            layer = np.stack([planes.pop(member) for member in members], axis=-1)
            layers[prefix or "RGB"] = layer[..., 0] if len(letters) == 1 else layer
    return {**layers, **planes}


def _to_text(value: str | int | float) -> str:
    """Return a text from which `_from_text` makes an equal value of the same type."""
    plain = isinstance(value, str) and value.isascii() and _from_text(value) == value
    return str(value) if plain else json.dumps(value)


def _from_text(text: str) -> Any:
    try:
        return json.loads(text)
    except ValueError:
        return text
