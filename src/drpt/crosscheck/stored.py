"""Estimates in EXR files: the mean as the picture, its variance as a layer beside it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from drpt.crosscheck.estimate import Estimate
from drpt.output import read_exr_layers, write

if TYPE_CHECKING:
    from collections.abc import Mapping
    from os import PathLike

    from numpy.typing import NDArray

    Metadata = Mapping[str, str | int | float]

VARIANCE = "variance"
"""Name of the layer that holds the variance of the mean."""


def save_estimate(estimate: Estimate, path: str | PathLike[str], metadata: Metadata) -> None:
    """Write an estimate as float32 EXR, with its passes, its spp and more metadata.

    Raises `ValueError` and `OSError` like :func:`drpt.output.write`, and `ValueError` where a
    variance is too small or too large for float32.
    """
    tiny, huge = np.finfo(np.float32).tiny, np.finfo(np.float32).max
    spread = estimate.variance[estimate.variance > 0]
    if spread.size and not tiny <= spread.min() <= spread.max() <= huge:
        raise ValueError(f"{path}: its variances do not fit float32; scale the scene's radiance")
    figures = {"spp": estimate.spp, "passes": estimate.passes}
    layers = {VARIANCE: estimate.variance.astype(np.float32)}
    write(path, estimate.mean.astype(np.float32), {**metadata, **figures}, layers=layers)


def load_estimate(path: str | PathLike[str]) -> tuple[Estimate, dict[str, str | int | float]]:
    """Read an estimate and its metadata.

    A picture without a layer of variances has no passes and variance 0: it is taken as exact.
    Raises `ValueError` and `OSError` like :func:`drpt.output.read_exr`, and `ValueError` where
    radiance or variances are negative or not finite, or the metadata is not what it must be.
    """
    layers, metadata = read_exr_layers(path)
    mean = _checked(layers["RGB"], path, "radiance")
    if VARIANCE not in layers:
        return Estimate(mean, np.zeros_like(mean), 0, 0), metadata
    passes, spp = (whole(metadata, path, name, low=2) for name in ("passes", "spp"))
    return Estimate(mean, _checked(layers[VARIANCE], path, VARIANCE), passes, spp), metadata


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
