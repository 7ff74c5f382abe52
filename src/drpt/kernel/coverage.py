"""Coverage: pixels that a single facet fills, whose camera rays need not look for it (host).

In a picture the edges of a facet are lines a + b x + c y = 0, so that in each row of pixels it
touches a span of them, and fills a shorter one (conservative rasterisation: Akenine-Möller & Aila
2005, "Conservative and Tiled Rasterization Using a Modified Triangle Setup"). What may stand before
another is painted after it (Newell, Newell & Sancha 1972, "A Solution to the Hidden Surface
Problem"): first all pixels that it touches as unknown, then those that it fills with its number.
Nothing has to be exact but what is said to be known.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

from drpt.kernel.camera import picture_plane
from drpt.kernel.facets import COPLANAR
from drpt.kernel.intersect import UNKNOWN

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from drpt.kernel.facets import Facet
    from drpt.kernel.primitives import Primitives
    from drpt.scene import Camera

    Array: TypeAlias = NDArray[np.float64]
    Spans: TypeAlias = tuple[NDArray[np.intp], NDArray[np.intp]]

MARGIN = 1 / 16
"""Pixels by which an edge has to be off a pixel, for rounding on the device."""
CLOSE = 2.0**-16
"""Surfaces that are closer than this, relative to their coordinates, may hide each other."""
NO_PLANE = np.full(4, np.nan)
TANGENTS = 8
"""Edges of the outline around a sphere."""


class Item(NamedTuple):
    """A facet or a sphere, as seen from the eye.

    Points are inside of its outline where the product with each of the normals ``inward`` (k, 3) is
    positive. All of it is between its corners (m, 3), which are balls of ``radius``. ``plane`` is
    that of a facet, (normal, offset) with a positive offset, else not a number. ``size`` is that of
    the coordinates there. ``number`` is that of a facet that may fill pixels.
    """

    inward: Array
    corners: Array
    radius: float
    plane: Array
    size: float
    number: int = UNKNOWN


def covering_facets(camera: Camera, primitives: Primitives) -> NDArray[np.uint32]:
    """Numbers of the facets that fill each pixel with nothing before them (height, width).

    `UNKNOWN` where there is none, or where that is not certain.
    """
    corner, right, down = picture_plane(camera)
    rays = np.stack([corner + (right + down) / 2, right, down])
    numbers = np.full((camera.height, camera.width), UNKNOWN, np.uint32)
    for item in _from_back_to_front(list(_items(camera.eye - primitives.origin, primitives))):
        edges = rays @ item.inward.T
        _paint(numbers, UNKNOWN, _spans(edges, 1, numbers.shape))
        if item.number != UNKNOWN:
            _paint(numbers, item.number, _spans(edges, -1, numbers.shape))
    return numbers


def _items(eye: Array, primitives: Primitives) -> Iterator[Item]:
    for number, facet in enumerate(primitives.facets):
        yield _facet_item(facet, eye, number)
    for facet in primitives.light_facets:
        yield _facet_item(facet, eye, UNKNOWN)
    for *center, radius in primitives.spheres:
        yield _ball_item(np.array(center), radius, eye)


def _facet_item(facet: Facet, eye: Array, number: int) -> Item:
    """A polygon; one that is seen edge-on counts as the ball around it."""
    corners, distance = facet.corners - eye, facet.offset - np.dot(facet.normal, eye)
    size = np.abs(corners).max() + np.abs(eye).max()
    if abs(distance) <= COPLANAR * size:
        middle = facet.corners.mean(axis=0)
        return _ball_item(middle, np.linalg.norm(facet.corners - middle, axis=1).max(), eye)
    side = np.sign(distance)
    inward = side * np.cross(corners, np.roll(corners, -1, axis=0))
    return Item(inward, corners, 0, side * np.array([*facet.normal, distance]), size, number)


def _ball_item(center: Array, radius: float, eye: Array) -> Item:
    """A ball between planes through the eye that touch it; around the eye, it is everywhere."""
    to_center = center - eye
    distance = np.linalg.norm(to_center)
    size = float(distance) + radius + np.abs(eye).max()
    radius += COPLANAR * size
    if distance <= radius:
        return Item(np.empty((0, 3)), to_center[None], radius, NO_PLANE, size)
    axis, sine = to_center / distance, radius / distance
    side = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    side /= np.linalg.norm(side)
    angles = 2 * np.pi / TANGENTS * np.arange(TANGENTS)[:, None]
    around = np.cos(angles) * side + np.sin(angles) * np.cross(axis, side)
    inward = sine * axis - np.sqrt(1 - sine**2) * around
    return Item(inward, to_center[None], radius, NO_PLANE, size)


def _from_back_to_front(items: list[Item]) -> Iterator[Item]:
    """Items such that none hides one that comes earlier and fills pixels.

    Nor one that fills none, as far as there is such an order. Where there is none at all, the
    others come last, and fill no pixels.
    """
    hides, left = _may_hide(items), np.ones(len(items), bool)
    fills = np.array([item.number != UNKNOWN for item in items])
    while left.any():
        hides_none, hides_no_facet = (
            ~hides[:, those].any(axis=1) for those in (left, left & fills)
        )
        choices = (left & hides_none, left & hides_no_facet & ~fills, left & hides_no_facet)
        hindmost = next((choice for choice in choices if choice.any()), None)
        if hindmost is None:
            yield from (items[i]._replace(number=UNKNOWN) for i in np.flatnonzero(left))
            return
        yield from (items[i] for i in np.flatnonzero(hindmost))
        left &= ~hindmost


def _may_hide(items: list[Item]) -> NDArray[np.bool_]:
    """Whether each item may be before each other one, shape (items, items).

    It is not if the plane of some facet is between both, with the eye on the side of the other one;
    nor if a plane through the eye and an edge is.
    """
    points = np.concatenate([item.corners for item in items])
    radii = np.concatenate([np.full(len(item.corners), item.radius) for item in items])
    first = np.cumsum([0, *(len(item.corners) for item in items[:-1])])
    sizes = np.array([item.size for item in items])
    touching, close = COPLANAR * sizes, CLOSE * sizes

    def reach(planes: Array) -> tuple[Array, Array]:
        """Least and greatest height of each item above planes (n, 4), (n, items)."""
        heights = planes[:, :3] @ points.T - planes[:, 3:]
        low = np.minimum.reduceat(heights - radii, first, axis=1)
        return low, np.maximum.reduceat(heights + radii, first, axis=1)

    low, high = reach(np.array([item.plane for item in items]))
    beyond, before = low >= -touching, high <= touching
    well_beyond, well_before = beyond & (high > close), before & (low < -close)
    behind = well_beyond.T @ before | beyond.T @ well_before
    edges = np.concatenate([item.inward for item in items])
    edges /= np.linalg.norm(edges, axis=1, keepdims=True)
    _, high = reach(np.pad(edges, ((0, 0), (0, 1))))
    owner = np.repeat(np.arange(len(items)), [len(item.inward) for item in items])
    apart = np.eye(len(items), dtype=bool)
    np.logical_or.at(apart, owner, high <= touching)
    return np.asarray(~(behind | apart | apart.T))


def _spans(edges: Array, sign: int, shape: tuple[int, int]) -> Spans:
    """Start and stop of the pixels that an outline touches in each row, or with -1 fills.

    Each column (a, b, c) of ``edges`` is of a line, positive inside.
    """
    height, width = shape
    a, b, c = edges[..., None]
    room = (np.abs(b) + np.abs(c)) * (0.5 + MARGIN)
    offset = a + c * np.arange(height) + sign * room
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = np.clip(-offset / b, -1, width)
    misses = np.where((b == 0) & (offset < 0), width, 0)
    starts = np.where(b > 0, np.ceil(crossing), misses)
    stops = np.where(b < 0, np.floor(crossing) + 1, width)
    return (
        starts.max(axis=0, initial=0).astype(np.intp),
        stops.min(axis=0, initial=width).astype(np.intp),
    )


def _paint(numbers: NDArray[np.uint32], number: int, spans: Spans) -> None:
    """Give a number to the pixels of a span in each row."""
    starts, stops = spans
    rows = np.flatnonzero(starts < stops)
    if not len(rows):
        return
    low, high = rows[0], rows[-1] + 1
    left, right = starts[rows].min(), stops[rows].max()
    columns = np.arange(left, right)
    inside = (columns >= starts[low:high, None]) & (columns < stops[low:high, None])
    numbers[low:high, left:right][inside] = number
