"""Estimates in EXR files: the mean as the picture, its variance as a layer beside it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from drpt.crosscheck.estimate import Estimate
from drpt.output import read_exr_layers, write

if TYPE_CHECKING:
    from collections.abc import Mapping
    from os import PathLike

    Metadata = Mapping[str, str | int | float]

VARIANCE = "variance"
"""Name of the layer that holds the variance of the mean."""


def save_estimate(estimate: Estimate, path: str | PathLike[str], metadata: Metadata) -> None:
    """Write an estimate as float32 EXR, with its passes, its spp and more metadata.

    Raises `ValueError` and `OSError` like :func:`drpt.output.write`.
    """
    figures = {"spp": estimate.spp, "passes": estimate.passes}
    layers = {VARIANCE: estimate.variance.astype(np.float32)}
    write(path, estimate.mean.astype(np.float32), {**metadata, **figures}, layers=layers)


def load_estimate(path: str | PathLike[str]) -> tuple[Estimate, dict[str, str | int | float]]:
    """Read an estimate and its metadata.

    A picture without a layer of variances has no passes and variance 0: it is taken as exact.
    Raises `ValueError` and `OSError` like :func:`drpt.output.read_exr`.
    """
    layers, metadata = read_exr_layers(path)
    mean = layers["RGB"].astype(np.float64)
    if VARIANCE not in layers:
        return Estimate(mean, np.zeros_like(mean), 0, 0), metadata
    passes, spp = (int(metadata.get(name, 0)) for name in ("passes", "spp"))
    if min(passes, spp) < 2:
        raise ValueError(f"{path}: it has variances, but its metadata has no passes and spp")
    return Estimate(mean, layers[VARIANCE].astype(np.float64), passes, spp), metadata
