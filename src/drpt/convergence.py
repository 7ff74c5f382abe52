"""Convergence rate: twice the samples divide the variance of their mean by a factor ρ.

In a pixel that the edge of a light crosses, the integrand jumps along a curve in the plane. There
the variance of Sobol' points falls with the power 3/2 of their number (He & Wang 2015, "On the
Convergence Rate of Randomized Quasi-Monte Carlo for Discontinuous Functions"), once there are many.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Mask = NDArray[np.bool_]

INDEPENDENT, SMOOTH = 2.0, 8.0
"""Least and greatest ρ."""  # noqa: RUF001
EDGE = 2**1.5
"""ρ of many Sobol' points in a pixel that the edge of a light crosses."""  # noqa: RUF001
LEAST = 1.8
"""Least ρ of a few pixels: less than `INDEPENDENT`, as estimates scatter to both sides of it."""  # noqa: RUF001
PRIOR = 64
"""Weight, in pixels, of the prior that samples are independent; it matters in small pictures."""
LEVEL_PRIOR = 1
"""Weight, in pixels, of the prior that the samples of a noise level are independent."""
TILE_PRIOR = 3
"""Weight, in pixels, of the prior that a tile has the ratio of its noise level."""
EDGE_PRIOR = 3
"""Weight, in pixels, of the prior that pixels in a tile that a light touches have `EDGE`."""
TILE = 8
"""Side of a tile in pixels."""


def ratio(coarse: Array, fine: Array) -> float:
    """ρ of a picture, from the squared differences of blocks, (height, width, 3) each.

    ``fine`` are those of blocks of half the size of ``coarse``.
    """
    known = np.isfinite(coarse + fine)
    top, below = (float(np.sum(level, where=known)) / level.size for level in (coarse, fine))
    belief = PRIOR / coarse[..., 0].size * (top + below) / 2
    if not top + below > 0:
        return INDEPENDENT
    found = (below + INDEPENDENT * belief) / (top + belief)
    return float(np.clip(found, INDEPENDENT, SMOOTH))


def local_ratios(coarse: Array, fine: Array, whole: float, lights: Mask) -> Array:
    """ρ of each pixel (height, width), where ``whole`` is ρ of the picture.

    Edges of lights have another ρ than lit surfaces, and much more noise. So ρ is estimated for
    each noise level, a power of ten, within each tile of the picture, and interpolated linearly
    between levels: once for the pixels that a light touches, ``lights``, and once for the others.
    """
    coarse, fine = coarse.sum(axis=2), fine.sum(axis=2)
    noise = combined(coarse, fine, np.where(lights, EDGE, whole))
    known = np.isfinite(noise) & (noise > 0)
    if not known.any():
        return np.full(noise.shape, whole)
    noise[~known] = np.inf  # so that its relative value is 0
    level = np.log10(noise, where=known, out=np.zeros_like(noise))
    tiles = _Tiles(level, lights)
    top, below = (
        tiles.sums(np.divide(values, noise, where=known, out=np.zeros_like(noise)))
        for values in (coarse, fine)
    )
    of_level = _towards(INDEPENDENT, top[0].sum(axis=0), below[0].sum(axis=0), LEVEL_PRIOR)
    of_level = np.maximum(of_level, INDEPENDENT)
    ratios = np.stack(
        [
            _towards(of_level, top[0], below[0], TILE_PRIOR),
            _towards(EDGE, top[1], below[1], EDGE_PRIOR),
        ]
    )
    return tiles.at_pixels(np.clip(ratios, LEAST, SMOOTH))


def combined(coarse: Array, fine: Array, ratio: Array | float) -> Array:
    """Squared differences of the larger blocks, estimated from both sizes.

    There are two differences of the smaller size for one of the larger.
    """
    return (coarse + 2 * fine / ratio) / 3


def fall(growth: float, ratio: Array | float) -> Array:
    """Variance of the mean of a run and later samples together, over that of the mean of the run.

    ``growth`` is the ratio of both numbers of samples, from 1 to 2. The covariance of the means of
    two neighbouring runs is
    v(run of both) − E[((A − B) / 2)²] = (2/ρ − 1) v(run).
    """
    rest, ratio = growth - 1, np.asarray(ratio)
    of_rest = rest**2 * rest ** -np.log2(ratio) if rest else np.zeros_like(ratio)
    return np.asarray((1 + 2 * rest * (2 / ratio - 1) + of_rest) / growth**2)


def _towards(prior: Array | float, top: Array, below: Array, pixels: float) -> Array:
    """Ratio of sums of relative squares, shrunk towards a prior that weighs as some pixels."""
    return (below + pixels * prior) / (top + pixels)


class _Tiles:
    """Square tiles of pixels, each with a node at every integer noise level (height, width).

    Pixels that a light touches and others have nodes of their own.
    """

    def __init__(self, level: Array, lights: Mask) -> None:
        height, width = level.shape
        rows, columns = (np.arange(size) // TILE for size in (height, width))
        lower = np.floor(level)
        self._part = level - lower
        lower -= lower.min()
        count = int(rows[-1] + 1) * int(columns[-1] + 1)
        self._shape = (2, count, int(lower.max()) + 2)
        tile = rows[:, None] * int(columns[-1] + 1) + columns + count * lights
        self._lower = tile * self._shape[2] + lower.astype(np.int64)

    def sums(self, values: Array) -> Array:
        """Sums (2, tiles, levels) of values of pixels, each split between two nearest levels.

        The first are of pixels that no light touches.
        """
        size, lower = int(np.prod(self._shape)), self._lower.ravel()
        upper_share = (values * self._part).ravel()
        total = np.bincount(lower, values.ravel() - upper_share, size)
        total += np.bincount(lower + 1, upper_share, size)
        return np.asarray(total.reshape(self._shape))

    def at_pixels(self, nodes: Array) -> Array:
        """Interpolate values (2, tiles, levels) between levels."""
        lower, upper = nodes.ravel()[self._lower], nodes.ravel()[self._lower + 1]
        return np.asarray(lower + self._part * (upper - lower))
