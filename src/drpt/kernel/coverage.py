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

from drpt.kernel.facets import COPLANAR
from drpt.kernel.intersect import UNKNOWN
from drpt.scene.picture_plane import picture_plane

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
ROUNDING = 2.0**-46
"""Of heights above planes in float64, relative to the coordinates."""
CLOSE = 2.0**-16
"""By which something must reach beyond a plane that is to be between it and another thing.

Relative to the coordinates, and more than what counts as coincident on the device. So close to a
plane, an eye may be on either side of it there.
"""
NO_PLANE = np.full(4, np.nan)
TANGENTS = 8
"""Edges of the outline around a sphere."""


class Item(NamedTuple):
    """A facet or a sphere, as seen from the eye.

    Points are inside of its outline where the product with each of the normals ``inward`` (k, 3) is
    positive. All of it is between its corners (m, 3), which are balls of ``radius``. ``plane`` is
    that of a facet, (normal, offset) with a positive offset, else not a number. ``size`` is that of
    the coordinates in use, of its points as seen from the eye and of the eye itself, to which
    errors are relative. ``number`` is that of a facet that may fill pixels.
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
        _paint(numbers, UNKNOWN, _spans(edges, numbers.shape, filled=False))
        if item.number != UNKNOWN:
            _paint(numbers, item.number, _spans(edges, numbers.shape, filled=True))
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
    error = CLOSE * (abs(facet.offset) + np.dot(np.abs(facet.normal), np.abs(eye)))
    if abs(distance) <= max(error, COPLANAR * size):
        middle = facet.corners.mean(axis=0)
        return _ball_item(middle, np.linalg.norm(facet.corners - middle, axis=1).max(), eye)
    side = np.sign(distance)
    inward = side * np.cross(corners, np.roll(facet.corners, -1, axis=0) - facet.corners)
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
    """Items in an order in which what may be before one that fills pixels comes later.

    What fills none comes as early as it may, for it makes pixels unknown that it hardly hides. In
    a ring of facets that may all hide each other none fills pixels.
    """
    hides, left = _may_hide(items), np.ones(len(items), bool)
    fills = np.array([item.number != UNKNOWN for item in items])
    while left.any():
        hides_nothing, hides_no_facet = (
            left & ~hides[:, those].any(axis=1) for those in (left, left & fills)
        )
        choices = hides_nothing, hides_no_facet & ~fills, hides_no_facet
        hindmost = next((choice for choice in choices if choice.any()), None)
        if hindmost is None:
            yield from (items[i]._replace(number=UNKNOWN) for i in np.flatnonzero(left))
            return
        yield from (items[i] for i in np.flatnonzero(hindmost))
        left &= ~hindmost


def _may_hide(items: list[Item]) -> NDArray[np.bool_]:
    """Whether item i may be before item j, at [i, j].

    It is not if the plane of some facet is between them, with the eye on the side of j; nor if a
    plane through the eye and an edge of one of them is.
    """
    points = np.concatenate([item.corners for item in items])
    radii = np.concatenate([np.full(len(item.corners), item.radius) for item in items])
    first = np.cumsum([0, *(len(item.corners) for item in items[:-1])])
    sizes = np.array([item.size for item in items])
    rounding, close = ROUNDING * sizes, CLOSE * sizes

    def reach(planes: Array) -> tuple[Array, Array]:
        """Least and greatest height of each item above planes (n, 4), (n, items)."""
        heights = planes[:, :3] @ points.T - planes[:, 3:]
        low = np.minimum.reduceat(heights - radii, first, axis=1)
        return low, np.maximum.reduceat(heights + radii, first, axis=1)

    low, high = reach(np.array([item.plane for item in items]))
    before, beyond = high <= rounding, low >= -rounding
    well_before, well_beyond = before & (low < -close), beyond & (high > close)
    # A product of truths tells whether there is a plane for which both hold.
    behind = well_beyond.T @ before | beyond.T @ well_before
    edges = np.concatenate([item.inward for item in items])
    edges = edges / np.linalg.norm(edges, axis=1, keepdims=True)
    _, above_edge = reach(np.pad(edges, ((0, 0), (0, 1))))
    owner = np.repeat(np.arange(len(items)), [len(item.inward) for item in items])
    apart = np.eye(len(items), dtype=bool)
    np.logical_or.at(apart, owner, above_edge <= rounding)
    return np.asarray(~(behind | apart | apart.T))


def _spans(edges: Array, shape: tuple[int, int], *, filled: bool) -> Spans:
    """Start and stop of the pixels that an outline touches in each row, or that it fills.

    Each column (a, b, c) of ``edges`` is of a line, positive inside.
    """
    height, width = shape
    a, b, c = edges[..., None]
    room = (np.abs(b) + np.abs(c)) * (0.5 + MARGIN)
    inside = a + c * np.arange(height) + (-room if filled else room)
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = np.clip(-inside / b, -1, width)
    outside = (b == 0) & ((inside <= 0) if filled else (inside < 0))
    starts = np.where(b > 0, np.ceil(crossing), np.where(outside, width, 0))
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
