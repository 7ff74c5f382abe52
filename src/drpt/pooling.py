"""Variances of pixels, averaged over neighbours with similar noise.

The few differences of blocks of one pixel are a poor estimate of its variance, so variances are
averaged over neighbouring pixels. The edge of a light may have 10⁶ times the variance of its
surroundings, and a pixel whose samples are all equal has none. So each pair of pixels in a window
exchanges a share of the difference of their variances: much if they are similar, almost nothing if
one is many times the other (as in Perona & Malik 1990, "Scale-Space and Edge Detection Using
Anisotropic Diffusion"). Brightness is known better than variance, so pixels must be similar in
both. Pixels that a light touches exchange nothing with others: their variances may be similar by
chance, but come of another noise. The sum of the variances is preserved, so the mean over a region
stays unbiased, apart from exchange across its border.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Mask = NDArray[np.bool_]
    Planes = NDArray[np.float32]

LIKE = (6.0, 4.0, 4.0)
"""Ratio of variances up to which pixels are similar, for each pass. Beyond it, the share falls with
the square of the ratio. Variances scatter less after the first pass."""
ALIKE = 1.75
"""Ratio of brightness up to which pixels are similar."""
RADIUS = 2
"""Radius of the window in pixels."""
ROUNDING = 1e-6
"""Relative standard errors up to this may be due to rounding, so the pixels are not pooled."""
TINY = np.finfo(np.float32).tiny
"""Added to what divides, so that nothing is divided by 0."""
STRIP = 2**16
"""Number of pixels that are pooled at once, so that they fit the cache."""


def pooled(variances: Array, image: Array, lights: Mask) -> Array:
    """Return pooled variances of an image, both (height, width, 3).

    ``lights`` are the pixels (height, width) that a light touches. Pixels with a variance that is
    not finite are left unchanged.
    """
    with np.errstate(over="ignore"):  # overflow gives infinity, which is left unchanged
        planes = np.ascontiguousarray(np.moveaxis(variances, 2, 0), np.float32)
        least = np.square(np.moveaxis(image, 2, 0) * ROUNDING).astype(np.float32)
        bright = np.maximum(image.max(axis=2), TINY).astype(np.float32)
    _, height, width = planes.shape
    result, halo = np.empty_like(planes), RADIUS * len(LIKE)
    rows = max(halo, STRIP // width)
    for start in range(0, height, rows):
        first, stop = max(start - halo, 0), min(start + rows, height)
        part = slice(first, min(stop + halo, height))
        strip = _pooled(planes[:, part], least[:, part], bright[part], lights[part])
        result[:, start:stop] = strip[:, start - first : stop - first]
    return np.moveaxis(result, 0, 2).astype(np.float64)


def _pooled(planes: Planes, least: Planes, bright: Planes, lights: Mask) -> Planes:
    with np.errstate(invalid="ignore", over="ignore"):  # variances that are not finite
        noisy = np.isfinite(planes.sum(axis=0)) & (planes > least)
    variances, bright = np.where(noisy, planes, 0), np.where(noisy.any(axis=0), bright, 1)
    partly = bool((noisy.any(axis=0) != noisy.all(axis=0)).any())
    mixed = lights.any() and not lights.all()
    for like in LIKE:
        noise = variances.sum(axis=0) + TINY
        flows = np.zeros_like(variances)
        for a, b in _pairs(*noise.shape):
            share = _share(noise[a], noise[b], bright[a], bright[b], like)
            if mixed:
                share *= lights[a] == lights[b]
            flow = variances[:, *b] - variances[:, *a]
            flow *= share
            if partly:
                flow *= noisy[:, *a] & noisy[:, *b]
            flows[:, *a] += flow
            flows[:, *b] -= flow
        variances += flows
    return np.where(noisy, variances, planes)


def _share(a: Planes, b: Planes, bright_a: Planes, bright_b: Planes, like: float) -> Planes:
    """Share of the difference that pixels with variances a and b exchange; none if one has none."""
    alike = _similarity(bright_a, bright_b, ALIKE)
    alike *= _similarity(a, b, like)
    alike *= alike
    alike *= np.float32((2 * RADIUS + 1) ** -2)
    return alike


def _similarity(a: Planes, b: Planes, like: float) -> Planes:
    """1 up to a ratio of ``like``, beyond it less in inverse proportion."""
    larger = np.maximum(a, b)
    ratio = np.minimum(a, b)
    ratio *= np.float32(like)
    ratio /= larger
    return np.minimum(ratio, 1, out=ratio)


def _pairs(height: int, width: int) -> Iterator[tuple[tuple[slice, slice], tuple[slice, slice]]]:
    """All pairs of pixels in a window, each offset as two slices of the picture; each pair once."""
    for down in range(min(RADIUS + 1, height)):
        for right in range(-RADIUS if down else 1, RADIUS + 1):
            aside = abs(right)
            if aside < width:
                left, other = slice(0, width - aside), slice(aside, width)
                columns = (left, other) if right >= 0 else (other, left)
                yield (slice(0, height - down), columns[0]), (slice(down, height), columns[1])
