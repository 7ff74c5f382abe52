"""Variances of pixels, averaged over neighbours with similar noise.

The few differences of blocks of one pixel are a poor estimate of its variance, so variances are
averaged over neighbouring pixels. The edge of a light may have 10⁶ times the variance of its
surroundings, and a pixel whose samples are all equal has none. So each pair of pixels in a window
exchanges a share of the difference of their variances: much if they are similar, almost nothing if
one is many times the other (as in Perona & Malik 1990, "Scale-Space and Edge Detection Using
Anisotropic Diffusion"). The sum of the variances is preserved, so the mean over a region stays
unbiased, apart from exchange across its border.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Planes = NDArray[np.float32]

LIKE = (6.0, 4.0, 4.0)
"""Ratio of variances up to which pixels are similar, for each pass. Beyond it, the share falls with
the square of the ratio. Variances scatter less after the first pass."""
RADIUS = 2
"""Radius of the window in pixels."""
ROUNDING = 1e-6
"""Relative standard errors up to this may be due to rounding, so the pixels are not pooled."""
STRIP = 2**16
"""Number of pixels that are pooled at once, so that they fit the cache."""


def pooled(variances: Array, image: Array) -> Array:
    """Return pooled variances of an image, both (height, width, 3).

    Pixels with a variance that is not finite are left unchanged.
    """
    with np.errstate(over="ignore"):  # overflow gives infinity, which is left unchanged
        planes = np.ascontiguousarray(np.moveaxis(variances, 2, 0), np.float32)
        least = np.square(np.moveaxis(image, 2, 0) * ROUNDING).astype(np.float32)
    _, height, width = planes.shape
    result, halo = np.empty_like(planes), RADIUS * len(LIKE)
    rows = max(halo, STRIP // width)
    for start in range(0, height, rows):
        first, stop = max(start - halo, 0), min(start + rows, height)
        part = slice(first, min(stop + halo, height))
        strip = _pooled(planes[:, part], least[:, part])
        result[:, start:stop] = strip[:, start - first : stop - first]
    return np.moveaxis(result, 0, 2).astype(np.float64)


def _pooled(planes: Planes, least: Planes) -> Planes:
    with np.errstate(invalid="ignore", over="ignore"):  # variances that are not finite
        noisy = np.isfinite(planes.sum(axis=0)) & (planes > least)
    for like in LIKE:
        noise = np.sum(planes, axis=0, where=noisy)
        result = planes.copy()
        for a, b in _pairs(*noise.shape):
            flow = np.zeros_like(planes[:, *a])
            np.subtract(planes[:, *b], planes[:, *a], out=flow, where=noisy[:, *a] & noisy[:, *b])
            flow *= _share(noise[a], noise[b], like)
            result[:, *a] += flow
            result[:, *b] -= flow
        planes = result
    return planes


def _share(a: Planes, b: Planes, like: float) -> Planes:
    """Share of the difference that pixels with variances a and b exchange."""
    larger = np.maximum(a, b)
    ratio = np.minimum(a, b) * np.float32(like)
    np.divide(ratio, larger, out=ratio, where=larger > 0)
    np.minimum(ratio, 1, out=ratio)
    return np.square(ratio) * np.float32((2 * RADIUS + 1) ** -2)


def _pairs(height: int, width: int) -> Iterator[tuple[tuple[slice, slice], tuple[slice, slice]]]:
    """All pairs of pixels in a window, each offset as two slices of the picture; each pair once."""
    for down in range(min(RADIUS + 1, height)):
        for right in range(-RADIUS if down else 1, RADIUS + 1):
            aside = abs(right)
            if aside < width:
                left, other = slice(0, width - aside), slice(aside, width)
                columns = (left, other) if right >= 0 else (other, left)
                yield (slice(0, height - down), columns[0]), (slice(down, height), columns[1])
