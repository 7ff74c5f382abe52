"""How far a picture is from its expectation, estimated from the samples it is made of.

The samples of a pixel stand in a sequence of which each aligned run of 2ᵏ is as evenly spread as
k allows, and any two neighbouring runs stand to each other like any other two of that size. Let v
be the variance of the mean of a run, and A and B the means of its halves. As A and B are alike,

    v(run) = v(half) − E[((A − B) / 2)²].

So the differences of halves tell how fast v falls: by the factor ρ from one size to the next, if
they do. What they do not tell is where it ends; if it goes on to fall like this,

    v(run) = E[((A − B) / 2)²] / (ρ − 1).

Independent samples have ρ = 2, where this is the usual estimate; Owen-scrambled Sobol' points,
whose halves complement each other, more (Owen 1997, "Scrambled Net Variance for Integrals of Smooth
Functions": up to 8). No sample is spent on it, and the points stay as even as they are: a picture
of four independent replicates has 1.5 to 2 times the relMSE in the Cornell boxes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from drpt.convergence import INDEPENDENT, combined, fall, local_ratios, ratio
from drpt.pooling import pooled

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Mask = NDArray[np.bool_]

DARK = 0.01
"""Added to squares of radiance, so that dark pixels do not decide about relMSE."""
AT_ONCE = 2**14
"""Pixels whose blocks and their differences stay in the cache: new memory takes longest."""
DEVIATIONS = 3
"""Standard deviations to the bound of a relMSE. Squares of one pixel's error have a long tail."""
SCATTER = 1.6
"""Variance of the squared error of a pixel and of its estimate, over the mean square of estimates.

The former is 2 e⁴ and 2/3 e⁴, as the estimate has three degrees of freedom, the latter 5/3 e⁴.
"""
CERTAIN = 2
"""Standard errors that a pixel's brightness exceeds by what is certain of it."""
TINY = np.finfo(np.float64).tiny
WINDOW = 5
"""Pixels along the sides of the squares in which noise is averaged, for `_weights`."""


def relative_mse(squares: Array, image: Array) -> float:
    """Mean of e² / (x² + 0.01) over pixels and channels, (height, width, 3) each.

    ``squares`` are e², variances of the image x, which stands for the truth: see `_weights`.
    """
    return float(np.mean(squares * _weights(image, squares)))


