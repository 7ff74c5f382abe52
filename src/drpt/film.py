"""The film: a streaming mean and variance of passes, in float64."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


class Film:
    """Means of the samples of each pixel, and how much the means of passes vary.

    Every pixel sees the same passes in the same order; a pass may arrive in parts, each of some
    pixels (West 1979, "Updating Mean and Variance Estimates").

    Attributes
    ----------
    mean
        Mean of all samples so far, (pixels, 3).
    passes
        How many passes are complete.
    """

    def __init__(self, pixels: int) -> None:
        self.mean = np.zeros((pixels, 3))
        self.passes = 0
        self._samples = 0
        self._spread = np.zeros((pixels, 3))  # Σ count (pass mean − mean)²

    def add(self, pixels: range, sums: NDArray[np.float64], count: int) -> None:
        """Add a pass of ``count`` samples per pixel, or its part: the sums (len(pixels), 3)."""
        part = slice(pixels.start, pixels.stop)
        share = count / (self._samples + count)
        with np.errstate(invalid="ignore"):  # an infinite sample leaves a spread that is NaN
            deviation = sums / count - self.mean[part]
            self.mean[part] += share * deviation
            self._spread[part] += self._samples * share * deviation**2
        if pixels.stop == len(self.mean):
            self.passes += 1
            self._samples += count

    @property
    def variance(self) -> NDArray[np.float64]:
        """Variance of the mean (pixels, 3), estimated from the passes; NaN with less than two."""
        if self.passes < 2:
            return np.full_like(self.mean, np.nan)
        return self._spread / ((self.passes - 1) * self._samples)
