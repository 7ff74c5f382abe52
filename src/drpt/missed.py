"""Light that the camera sees directly, but that the samples of a picture have missed.

The edge of a light may cover a thousandth of a pixel. Before the first sample meets it, neither the
picture nor its error tell of it. But camera rays alone are cheap, and where lights can be seen is
known: so pixels before a light get many more of them than the picture has.
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
    Project = Callable[[Array], Array]

FACTOR = 64
"""Camera rays through a pixel for each sample of the picture, at the most."""
SHARE = 0.25
"""Camera rays of all pixels for each sample of the picture, at the most."""


def missed(scene: Scene, image: Array, spp: int, project: Project, seen: Seen) -> float:
    """What missed light adds to the relMSE of an image (height, width, 3).

    Parameters
    ----------
    scene, image, spp
        What was rendered, the picture, and its samples per pixel.
    project
        Where points (n, 3) are in the picture: x, y and depth, (n, 3); not a number behind the eye.
    seen
        Emission (pixels, 3) that some pixels see directly, by so many camera rays through each.
    """
    pixels = image.reshape(-1, 3)
    before = np.flatnonzero(before_lights(scene, project))
    rays = int(max(1, min(FACTOR, SHARE * len(pixels) / max(len(before), 1))) * spp)
    relative = 0.0
    for part in _runs(before):
        emission = seen(part, 1 << (rays.bit_length() - 1))
        lacking = np.maximum(emission - pixels[part.start : part.stop], 0)
        relative += float((lacking**2 / (emission**2 + DARK)).sum())
    return relative / image.size


def before_lights(scene: Scene, project: Project) -> NDArray[np.bool_]:
    """Pixels (height, width) that may see a light, if nothing is before it."""
    height, width = scene.camera.height, scene.camera.width
    mask = np.zeros((height, width), np.bool_)
    for shape in scene.shapes:
        if shape.is_light:
            x, y, _ = project(_hull(shape)).T
            if np.isnan(x).any():  # a part of it is behind the eye
                return np.ones_like(mask)
            mask[_pixels(y), _pixels(x)] = True
    return mask


def _hull(shape: Shape) -> Array:
    """Points (n, 3) whose convex hull holds a shape."""
    if isinstance(shape, Sphere):
        corners = np.stack(np.meshgrid(*3 * [(-1.0, 1.0)]), axis=-1).reshape(-1, 3)
        return np.asarray(shape.center + shape.radius * corners)
    return np.asarray(shape.vertices, np.float64)


def _pixels(places: Array) -> slice:
    """Pixels that an interval touches, of those from 0 on."""
    first, last = np.floor(places.min()), np.floor(places.max())
    return slice(max(int(first), 0), max(int(last) + 1, 0))


def _runs(pixels: NDArray[np.int64]) -> Iterator[range]:
    """Ranges of pixels that follow each other."""
    if len(pixels):
        for part in np.split(pixels, np.flatnonzero(np.diff(pixels) > 1) + 1):
            yield range(int(part[0]), int(part[-1]) + 1)