def squared_differences(blocks: NDArray[np.float32], size: int) -> NDArray[np.float32]:
    """Squares of (A − B) / 2 for the means A and B of neighbouring runs of samples.

    Of the sums of four runs of ``size`` samples, (4, …), those of the halves of all, then the means
    of those of the halves of halves, (2, …). Of two runs the first, (1, …); of fewer none, (0, …).
    """
    levels = np.empty((len(blocks) // 2, *blocks.shape[1:]), np.float32)
    with np.errstate(invalid="ignore", over="ignore"):  # such errors are not a number, or infinite
        for start in range(0, levels.shape[1], AT_ONCE):
            part = slice(start, start + AT_ONCE)
            for level, squares in zip(
                levels[:, part], _squares(blocks[:, part], size), strict=True
            ):
                level[:] = squares
    return levels


def _squares(blocks: NDArray[np.float32], size: int) -> list[NDArray[np.float32]]:
    if len(blocks) < 4:
        return [np.square((a - b) * np.float32(0.5 / size)) for a, b in pairwise(blocks)]
    a, b, c, d = blocks * np.float32(0.25 / size)
    return [np.square(a + b - c - d), 2 * (np.square(a - b) + np.square(c - d))]


def estimate(
    differences: NDArray[np.float32],
    image: Array,
    growth: float,
    *,
    independent: bool,
    lights: Mask | None = None,
) -> tuple[Array, float]:
    """Standard errors (height, width, 3) of an image of that shape, and its relMSE.

    They are not a number if unknown. Parameters are those of :class:`Estimate` and of
    :meth:`Estimate.standard_errors`; by default no pixel shows a light.
    """
    found = Estimate(differences, image, growth, independent)
    if lights is None:
        lights = np.zeros(image.shape[:2], np.bool_)
    return found.standard_errors(lights), found.relative_mse


@dataclass(frozen=True, eq=False)
class Estimate:
    """Error of an image, estimated from its samples.

    Parameters
    ----------
    differences
        What :func:`squared_differences` tells, (2, 1 or 0, height, width, 3).
    image
        Mean of all samples.
    growth
        How many samples there are for one of those that the differences are of.
    independent
        Whether samples are independent; else they are Sobol' points.
    measured
        Squared errors that are known besides, relative to the image, (height, width, 3) or 0; see
        :func:`drpt.missed.measured`.
    """

    differences: NDArray[np.float32]
    image: Array
    growth: float
    independent: bool
    measured: Array | float = 0.0

    def standard_errors(self, lights: Mask) -> Array:
        """Standard error of each value, (height, width, 3); not a number if unknown.

        Variances are averaged over pixels around that are as noisy; see :mod:`drpt.pooling`.
        ``lights`` are the pixels (height, width) that a light touches.
        """
        if not self._levels:
            return np.full_like(self.image, np.nan)
        ratios: Array | float = self._ratio
        if not self.independent and len(self._levels) > 1:
            coarse, fine = self._levels
            ratios = local_ratios(coarse, fine, self._ratio, lights)[..., None]
        return np.sqrt(pooled(self._variances(ratios), self.image, lights))

    @cached_property
    def relative_squares(self) -> Array:
        """Variance of each value by its square, (height, width, 3), whose mean is the relMSE.

        Each tells little by itself: it is of the samples of one pixel.
        """
        if not self._levels:
            return np.full_like(self.image, np.nan)
        return self.variances * self._weights + self.measured

    @property
    def variances(self) -> Array:
        """Variance of each value (height, width, 3), of its own samples but for ρ."""
        return self._variances(self._ratio)

    @property
    def relative_mse(self) -> float:
        """Estimated relMSE of the image; not a number if unknown."""
        return float(np.mean(self.relative_squares))

    @property
    def bound(self) -> float:
        """Half of the relMSE that the image does not exceed, but for a few in a hundred pictures.

        It is no less than `relative_mse`, and larger where few pixels hold most of the error: then
        they may have been estimated too low, and what is left of their noise is not averaged out.
        """
        return self.bound_in(np.ones(self.image.shape[:2], np.bool_))

    def bound_in(self, chosen: NDArray[np.bool_]) -> float:
        """Bound for the image, were there no error but in the pixels chosen (height, width)."""
        if not self._levels:
            return np.nan
        mean = float(np.sum(self.relative_squares[chosen])) / self.image.size
        shares = self._largest_squares[chosen].mean(axis=1) / chosen.size
        scatter = DEVIATIONS * np.sqrt(SCATTER * np.sum(np.square(shares)))
        return float(max(mean, (mean + scatter) / 2))

    @cached_property
    def _largest_squares(self) -> Array:
        """Variance of each value by its square, both as bad as its own samples allow for.

        A few pixels need not have the picture's ρ, but samples are no worse than independent ones.
        The square of a value x of variance v is x² − v on average. A pixel beside a light may be
        dark, but for rare samples: neither its neighbours nor those samples tell how dark.
        """
        variances = self._variances(INDEPENDENT)
        with np.errstate(invalid="ignore"):  # of what is not finite, the weight is not a number
            least = np.maximum(np.square(self.image) - variances, 0)
        return variances * np.maximum(self._weights, 1 / (least + DARK))

    @cached_property
    def _levels(self) -> list[Array]:
        return [level.astype(np.float64) for level in self.differences]

    @cached_property
    def _weights(self) -> Array:
        """1 / (x² + 0.01), where x is no less than what is certain of the pixel itself.

        A small light may be in one pixel alone, of which its neighbours do not tell.
        """
        around = _weights(self.image, _average(self._levels[0], WINDOW))
        with np.errstate(invalid="ignore"):  # of what is not finite, the weight is not a number
            noise = np.sqrt(self._squares(INDEPENDENT))
            certain = np.maximum(np.abs(self.image) - CERTAIN * noise, 0)
        weights: Array = np.minimum(around, 1 / (np.square(certain) + DARK))
        return weights

    @cached_property
    def _ratio(self) -> float:
        """ρ of the picture."""
        if self.independent or len(self._levels) < 2:
            return INDEPENDENT
        return ratio(*(level * self._weights for level in self._levels))

    def _variances(self, ratios: Array | float) -> Array:
        """Variances, each unbiased but for ρ."""
        return self._squares(ratios) * (fall(self.growth, ratios) / (ratios - 1))

    def _squares(self, ratios: Array | float) -> Array:
        """Squares of differences of halves."""
        coarse, *finer = self._levels
        return combined(coarse, finer[0], ratios) if finer else coarse


def _weights(image: Array, noise: Array) -> Array:
    """1 / (x² + 0.01), of what x is without noise, whose variance is known about.

    Noise that made a pixel bright must not hide itself. So, as in the filter of Lee (1980, "Digital
    Image Enhancement and Noise Filtering by Use of Local Statistics"), a pixel is drawn to the mean
    of its neighbours, the more of their variance is noise; but here they alone decide.
    """
    with np.errstate(invalid="ignore", over="ignore"):  # weights of what is not finite are none
        mean = _of_neighbours(image)
        variance = np.maximum(_of_neighbours(np.square(image)) - mean**2, TINY)
        kept = np.maximum(variance - _of_neighbours(noise), 0) / variance
        weights: Array = 1 / (np.square(mean + kept * (image - mean)) + DARK)
    return weights


def _of_neighbours(values: Array) -> Array:
    """Means of the eight pixels around each."""
    return (9 * _average(values, 3) - values) / 8


def _average(values: Array, side: int) -> Array:
    """Means over squares of pixels, mirrored beyond the edges."""
    for axis in (0, 1):
        count, margin = values.shape[axis], [(0, 0)] * values.ndim
        margin[axis] = side // 2, side // 2
        padded = np.moveaxis(np.pad(values, margin, mode="symmetric"), axis, 0)
        total = padded[:count] / side
        for k in range(1, side):
            total += padded[k : k + count] / side
        values = np.moveaxis(total, 0, axis)
    return values
