"""Differences of convex polygons in a plane (host).

To subtract a convex polygon, the part outside its first edge is cut off; from the rest, the part
outside the second edge, and so on. Each of these pieces is convex, and the last rest is covered.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

from drpt.kernel.facets import unit_normal

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from numpy.typing import NDArray

    Array: TypeAlias = NDArray[np.float64]
    Edge: TypeAlias = tuple[tuple[float, ...], tuple[float, ...]]

ON_EDGE = 2.0**-42
"""Largest distance from an edge of a point on it, relative to the coordinates: 2¹⁰ roundings in
float64, as pieces are cut again."""
LONGEST_MITRE = 4.0
"""Largest displacement of a corner of a widened polygon, in units of the width."""


class HalfPlane(NamedTuple):
    """The points whose dot product with ``inward`` (3,) is at least ``level``."""

    inward: Array
    level: float


def subtract(polygon: Array, others: Iterable[Array], overlap: float) -> list[Array]:
    """Convex pieces (k, 3) of a convex polygon outside of convex ``others`` in the same plane.

    The pieces reach under the outer border of the others by the width ``overlap``, except along the
    polygon's own edges, so that no gap opens between a piece and the polygons that cover the rest.
    """
    normal, size = unit_normal(polygon), np.abs(polygon).max()
    turned = [other if unit_normal(other) @ normal > 0 else other[::-1] for other in others]
    own = set(_edges(polygon))
    inner = own.union((end, start) for other in turned for start, end in _edges(other))
    pieces = [polygon]
    for other in turned:
        planes = [
            _half_plane(edge, normal, 0.0 if edge in inner else overlap) for edge in _edges(other)
        ]
        pieces = [part for piece in pieces for part in _outside(piece, planes, ON_EDGE * size)]
    return pieces


def widen(polygon: Array, width: float) -> Array:
    """A convex polygon (k, 3) whose edges are moved outward by a width.

    Sharp corners move no farther than `LONGEST_MITRE` widths.
    """
    normal = unit_normal(polygon)
    ahead = np.roll(polygon, -1, axis=0) - polygon
    outward = np.cross(ahead, normal)
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    both = outward + np.roll(outward, 1, axis=0)
    scale = 2 / np.maximum((both**2).sum(axis=1), (2 / LONGEST_MITRE) ** 2)
    return np.asarray(polygon + width * scale[:, None] * both)


def fan(polygon: Array) -> Array:
    """Triangles (k - 2, 3, 3) of a convex polygon (k, 3)."""
    first = np.broadcast_to(polygon[0], (len(polygon) - 2, 3))
    return np.stack([first, polygon[1:-1], polygon[2:]], axis=1)


def _edges(polygon: Array) -> list[Edge]:
    corners = [tuple(corner) for corner in polygon.tolist()]
    return list(zip(corners, [*corners[1:], corners[0]], strict=True))


def _half_plane(edge: Edge, normal: Array, room: float) -> HalfPlane:
    """The half-plane on the left of an edge, at least at a distance ``room`` from it.

    A neighbour has the same edge in the other direction, and gets the same numbers with opposite
    signs.
    """
    low, high = sorted(edge)
    inward = np.cross(normal, np.subtract(high, low))
    inward /= np.linalg.norm(inward)
    level = float(inward @ low)
    return HalfPlane(inward, level + room) if edge[0] == low else HalfPlane(-inward, room - level)


def _outside(piece: Array, planes: list[HalfPlane], slack: float) -> Iterator[Array]:
    """Parts of a piece outside the common area of half-planes; all of it if it is disjoint."""
    rest, outer = piece, []
    for plane in planes:
        heights = rest @ plane.inward - plane.level
        heights[np.abs(heights) <= slack] = 0
        if (heights <= 0).all():
            yield piece
            return
        if (heights < 0).any():
            outer.append(_clip(rest, -heights))
            rest = _clip(rest, heights)
    yield from outer


def _clip(polygon: Array, heights: Array) -> Array:
    """The part of a convex polygon (k, 3) where heights (k,) of its corners are at least 0."""
    corners = []
    for k in range(len(polygon)):
        here, there = heights[k - 1], heights[k]
        if here * there < 0:
            share = here / (here - there)
            corners.append(polygon[k - 1] + share * (polygon[k] - polygon[k - 1]))
        if there >= 0:
            corners.append(polygon[k])
    return np.array(corners)
