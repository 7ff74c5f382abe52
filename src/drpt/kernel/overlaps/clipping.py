"""Differences of convex polygons in a plane (host).

To subtract a convex polygon, the part outside its first edge is cut off; from the rest, the part
outside the second edge, and so on. Each of these pieces is convex, and the last rest is covered.
All polygons are cut at once: in round k, the pieces of each are cut by its cover number k.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

from drpt.kernel.overlaps.batches import Polygons, joined

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array: TypeAlias = NDArray[np.float64]
    Indices: TypeAlias = NDArray[np.intp]

ON_EDGE = 2.0**-42
"""Largest distance from an edge of a point on it, relative to the coordinates: 2¹⁰ roundings in
float64, as pieces are cut again."""
LONGEST_MITRE = 4.0
"""Largest displacement of a corner of a widened polygon, in units of the width."""


class Pieces(NamedTuple):
    """Convex pieces of polygons, and the number (n,) of the polygon of each, ascending."""

    polygons: Polygons
    owners: Indices


class _HalfPlanes(NamedTuple):
    """For each edge (n, k): the points whose dot product with ``inward`` is at least ``level``."""

    inward: Array
    level: Array


def uncovered(
    polygons: Polygons, covers: Polygons, of: Indices, overlap: float
) -> tuple[Array, Indices]:
    """Triangles (m, 3, 3) of the parts of convex polygons that no cover hides, and their owners.

    Parameters
    ----------
    polygons
        Convex polygons.
    covers, of
        Convex polygons that cover others in the same plane, and the number (m,) of the polygon that
        each covers, ascending.
    overlap
        Width, relative to the coordinates, by which pieces reach under the outer border of their
        covers and beyond their own edges, so that no gap opens.
    """
    widths, normals = overlap * np.abs(polygons.corners).max(axis=(1, 2)), polygons.normals()
    pieces = subtract(polygons, covers, of, widths)
    owners = pieces.owners
    wider = pieces.polygons.widened(normals[owners], widths[owners], LONGEST_MITRE)
    triangles, piece = wider.fans()
    return triangles, owners[piece]


def subtract(polygons: Polygons, covers: Polygons, of: Indices, widths: Array) -> Pieces:
    """Convex pieces of convex polygons outside of their covers, see `uncovered`.

    The pieces reach under the outer border of the covers by ``widths`` (n,), except along the
    polygon's own edges.
    """
    slack = ON_EDGE * np.abs(polygons.corners).max(axis=(1, 2))
    planes = _half_planes(polygons, covers, of, widths)
    numbers = np.arange(polygons.count)
    first, last = np.searchsorted(of, numbers, "left"), np.searchsorted(of, numbers, "right")
    done: list[Pieces] = []
    pieces = Pieces(polygons, numbers)
    turn = 0
    while pieces.polygons.count:
        cover = first[pieces.owners] + turn
        more = cover < last[pieces.owners]
        done.append(Pieces(pieces.polygons[~more], pieces.owners[~more]))
        here = Pieces(pieces.polygons[more], pieces.owners[more])
        chosen = _HalfPlanes(planes.inward[cover[more]], planes.level[cover[more]])
        pieces = _outside(here, chosen, slack[here.owners])
        turn += 1
    return _sorted(done)


def _outside(pieces: Pieces, planes: _HalfPlanes, slack: Array) -> Pieces:
    """Parts of pieces outside the common area of half-planes; all of one that is disjoint."""
    found: list[Pieces] = []
    rests, owners = pieces.polygons, pieces.owners
    index = np.arange(len(owners))  # of the piece that each rest is of
    outer: list[tuple[Polygons, Indices]] = []
    disjoint = np.zeros(len(owners), bool)
    for k in range(planes.level.shape[1]):
        inward, level = planes.inward[index, k], planes.level[index, k]
        heights = np.einsum("nkx,nx->nk", rests.corners, inward) - level[:, None]
        heights[np.abs(heights) <= slack[index, None]] = 0
        above = ((heights > 0) & rests.there).any(axis=1)
        disjoint[index[~above]] = True
        below = ((heights < 0) & rests.there).any(axis=1)
        cut = above & below
        if not cut.any():
            rests, index = rests[above], index[above]
            continue
        outer.append((rests[cut].clipped(-heights[cut]), index[cut]))
        inner = rests[cut].clipped(heights[cut])
        rests = joined([rests[above & ~below], inner])
        index = np.concatenate([index[above & ~below], index[cut]])
    found.append(Pieces(pieces.polygons[disjoint], owners[disjoint]))
    for polygons, source in outer:
        kept = ~disjoint[source]
        found.append(Pieces(polygons[kept], owners[source[kept]]))
    return _sorted(found)


def _sorted(batches: list[Pieces]) -> Pieces:
    owners = np.concatenate([np.zeros(0, np.intp), *(batch.owners for batch in batches)])
    order = np.argsort(owners, kind="stable")
    return Pieces(joined([batch.polygons for batch in batches])[order], owners[order])


def _half_planes(polygons: Polygons, covers: Polygons, of: Indices, widths: Array) -> _HalfPlanes:
    """Half-planes on the inner sides of the edges of covers, at a distance from their borders.

    The distance is 0 along edges that another cover of the polygon shares, and along edges of the
    polygon itself. A neighbour has the same edge in the other direction, and gets the same numbers
    with opposite signs.
    """
    normals = polygons.normals()
    turned = _turned(covers, normals[of])
    own, edges = _numbered_edges(polygons, turned)
    inner = _shared(own, edges, of, polygons, turned)
    low, there, corners = edges.start <= edges.end, turned.there, turned.corners
    after = np.take_along_axis(corners, turned.following[..., None], axis=1)
    lower = np.where(low[..., None], corners, after)
    upper = np.where(low[..., None], after, corners)
    inward = np.cross(normals[of][:, None], upper - lower)
    lengths = np.linalg.norm(inward, axis=2, keepdims=True)
    inward = np.divide(inward, lengths, out=np.zeros_like(inward), where=lengths > 0)
    level = np.einsum("nkx,nkx->nk", inward, lower)
    sign = np.where(low, 1.0, -1.0)
    room = np.where(inner, 0.0, widths[of][:, None])
    inward, level = sign[..., None] * inward, sign * level + room
    # Where there is no edge, everything is inside.
    return _HalfPlanes(np.where(there[..., None], inward, 0), np.where(there, level, -1))


def _turned(covers: Polygons, normals: Array) -> Polygons:
    """Covers that are counter-clockwise, seen against unit normals (m, 3)."""
    clockwise = np.einsum("nx,nx->n", covers.normals(), normals) <= 0
    place = np.arange(covers.corners.shape[1])
    backward = np.where(covers.there, covers.sizes[:, None] - 1 - place, place)
    order = np.where(clockwise[:, None], backward, place)
    return Polygons(np.take_along_axis(covers.corners, order[..., None], axis=1), covers.sizes)


class _Edges(NamedTuple):
    """Numbers (n, k) of the points at which edges start and end, in lexicographic order."""

    start: Indices
    end: Indices

    @classmethod
    def of(cls, numbers: Indices, polygons: Polygons) -> _Edges:
        start = numbers.reshape(polygons.corners.shape[:2])
        return cls(start, np.take_along_axis(start, polygons.following, axis=1))


def _numbered_edges(polygons: Polygons, covers: Polygons) -> tuple[_Edges, _Edges]:
    """Edges of polygons and of covers, in whose numbers equal points are equal."""
    points = np.concatenate([p.corners.reshape(-1, 3) for p in (polygons, covers)])
    numbers = np.unique(points, axis=0, return_inverse=True)[1].ravel()
    split = polygons.corners.shape[0] * polygons.corners.shape[1]
    return _Edges.of(numbers[:split], polygons), _Edges.of(numbers[split:], covers)


def _shared(
    own: _Edges, of_covers: _Edges, of: Indices, polygons: Polygons, covers: Polygons
) -> NDArray[np.bool_]:
    """Whether each edge (n, k) of a cover is one of its polygon, or the reverse of a cover's."""
    count = 1 + max(own.start.max(initial=0), of_covers.start.max(initial=0))
    codes = [
        own.start * count + own.end,
        of_covers.start * count + of_covers.end,
        of_covers.end * count + of_covers.start,
    ]
    numbers = np.unique(np.concatenate([c.ravel() for c in codes]), return_inverse=True)[1].ravel()
    sizes = np.cumsum([code.size for code in codes])
    owners = [np.arange(polygons.count), of, of]
    keys = [
        number.reshape(code.shape) + owner[:, None] * (1 + numbers.max(initial=0))
        for number, code, owner in zip(np.split(numbers, sizes[:-1]), codes, owners, strict=True)
    ]
    own_keys, forth, back = keys
    is_own = np.isin(forth, own_keys[polygons.there])
    is_between = np.isin(back, forth[covers.there])
    return np.asarray(is_own | is_between)
