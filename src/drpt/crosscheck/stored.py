"""Estimates in EXR files: the mean as the picture, its noise as a layer beside it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from drpt.crosscheck.estimate import PASSES, Estimate
from drpt.output import read_exr_layers, write
from drpt.result import STANDARD_ERROR

if TYPE_CHECKING:
    from collections.abc import Mapping
    from os import PathLike

    from numpy.typing import NDArray

    Metadata = Mapping[str, str | int | float]

VARIANCE = "variance"
"""Name of the layer that holds the variance of the mean."""
CALIBRATION = 1.4
"""Factor by which a picture's own estimate of its variance may be too small.

See docs/explanation/error.md, where it is measured.
"""


def save_estimate(estimate: Estimate, path: str | PathLike[str], metadata: Metadata) -> None:
    """Write an estimate as float32 EXR, with its passes, its spp and more metadata.

    Where a variance is too small or too large for float32, the layer is ``standard_error``; where
    the noise is unknown, there is none. Raises `ValueError` and `OSError` like
    :func:`drpt.output.write`.
    """
    image = estimate.mean.astype(np.float32)
    if not estimate.is_noise_known:
        write(path, image, metadata)
        return
    figures = {"spp": estimate.spp, "passes": estimate.passes}
    write(path, image, {**metadata, **figures}, layers=_noise_layer(estimate))


def _noise_layer(estimate: Estimate) -> dict[str, NDArray[np.float32]]:
    tiny, huge = np.finfo(np.float32).tiny, np.finfo(np.float32).max
    spread = estimate.variance[estimate.variance > 0]
    if not spread.size or tiny <= spread.min() <= spread.max() <= huge:
        return {VARIANCE: estimate.variance.astype(np.float32)}
    return {STANDARD_ERROR: np.sqrt(estimate.variance).astype(np.float32)}


def load_estimate(path: str | PathLike[str]) -> tuple[Estimate, dict[str, str | int | float]]:
    """Read an estimate and its metadata.

    The noise is taken from the layer ``variance``, or else from ``standard_error``, which every
    picture of drpt has. A ``standard_error`` without passes was estimated within one render: its
    square is multiplied by `CALIBRATION`, and treated as an estimate from `PASSES`. Without either
    layer the variance is not a number. Raises `ValueError` and `OSError` like
    :func:`drpt.output.read_exr`, and `ValueError` if radiance or noise is negative or not finite,
    or the metadata is not allowed.
    """
    layers, metadata = read_exr_layers(path)
    mean = _checked(layers["RGB"], path, "radiance")
    if VARIANCE in layers:
        variance = _checked(layers[VARIANCE], path, VARIANCE)
    elif STANDARD_ERROR in layers:
        variance = np.square(_checked(layers[STANDARD_ERROR], path, STANDARD_ERROR))
    else:
        return Estimate(mean, np.full_like(mean, np.nan), 0, 0), metadata
    if VARIANCE in layers or "passes" in metadata:
        passes, spp = (whole(metadata, path, name, low=2) for name in ("passes", "spp"))
        return Estimate(mean, variance, passes, spp), metadata
    spp = whole(metadata, path, "spp", low=2)
    return Estimate(mean, CALIBRATION * variance, PASSES, spp), metadata


def whole(metadata: Metadata, path: str | PathLike[str], name: str, low: int) -> int:
    """Return a whole number of the metadata, or raise `ValueError` if it is none from `low` on."""
    value = metadata.get(name)
    if isinstance(value, bool) or not isinstance(value, int) or value < low:
        raise ValueError(f"{path}: its {name} is {value!r}; it must be a whole number >= {low}")
    return value


def _checked(
    layer: NDArray[np.float32], path: str | PathLike[str], name: str
) -> NDArray[np.float64]:
    if layer.ndim != 3:
        raise ValueError(f"{path}: its layer {name} has one channel, and it must have three")
    wrong = ~(np.isfinite(layer) & (layer >= 0)).all(axis=2)
    if wrong.any():
        row, column = np.argwhere(wrong)[0].tolist()
        value = tuple(layer[row, column].tolist())
        raise ValueError(
            f"{path}: its {name} is {value} at pixel ({column}, {row}); it must be finite and >= 0"
        )
    return layer.astype(np.float64)
