"""Convex planar polygons of a mesh, and the constants that a kernel needs to intersect them (host).

Two coplanar triangles are one polygon, and a polygon is cheap to test where its edges are parallel
to an axis or to each other: both are facts of the scene that pay for every ray.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from numpy.typing import NDArray

    Array: TypeAlias = NDArray[np.float64]
    Corner: TypeAlias = tuple[float, ...]
    Outline: TypeAlias = tuple[Corner, ...]

COPLANAR = 1e-9
"""How far from a plane, relative to a polygon's extent, is on it: 1/60 of a float32 ulp."""
EDGE_WIDENING = 2.0**-22
"""Room for the rounding of a hit point, relative to its coordinates: closes the seams of meshes."""


class Slab(NamedTuple):
    """The points whose product with ``direction`` lies in [low, high]."""

    direction: tuple[float, float, float]
    low: float
    high: float


class Facet(NamedTuple):
    """A convex polygon: corners (k, 3), the plane normal·p = offset, and the slabs around it."""

    corners: Array
    normal: tuple[float, ...]
    offset: float
    slabs: tuple[Slab, ...]


def make_facet(corners: Array) -> Facet:
    """Facet of a convex planar polygon with an area; the corners turn counter-clockwise."""
    normal = unit_normal(corners)
    offset = float((corners @ normal).mean())
    return Facet(corners, tuple(normal.tolist()), offset, _slabs(corners, normal))


def area_vectors(triangles: Array) -> Array:
    """Normals (m, 3) of triangles (m, 3, 3), twice as long as their areas."""
    a, b, c = triangles.swapaxes(0, 1)
    return np.asarray(np.cross(b - a, c - a))


def has_area(vectors: Array) -> NDArray[np.bool_]:
    """Which of the triangles with these area vectors (m, 3) a ray can hit."""
    return np.asarray(np.einsum("ij,ij->i", vectors, vectors) > 0)


def bounds(facet: Facet, points: Array, radii: Array) -> bool:
    """Whether all balls around the ``points`` (n, 3) lie on one side of the facet's plane.

    Such a facet never stands between two points of them.
    """
    distance = points @ facet.normal - facet.offset
    slack = COPLANAR * np.abs(points).max()
    return bool((distance - radii >= -slack).all() or (distance + radii <= slack).all())


def merge_coplanar(polygons: Iterable[Array]) -> list[Array]:
    """Join the coplanar ones among convex polygons (k, 3) while what they form is convex."""
    outlines: dict[int, Outline] = {}
    owner: dict[tuple[Corner, Corner], int] = {}
    for index, polygon in enumerate(polygons):
        outline: Outline = tuple(map(tuple, polygon.tolist()))
        while (joined := _join_neighbour(outline, outlines, owner)) is not None:
            neighbour, outline = joined
            for edge in edges(outlines.pop(neighbour)):
                owner.pop(edge, None)
        outlines[index] = outline
        owner.update(dict.fromkeys(edges(outline), index))
    return [np.array(outline) for outline in outlines.values()]


def _join_neighbour(
    outline: Outline, outlines: dict[int, Outline], owner: dict[tuple[Corner, Corner], int]
) -> tuple[int, Outline] | None:
    for start, end in edges(outline):
        neighbour = owner.get((end, start))
        if neighbour is not None:
            union = _union(outlines[neighbour], outline, (start, end))
            if _is_planar_and_convex(np.array(union)):
                return neighbour, _without_straight_corners(union)
    return None


def _union(first: Outline, second: Outline, edge: tuple[Corner, Corner]) -> Outline:
    """Outline of two polygons on either side of ``edge``, which is an edge of ``second``."""
    start, end = edge
    i, j = first.index(start), second.index(end)
    return first[i:] + first[:i] + (second[j:] + second[:j])[1:-1]


def edges(outline: Outline) -> Iterator[tuple[Corner, Corner]]:
    """Start and end of each edge of an outline."""
    return pairwise((*outline, outline[0]))


def _turns(corners: Array) -> Array:
    """Cross product of the two edges at each corner, shape (k, 3)."""
    edges = np.roll(corners, -1, axis=0) - corners
    return np.cross(np.roll(edges, 1, axis=0), edges)


def _is_planar_and_convex(corners: Array) -> bool:
    normal = area_normal(corners)
    if not normal.any():  # two polygons back to back
        return False
    normal = normal / np.linalg.norm(normal)
    extent = np.ptp(corners, axis=0).max()
    heights = (corners - corners[0]) @ normal
    is_convex = (_turns(corners) @ normal >= -COPLANAR * extent**2).all()
    return bool(is_convex and (np.abs(heights) <= COPLANAR * extent).all())


def _without_straight_corners(outline: Outline) -> Outline:
    """Leave out what turns by nothing, one after the other: of a short edge one end is kept."""
    corners = np.array(outline)
    least = COPLANAR * np.ptp(corners, axis=0).max() ** 2
    kept = [*range(len(corners))]
    while len(kept) > 3:
        turning = np.linalg.norm(_turns(corners[kept]), axis=1) > least
        if turning.all():
            break
        del kept[turning.argmin()]
    return tuple(outline[k] for k in kept)


def unit_normal(corners: Array) -> Array:
    """Unit normal of a polygon that has an area; what is nearly parallel to an axis is."""
    normal = area_normal(corners)
    normal /= np.linalg.norm(normal)
    normal[np.abs(normal) < COPLANAR] = 0
    return np.asarray(normal / np.linalg.norm(normal))


def area_normal(corners: Array) -> Array:
    """Normal of a polygon, as long as its area (Newell's method about the first corner)."""
    spokes = corners[1:] - corners[0]
    return np.asarray(np.cross(spokes[:-1], spokes[1:]).sum(axis=0) / 2)


def _slabs(corners: Array, normal: Array) -> tuple[Slab, ...]:
    """Half-planes of the edges, projected along the normal's main axis; opposite ones joined."""
    limits: dict[tuple[float, ...], list[float]] = {}
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        inward, main = _inward(end - start, normal)
        level, room = inward @ start, EDGE_WIDENING * np.abs(inward) @ np.abs(corners).max(axis=0)
        low_high = limits.setdefault(tuple(inward.tolist()), [-np.inf, np.inf])
        side, value = (0, level - room) if main > 0 else (1, level + room)
        low_high[side] = float(value)
    return tuple(Slab((x, y, z), low, high) for (x, y, z), (low, high) in limits.items())


def _inward(edge: Array, normal: Array) -> tuple[Array, float]:
    """In-plane normal of an edge, as the device rounds it, with 1 as its main component, and that.

    The component along the normal's main axis is eliminated.
    """
    axis = int(np.abs(normal).argmax())
    u, v = (axis + 1) % 3, (axis + 2) % 3
    inward = np.zeros(3)
    inward[u], inward[v] = -edge[v] * normal[axis], edge[u] * normal[axis]
    main = float(inward[np.abs(inward).argmax()])
    return (inward / main).astype(np.float32).astype(np.float64) + 0.0, main
