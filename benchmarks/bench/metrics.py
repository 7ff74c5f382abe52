"""Error of a picture against a reference, and the time that an error takes."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from drpt.error import DARK

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from drpt.crosscheck.estimate import Estimate

    Image = NDArray[np.floating]


SLOPES = -1.5, -1.0
"""Log error over log time in the end: of Sobol' points at edges, and of independent samples."""


class Bias(NamedTuple):
    """Relative difference of the image means, and its standard error."""

    value: float
    standard_error: float


class Reach(NamedTuple):
    """Seconds until an error is reached, and whether that lies outside of what was measured."""

    seconds: float
    extrapolated: bool


def rel_mse(image: Image, reference: Estimate) -> float:
    """Mean of (x − x̂)² / (x̂² + 0.01), less what the noise of the reference adds to it."""
    squares = (image - reference.mean) ** 2 - reference.variance
    return float((squares / (reference.mean**2 + DARK)).mean())


def own_rel_mse(estimate: Estimate) -> float:
    """The expected relMSE of an estimate, by its own variance."""
    return float((estimate.variance / (estimate.mean**2 + DARK)).mean())


def bias(image: Image, reference: Estimate) -> Bias:
    """How far the mean of an image is off, and how far it may be by the noise of its pixels."""
    difference = (image - reference.mean).mean(axis=2)
    mean = reference.mean.mean()
    return Bias(
        float(difference.mean() / mean), float(difference.std() / difference.size**0.5 / mean)
    )


def slope(seconds: Sequence[float], errors: Sequence[float]) -> float | None:
    """Slope of log error over log time, by least squares over the last decade of time.

    Fixed costs matter before that. None where it has less than two points.
    """
    log_seconds = np.log10(seconds)
    last = log_seconds >= log_seconds.max() - 1
    if last.sum() < 2:
        return None
    return float(np.polyfit(log_seconds[last], np.log10(errors)[last], 1)[0])


def time_to(target: float, seconds: Sequence[float], errors: Sequence[float]) -> Reach:
    """Seconds to an error, by a line through two neighbouring points in log–log.

    Beyond the last point, error goes on to fall by the slope of the last decade, within `SLOPES`;
    before the first one, as 1 / time.
    """
    inside = [i for i in range(1, len(errors)) if errors[i] <= target < errors[i - 1]]
    if not inside:
        reached = errors[0] <= target
        power = -1.0 if reached else float(np.clip(slope(seconds, errors) or -1.0, *SLOPES))
        nearest = 0 if reached else -1
        return Reach(float(seconds[nearest] * (target / errors[nearest]) ** (1 / power)), True)
    pair = slice(inside[0] - 1, inside[0] + 1)
    log_errors, log_seconds = np.log(errors[pair])[::-1], np.log(seconds[pair])[::-1]
    return Reach(float(np.exp(np.interp(np.log(target), log_errors, log_seconds))), False)
