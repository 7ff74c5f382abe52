"""The error of light that is seen directly, measured with many more camera rays.

The edge of a light may cover a thousandth of a pixel. Until the first sample hits it, it is missing
from the picture and from its estimated error, and a few hits tell little of it. Camera rays alone
are cheap, and the pixels that may show a light are known. They get many more camera rays than the
picture has samples.

Let f be the emission that a picture has found in a pixel, and s what additional rays see, whose
variance is less by a factor k. Let e = f − E[f] be the error, v its variance, and d = f − s. Then

    E[e² | d] = κ² d² + (1 − κ) v,    κ = k / (k + 1),

if f and s are normal. With many rays that is d², and v need not be known.

A ray that meets a light is not reflected. Let L be the light's radiance, and r the mean of what the
pixel reflects. The covariance of a sample's emission and reflected light is −f r, the variance of
its emission f (L − f). So of an error e of emission, e r / (L − f) is made up for.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from drpt.error import DARK, TINY, Estimate, squared_differences

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

FACTOR = 64
"""Largest number of camera rays through a pixel, per sample of a pixel of the picture."""
SHARE = 0.25
"""Largest number of camera rays of all pixels, per sample of the whole picture."""
LEAST_RAYS = 2**17
"""Least number of camera rays of all pixels together, which take about a hundredth of a second."""


@dataclass(frozen=True, eq=False)
class Emission:
    """Directly visible emission in some pixels.

    Attributes
    ----------
    pixels
        Their numbers (n,), row by row from 0.
    blocks
        Sums of the emission in runs of the picture's samples (runs, n, 3), as in the film.
    found
        Mean of what all samples of the picture have found, (n, 3).
    seen
        Mean of what additional camera rays see, (n, 3).
    factor
        Additional camera rays per sample of the picture.
    radiance
        Greatest radiance of a light, (3,).
    """

    pixels: NDArray[np.int64]
    blocks: Array
    found: Array
    seen: Array
    factor: float
    radiance: Array

    def less_reflected(self, image: Array) -> Emission:
        """Less what is made up for by what pixels of values (n, 3) reflect."""
        left = np.maximum(self.radiance - self.found, TINY)
        share = np.clip(1 - np.maximum(image - self.found, 0) / left, 0, 1)
        parts = self.blocks * share, self.found * share, self.seen * share
        return Emission(self.pixels, *parts, self.factor, self.radiance)


def measured(
    estimate: Estimate, blocks: NDArray[np.floating], size: int, light: Emission
) -> Estimate:
    """Estimate the error of a picture anew, in which that of directly visible light is measured.

    Parameters
    ----------
    estimate
        Estimate from the samples of the picture alone.
    blocks, size
        Sums of runs of ``size`` samples (runs, pixels, 3), of which the estimate was made.
    light
        Directly visible light.
    """
    chosen, shape = light.pixels, estimate.image.shape
    image = estimate.image.reshape(-1, 3).copy()
    differences = estimate.differences.reshape(len(estimate.differences), -1, 3).copy()
    trust = light.factor / (light.factor + 1)
    squares = np.zeros_like(image)
    with np.errstate(invalid="ignore", over="ignore"):  # such errors are not a number, or infinite
        light = light.less_reflected(image[chosen])
        error = light.found - light.seen
        image[chosen] -= error
        reflected = (blocks[:, chosen] - light.blocks).astype(np.float32)
        differences[:, chosen] = squared_differences(reflected, size)
        squares[chosen] = trust**2 * error**2 + (1 - trust) * _variances(estimate, light, size)
        squares /= image**2 + DARK
    return Estimate(
        differences.reshape(-1, *shape),
        image.reshape(shape),
        estimate.growth,
        estimate.independent,
        squares.reshape(shape),
    )


def _variances(estimate: Estimate, light: Emission, size: int) -> Array:
    """Variances (n, 3) of the emission that a picture has found, as far as its samples tell."""
    if not len(light.pixels):
        return light.found
    levels = squared_differences(light.blocks.astype(np.float32), size)[:, None]
    found = Estimate(levels, light.found[None], estimate.growth, estimate.independent)
    return np.asarray(found.variances[0])


def rays_for(few: int, pixels: int, spp: int) -> int:
    """Camera rays through each of a few of all pixels, a power of two."""
    factor = max(1, min(FACTOR, SHARE * pixels / max(few, 1)))
    rays = max(int(factor * spp), LEAST_RAYS // max(few, 1))
    return 1 << (rays.bit_length() - 1)


def runs(pixels: NDArray[np.int64]) -> Iterator[range]:
    """Split ascending pixels (n,) into ranges without gaps."""
    if len(pixels):
        for part in np.split(pixels, np.flatnonzero(np.diff(pixels) > 1) + 1):
            yield range(int(part[0]), int(part[-1]) + 1)
