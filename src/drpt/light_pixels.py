"""Pixels that the projection of a light touches.

A light is bounded by convex polygons: by its triangles, or by a polygon about the circle in which
the cone from the eye touches a sphere. Each of them is clipped to the pyramid of the picture in
homogeneous coordinates (Sutherland and Hodgman 1974, "Reentrant Polygon Clipping"), so that what
is behind the eye is cut off before anything is divided by its depth. Each row of pixels cuts a
span out of what is left, and all pixels that the span touches are marked. Occlusion is not asked
for: a marked pixel may show no light, but a pixel that shows one is marked.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from drpt.scene import Mesh, Sphere
from drpt.scene.picture_plane import picture_plane

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from drpt.scene import Camera, Scene
    from drpt.scene.model import Shape
    from drpt.scene.picture_plane import PicturePlane

    Array = NDArray[np.float64]
    Counts = NDArray[np.int32]
    Indices = NDArray[np.int64]
    Mask = NDArray[np.bool_]

SIDES = 64
"""Sides of the polygon about the outline of a sphere; corners are 0.12 % of a radius outside."""
MARGIN = 2.0**-10
"""Pixels by which a ray may miss its place: places in pixels are rounded to float32."""
AT_ONCE = 2**10
"""Number of polygons that are clipped at once, to bound the memory."""


def light_pixels(scene: Scene) -> Mask:
    """Whether each pixel (height, width) may show a light, occlusion aside."""
    width, height = scene.camera.width, scene.camera.height
    if any(_surrounds(shape, scene.camera) for shape in scene.shapes if shape.is_light):
        return np.ones((height, width), np.bool_)
    starts = np.zeros((height, width + 1), np.int32)
    for polygons in _polygons(scene):
        seen = _within_picture(polygons, width, height)
        if not (seen[..., 2] > 0).all():  # the eye lies in the light
            return np.ones((height, width), np.bool_)
        _add_spans(starts, seen[..., :2] / seen[..., 2:])
    mask: Mask = np.cumsum(starts, axis=1)[:, :width] > 0
    return mask


def _surrounds(light: Shape, camera: Camera) -> bool:
    """Whether the eye is in a sphere."""
    if not isinstance(light, Sphere):
        return False
    return float(np.square(np.subtract(light.center, camera.eye)).sum()) <= light.radius**2


def _polygons(scene: Scene) -> Iterator[Array]:
    """Convex polygons (n, corners, 3) that bound the lights, in homogeneous coordinates."""
    plane, eye = picture_plane(scene.camera), np.array(scene.camera.eye)
    lights = [shape for shape in scene.shapes if shape.is_light]
    spheres = [(*light.center, light.radius) for light in lights if isinstance(light, Sphere)]
    if spheres:
        *centers, radii = np.array(spheres).T
        yield from _seen(plane, _outlines(np.stack(centers, axis=1) - eye, radii))
    for light in lights:
        if isinstance(light, Mesh):
            yield from _seen(plane, light.vertices[light.faces] - eye)


def _seen(plane: PicturePlane, polygons: Array) -> Iterator[Array]:
    for start in range(0, len(polygons), AT_ONCE):
        part = polygons[start : start + AT_ONCE]
        yield plane.homogeneous(part.reshape(-1, 3)).reshape(part.shape)


def _outlines(centers: Array, radii: Array) -> Array:
    """Regular polygons (n, `SIDES`, 3) about the outlines of spheres seen from the origin.

    They are scaled to the radius of the sphere; from the origin they look the same.
    """
    squares = np.square(centers).sum(axis=1)
    tangents = np.sqrt(squares - radii**2)  # lengths, from the eye to the outline
    axes = centers / np.sqrt(squares)[:, None]
    aside = np.eye(3)[np.abs(axes).argmin(axis=1)]
    u = np.cross(axes, aside)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v = np.cross(axes, u)
    angles = 2 * np.pi / SIDES * np.arange(SIDES)[:, None]
    around = np.cos(angles) * u[:, None] + np.sin(angles) * v[:, None]
    outer = radii / np.cos(np.pi / SIDES)
    return np.asarray(tangents[:, None, None] * axes[:, None] + outer[:, None, None] * around)


def _within_picture(polygons: Array, width: int, height: int) -> Array:
    """Clip polygons to the pyramid of the picture, with `MARGIN` around; drops those outside."""
    low, far_x, far_y = -MARGIN, width + MARGIN, height + MARGIN
    for plane in ((1, 0, -low), (0, 1, -low), (-1, 0, far_x), (0, -1, far_y)):
        polygons = _clipped(polygons, np.array(plane, np.float64))
    return polygons


def _clipped(polygons: Array, plane: Array) -> Array:
    """Parts of polygons (n, corners, 3) on the positive side of a plane, (m, corners + 1, 3).

    Free places hold copies of a corner.
    """
    sides = polygons @ plane
    after, sides_after = np.roll(polygons, -1, axis=1), np.roll(sides, -1, axis=1)
    kept, crosses = sides >= 0, (sides >= 0) != (sides_after >= 0)
    share = np.divide(sides, sides - sides_after, where=crosses, out=np.zeros_like(sides))
    crossings = polygons + share[..., None] * (after - polygons)
    count, corners, _ = polygons.shape
    points = np.stack([polygons, crossings], axis=2).reshape(count, 2 * corners, 3)
    valid = np.stack([kept, crosses], axis=2).reshape(count, 2 * corners)
    order = np.argsort(~valid, axis=1, kind="stable")[:, : corners + 1]
    used = np.arange(corners + 1) < valid.sum(axis=1, keepdims=True)
    order = np.where(used, order, order[:, :1])
    return np.take_along_axis(points, order[..., None], axis=1)[valid.any(axis=1)]


def _add_spans(starts: Counts, polygons: Array) -> None:
    """Add 1 where the spans of polygons (n, corners, 2) start in each row, and -1 behind them."""
    height, width = starts.shape[0], starts.shape[1] - 1
    y = polygons[..., 1]
    first, last = _touched(y.min(axis=1), y.max(axis=1), height)
    counts = last - first + 1
    which = np.repeat(np.arange(len(y)), counts)
    rows = np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts - first, counts)
    first, last = _touched(*_span(polygons[which], rows[:, None]), width)
    np.add.at(starts, (rows, first), 1)
    np.add.at(starts, (rows, last + 1), -1)


def _touched(low: Array, high: Array, count: int) -> tuple[Indices, Indices]:
    """First and last of ``count`` pixels that intervals touch, with `MARGIN` around."""
    first, last = (np.floor(end).astype(np.int64) for end in (low - MARGIN, high + MARGIN))
    return np.clip(first, 0, count - 1), np.clip(last, 0, count - 1)


def _span(polygons: Array, rows: Indices) -> tuple[Array, Array]:
    """Least and greatest x of polygons (n, corners, 2) within a row (n, 1) of pixels each."""
    x, y = np.moveaxis(polygons, 2, 0)
    run, rise = (np.roll(ends, -1, axis=1) - ends for ends in (x, y))
    top, bottom = rows - MARGIN, rows + 1 + MARGIN
    ends = []
    for along in (np.clip(y, top, bottom) - y, np.clip(y + rise, top, bottom) - y):
        share = np.divide(along, rise, where=rise != 0, out=np.zeros_like(y))
        ends.append(x + share * run)
    meets = (np.minimum(y, y + rise) <= bottom) & (np.maximum(y, y + rise) >= top)
    left = np.where(meets, np.minimum(*ends), np.inf).min(axis=1)
    right = np.where(meets, np.maximum(*ends), -np.inf).max(axis=1)
    return left, right
