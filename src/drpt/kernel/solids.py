"""Convex bodies among the facets of a scene, as intersections of half-spaces (host).

A ray is inside a body between the last plane by which it enters and the first by which it leaves.
That takes no test against outlines, so there are no seams between the facets for a ray to slip
through, and none that stick out; planes that are parallel share their division.

A body may be open, as a room without its front or a box without its bottom: a plane closes it that
rays pass through.
"""

from __future__ import annotations

from collections import defaultdict
from itertools import combinations
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

from drpt.kernel.facets import COPLANAR, area_normal, edges, unit_normal

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from numpy.typing import NDArray

    Array: TypeAlias = NDArray[np.float64]
    Corner: TypeAlias = tuple[float, ...]
    Edge: TypeAlias = frozenset[Corner]

FOLD = 2.0**-10
"""Planes of a body that are less inclined than this, in radians, would blur into each other."""
THINNEST = 2.0**-14
"""Bodies thinner than this, relative to their coordinates, could be lost in rounding."""


class Side(NamedTuple):
    """A plane normal·p = offset, its unit normal outward.

    ``facet`` is the number of the polygon there; None where the body is open.
    """

    normal: Array
    offset: float
    facet: int | None


class Face(NamedTuple):
    """Where a `Span` ends, and the number of the facet there; None if it is open."""

    offset: float
    facet: int | None


class Span(NamedTuple):
    """The points low ≤ direction·p ≤ high, or but one of both; the main component is 1."""

    direction: tuple[float, ...]
    low: Face | None
    high: Face | None


class Solid(NamedTuple):
    """A convex body: what all of its spans have in common.

    ``shading`` are the spans that matter between two points of the scene; ``encloses`` tells
    whether all of the scene is inside.
    """

    spans: tuple[Span, ...]
    shading: tuple[Span, ...]
    encloses: bool

    @property
    def facets(self) -> list[int]:
        """Numbers of the facets that it consists of."""
        faces = (face for span in self.spans for face in (span.low, span.high))
        return [face.facet for face in faces if face and face.facet is not None]


def make_solids(outlines: Sequence[Array], points: Array, radii: Array) -> tuple[Solid, ...]:
    """Bodies that polygons (k, 3) form; balls around the ``points`` (n, 3) are all of the scene."""
    slack = COPLANAR * np.abs(points).max(initial=0)

    def holds(side: Side) -> bool:
        return bool((points @ side.normal + radii <= side.offset + slack).all())

    return tuple(
        Solid(
            spans=_spans(sides),
            shading=_spans([side for side in sides if not holds(side)]),
            encloses=all(map(holds, sides)),
        )
        for sides in find_bodies(outlines)
    )


def find_bodies(outlines: Sequence[Array]) -> Iterator[list[Side]]:
    """The sides of each body among convex polygons (k, 3) that share edges."""
    owners = edge_owners(outlines)
    for members in _connected(len(outlines), owners.values()):
        shared = {edge: at for edge, at in owners.items() if at[0] in members}
        if max(map(len, shared.values())) > 2:
            continue
        rims = _loops([edge for edge, at in shared.items() if len(at) == 1])
        if rims is None:
            continue
        faces: list[tuple[Array, int | None]] = [(outlines[i], i) for i in sorted(members)]
        sides = _sides([*faces, *((rim, None) for rim in rims)])
        if sides is not None:
            yield sides


def edge_owners(outlines: Sequence[Array]) -> dict[Edge, list[int]]:
    """Numbers of the polygons (k, 3) that have each edge."""
    owners: dict[Edge, list[int]] = defaultdict(list)
    for number, outline in enumerate(outlines):
        for edge in edges(tuple(map(tuple, outline.tolist()))):
            owners[frozenset(edge)].append(number)
    return owners


def _connected(count: int, groups: Iterable[list[int]]) -> list[set[int]]:
    """Sets of numbers below ``count`` that groups join."""
    owner = [{i} for i in range(count)]
    for group in groups:
        joined = set().union(*(owner[i] for i in group))
        for i in joined:
            owner[i] = joined
    return list({id(members): members for members in owner}.values())


def _loops(rim: list[Edge]) -> list[Array] | None:
    """Closed outlines (k, 3) that edges form; None where they branch or end."""
    ways: dict[Corner, list[Corner]] = defaultdict(list)
    for edge in rim:
        start, end = edge
        ways[start].append(end)
        ways[end].append(start)
    if any(len(others) != 2 for others in ways.values()):
        return None
    loops = []
    while ways:
        corner: Corner | None = next(iter(ways))
        loop = []
        while corner is not None:
            loop.append(corner)
            corner = next((c for c in ways.pop(corner) if c in ways), None)
        loops.append(np.array(loop))
    return loops


def _sides(polygons: list[tuple[Array, int | None]]) -> list[Side] | None:
    """Sides of the body that polygons bound; None where it is not convex, or thin, or flat."""
    corners = np.concatenate([outline for outline, _ in polygons])
    extent, reach = np.ptp(corners, axis=0).max(), np.abs(corners).max()
    sides = []
    for outline, facet in polygons:
        if not area_normal(outline).any():
            return None
        normal, point = unit_normal(outline), outline.mean(axis=0)
        heights = (corners - point) @ normal
        if heights.max() > -heights.min():
            normal, heights = -normal, -heights
        is_flat = np.abs((outline - point) @ normal).max() <= COPLANAR * extent
        is_convex = heights.max() <= COPLANAR * extent
        if not is_flat or not is_convex or -heights.min() < THINNEST * reach:
            return None
        sides.append(Side(normal, float(normal @ point), facet))
    return sides if all(_differ(a, b) for a, b in combinations(sides, 2)) else None


def _differ(a: Side, b: Side) -> bool:
    """Whether two sides are inclined against each other, or just opposite."""
    opposite = (_direction(a) == _direction(b)).all() and a.normal @ b.normal < 0
    return bool(opposite or np.linalg.norm(np.cross(a.normal, b.normal)) >= FOLD)


def _direction(side: Side) -> Array:
    """The normal as the device rounds it, with 1 as its main component, of equal ones the first."""
    size = np.abs(side.normal)
    main = side.normal[np.argmax(size >= (1 - COPLANAR) * size.max())]
    return (side.normal / main).astype(np.float32).astype(np.float64) + 0.0


def _spans(sides: list[Side]) -> tuple[Span, ...]:
    """Spans of half-spaces; those of opposite normals are one.

    Of a plane, the point next to the origin keeps its place as the direction is rounded, so that
    the error of any other point is relative to its distance from the origin.
    """
    limits: dict[tuple[float, ...], list[Face | None]] = {}
    for side in sides:
        direction = _direction(side)
        face = Face(float(direction @ side.normal) * side.offset, side.facet)
        is_high = bool(direction @ side.normal > 0)
        limits.setdefault(tuple(direction.tolist()), [None, None])[is_high] = face
    return tuple(Span(direction, *ends) for direction, ends in limits.items())
