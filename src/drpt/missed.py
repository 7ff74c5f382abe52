"""Directly visible light that the samples of a picture have missed.

The edge of a light may cover a thousandth of a pixel. Until the first sample hits it, it is missing
from the picture and from its estimated error. Camera rays alone are cheap, and the pixels that may
show a light are known. These pixels get many more camera rays than the picture has samples.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from drpt.error import DARK
from drpt.scene import Sphere

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from drpt.scene import Scene
    from drpt.scene.model import Shape

    Array = NDArray[np.float64]
    Seen = Callable[[range, int], Array]
    Found = Callable[[range], Array]
    Project = Callable[[Array], Array]

FACTOR = 64
"""Largest number of camera rays through a pixel, per sample of a pixel of the picture."""
SHARE = 0.25
"""Largest number of camera rays of all pixels, per sample of the whole picture."""
LEAST_RAYS = 2**17
"""Least number of camera rays of all pixels together, which take about a hundredth of a second."""


def missed(
    scene: Scene, image: Array, told: Array, spp: int, project: Project, seen: Seen, found: Found
) -> float:
    """RelMSE that missed light adds to that of an image (height, width, 3).

    Parameters
    ----------
    scene, image, spp
        The scene, its picture, and the samples per pixel of the picture.
    told
        Estimated squared errors (height, width, 3) relative to the image; only what exceeds them
        has been missed.
    project
        Function that projects points (n, 3) to x, y in pixels and depth, (n, 3); not a number for
        points behind the eye.
    seen
        Function that returns the directly visible emission (pixels, 3) of a range of pixels, given
        the number of camera rays per pixel.
    found
        Function that returns the same for the camera rays of the picture.
    """
    pixels, told = image.reshape(-1, 3), told.reshape(-1, 3)
    before = np.flatnonzero(before_lights(scene, project))
    rays = _rays_for(len(before), len(pixels), spp)
    relative = 0.0
    for part in _runs(before):
        lacking = np.maximum(seen(part, rays) - found(part), 0)
        chosen = slice(part.start, part.stop)
        squares = lacking**2 / ((pixels[chosen] + lacking) ** 2 + DARK)
        relative += float(np.maximum(squares - told[chosen], 0).sum())
    return relative / image.size


def _rays_for(few: int, pixels: int, spp: int) -> int:
    """Camera rays through each of a few of all pixels, a power of two."""
    factor = max(1, min(FACTOR, SHARE * pixels / max(few, 1)))
    rays = max(int(factor * spp), LEAST_RAYS // max(few, 1))
    return 1 << (rays.bit_length() - 1)


def before_lights(scene: Scene, project: Project) -> NDArray[np.bool_]:
    """Whether each pixel (height, width) may show a light, occlusion aside."""
    height, width = scene.camera.height, scene.camera.width
    mask = np.zeros((height, width), np.bool_)
    for shape in scene.shapes:
        if shape.is_light:
            x, y, _ = project(_hull(shape)).T
            if np.isnan(x).any():  # part of the light is behind the eye
                return np.ones_like(mask)
            mask[_pixels(y), _pixels(x)] = True
    return mask


def _hull(shape: Shape) -> Array:
    """Points (n, 3) whose convex hull contains a shape."""
    if isinstance(shape, Sphere):
        corners = np.stack(np.meshgrid(*3 * [(-1.0, 1.0)]), axis=-1).reshape(-1, 3)
        return np.asarray(shape.center + shape.radius * corners)
    return np.asarray(shape.vertices, np.float64)


def _pixels(places: Array) -> slice:
    """Pixels, from 0 on, that the interval of some coordinates (n,) touches."""
    first, last = np.floor(places.min()), np.floor(places.max())
    return slice(max(int(first), 0), max(int(last) + 1, 0))


def _runs(pixels: NDArray[np.int64]) -> Iterator[range]:
    """Split ascending pixels (n,) into ranges without gaps."""
    if len(pixels):
        for part in np.split(pixels, np.flatnonzero(np.diff(pixels) > 1) + 1):
            yield range(int(part[0]), int(part[-1]) + 1)
