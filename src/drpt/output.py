"""Pictures on disk: EXR, PNG and NPY, each written whole or not at all."""

from __future__ import annotations

import json
import os
import secrets
from contextlib import contextmanager
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from numpy.typing import NDArray

SUFFIXES = (".exr", ".png", ".npy")
MAX_STOPS = 100.0
"""Largest exposure of a PNG: a float32 radiance times 2^100 is far from the end of float64."""

_PREFIX = "drpt:"
_MAGENTA = (1.0, 0.0, 1.0)


def check_target(path: str | os.PathLike[str], *, exposure: float = 0.0) -> None:
    """Find out, before anything is computed, whether `write` will accept `path` and `exposure`.

    Raises
    ------
    ValueError
        `path` is no path, its suffix names no known format, or the exposure is not in ±100 stops.
    OSError
        The folder is missing, is no folder or may not be written to, or what is there is no file.
    """
    if not isinstance(path, str | os.PathLike):
        raise ValueError(f"{path!r} is not allowed; it must be the path of a picture")
    path = Path(path)
    if path.suffix.lower() not in SUFFIXES:
        raise ValueError(f"{path}: the name of a picture must end with {', '.join(SUFFIXES)}")
    if not isinstance(exposure, Real) or not abs(exposure) <= MAX_STOPS:
        allowed = f"a number of stops from {-MAX_STOPS:g} to {MAX_STOPS:g}"
        raise ValueError(f"exposure: {exposure!r} is not allowed; it must be {allowed}")
    target = _target(path)
    if target.is_dir():
        raise IsADirectoryError(f"{path}: this is a folder, and a picture must be a file")
    if target.exists() and not target.is_file():
        raise OSError(f"{path}: this is a pipe or a device, and a picture must be a file")
    folder = target.parent
    if not folder.exists():
        raise FileNotFoundError(f"{path}: the folder {folder} does not exist")
    if not folder.is_dir():
        raise NotADirectoryError(f"{path}: {folder} is not a folder")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise PermissionError(f"{path}: the folder {folder} may not be written to")


def write(
    path: str | os.PathLike[str],
    image: NDArray[np.float32],
    metadata: Mapping[str, str | int | float],
    *,
    exposure: float = 0.0,
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
    layers
        More images of the same shape for an EXR, by the names of their layers; others have none.

    Raises
    ------
    ValueError, OSError
        See `check_target`; also OSError where writing fails, such as on a full disk.
    """
    check_target(path, exposure=exposure)
    image = np.ascontiguousarray(image, np.float32)
    header = {_PREFIX + name: _to_text(value) for name, value in metadata.items()}
    with _replacing(Path(path)) as stream:
        match Path(path).suffix.lower():
            case ".exr":
                _write_exr(stream, {"RGB": image, **(layers or {})}, header)
            case ".png":
                _write_png(stream, image, header, exposure)
            case _:
                np.save(stream, image)


def read_exr(
    path: str | os.PathLike[str],
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
    path: str | os.PathLike[str],
) -> tuple[dict[str, NDArray[np.float32]], dict[str, str | int | float]]:
    """Read every layer of an RGB picture that has the channels R, G and B; see `read_exr`.

    The picture itself is the layer ``"RGB"``, which must be there.
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
    prefixes = {name: f"{name}." for name in (n.rpartition(".")[0] for n in channels) if name}
    layers = {
        name: np.stack([channels[prefix + c].pixels for c in "RGB"], axis=-1).astype(np.float32)
        for name, prefix in {"RGB": "", **prefixes}.items()
        if {prefix + c for c in "RGB"} <= channels.keys()
    }
    metadata = {
        name.removeprefix(_PREFIX): _from_text(text)
        for name, text in header.items()
        if name.startswith(_PREFIX)
    }
    return layers, metadata


def _target(path: Path) -> Path:
    """Return the file behind a link, whether it exists or not; else the path as it is."""
    return Path(os.path.realpath(path)) if path.is_symlink() else path


@contextmanager
def _replacing(path: Path) -> Iterator[BinaryIO]:
    """Open a new file that takes the place of `path` once it is written without an error."""
    target = _target(path)
    temporary = target.with_name(f".drpt-{secrets.token_hex(8)}.tmp")
    try:
        with open(temporary, "xb") as stream:
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(temporary, target)
    except OSError as error:
        raise OSError(f"{path}: it could not be written ({error.strerror or error})") from error
    finally:
        temporary.unlink(missing_ok=True)


def _write_exr(
    stream: BinaryIO, layers: Mapping[str, NDArray[np.float32]], header: dict[str, str]
) -> None:
    import OpenEXR

    layout = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION}
    channels = {name: np.ascontiguousarray(layer, np.float32) for name, layer in layers.items()}
    OpenEXR.File({**layout, **header}, channels).write(stream)


def _write_png(
    stream: BinaryIO, image: NDArray[np.float32], header: dict[str, str], exposure: float
) -> None:
    from PIL import Image, PngImagePlugin

    chunks = PngImagePlugin.PngInfo()
    for name, text in header.items():
        chunks.add_text(name, text)
    pixels = np.empty(image.shape, np.uint8)
    for row, radiance in zip(pixels, image, strict=True):
        row[:] = to_display(radiance, exposure)
    Image.fromarray(pixels).save(stream, format="PNG", pnginfo=chunks)


def to_display(radiance: NDArray[np.floating[Any]], exposure: float = 0.0) -> NDArray[np.uint8]:
    """Return what an 8-bit sRGB display is sent for linear radiance, shape (…, 3).

    Source: IEC 61966-2-1 (1999).
    """
    linear = np.clip(radiance * np.exp2(np.float64(exposure)), 0.0, 1.0)
    linear[np.isnan(linear).any(axis=-1)] = _MAGENTA
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    levels: NDArray[np.uint8] = np.floor(255 * encoded + 0.5).astype(np.uint8)
    return levels


def _to_text(value: str | int | float) -> str:
    """Return a text from which `_from_text` makes an equal value of the same type."""
    plain = isinstance(value, str) and value.isascii() and _from_text(value) == value
    return str(value) if plain else json.dumps(value)


def _from_text(text: str) -> Any:
    try:
        return json.loads(text)
    except ValueError:
        return text
