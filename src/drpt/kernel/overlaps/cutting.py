"""Cuts the areas that later surfaces cover away from meshes (host)."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from drpt.kernel.facets import area_vectors, has_area, merge_coplanar
from drpt.kernel.overlaps.clipping import fan, subtract, widen
from drpt.kernel.overlaps.coplanar import SAME_PLACE
from drpt.kernel.overlaps.triangle_pairs import lies_inside
from drpt.kernel.parts import NO_TRIANGLES, Part

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from drpt.kernel.parts import Triangles

    Array: TypeAlias = NDArray[np.float64]
    Indices: TypeAlias = NDArray[np.intp]

MERGE_LIMIT = 256
"""Up to this many overlapping triangles are merged into convex polygons before they are cut."""
DIGITS = 7
"""Triangles whose planes agree to this many digits are merged. Planes that are not the same differ
by more, see `SAME_PLACE`."""


def cut_parts(parts: list[Part], triangles: Triangles, pairs: Indices) -> list[Part]:
    """Parts without the areas of the first of each pair of triangles that the second covers.

    The first ones are in ascending order.
    """
    gone = _wholly_covered(triangles, pairs)
    # What is gone need not be cut, and what covers it covers all that it would have covered.
    pairs = pairs[~np.isin(pairs, gone).any(axis=1)]
    cut: dict[int, Part] = {}
    for place in np.unique(triangles.part[np.concatenate([gone, pairs[:, 0]])]):
        ends = triangles.first[place : place + 2]
        part = triangles.parts[place]
        gone_here = gone[slice(*np.searchsorted(gone, ends))]
        pairs_here = pairs[slice(*np.searchsorted(pairs[:, 0], ends))]
        cut[part.number] = _cut_part(triangles, place, gone_here, pairs_here)
    return [cut.get(part.number, part) for part in parts]


def _wholly_covered(triangles: Triangles, pairs: Indices) -> Indices:
    """Numbers of the triangles that lie in a single one that covers them, ascending."""
    corners = triangles.corners(pairs[:, ::-1].ravel()).reshape(-1, 2, 3, 3)
    rooms = SAME_PLACE * np.abs(corners).max(axis=(1, 2, 3))
    return np.unique(pairs[lies_inside(corners, rooms), 0])


def _cut_part(triangles: Triangles, place: int, gone: Indices, pairs: Indices) -> Part:
    """A part without triangles that are gone, and without what pairs cover of others."""
    part, first = triangles.parts[place], triangles.first[place]
    covered, at = np.unique(pairs[:, 0], return_inverse=True)
    numbers = covered - first
    corners, normals = part.primitives[numbers], part.normals
    if len(normals) or len(pairs) > MERGE_LIMIT:
        covers = np.split(pairs[:, 1], np.cumsum(np.bincount(at)))[: len(covered)]
        pieces = [
            _uncovered(polygon, list(triangles.corners(others)))
            for polygon, others in zip(corners, covers, strict=True)
        ]
    else:
        pieces = _merged_pieces(triangles, pairs)
    left = np.delete(np.arange(len(part.primitives)), np.concatenate([gone - first, numbers]))
    if len(normals):
        mixed = map(_interpolated, corners, normals[numbers], pieces)
        normals = np.concatenate([normals[left], *mixed])
    whole = np.concatenate([part.primitives[left], *pieces])
    vectors = area_vectors(whole)
    kept = has_area(vectors)
    normals = normals[kept] if len(normals) else normals
    return Part(part.number, part.shape, whole[kept], normals, vectors[kept], is_cut=True)


def _merged_pieces(triangles: Triangles, pairs: Indices) -> list[Array]:
    """Remaining triangles (m, 3, 3) of flat ones; those in one plane are cut as polygons."""
    if not len(pairs):
        return []
    corners, vectors = triangles.corners(pairs[:, 0]), triangles.vectors[pairs[:, 0]]
    normals = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    offsets = np.einsum("ij,ij->i", normals, corners[:, 0]) / np.abs(corners).max()
    rows = np.round(np.column_stack([normals, offsets]), DIGITS)
    plane = np.unique(rows, axis=0, return_inverse=True)[1].ravel()
    pieces = []
    for k in range(plane.max() + 1):
        first, second = (np.unique(column) for column in pairs[plane == k].T)
        covers = merge_coplanar(triangles.corners(second))
        polygons = merge_coplanar(triangles.corners(first))
        pieces += [_uncovered(polygon, covers) for polygon in polygons]
    return pieces


def _uncovered(polygon: Array, covers: list[Array]) -> Array:
    """Triangles (m, 3, 3) of the part of a polygon that no cover hides."""
    overlap = SAME_PLACE * np.abs(polygon).max()
    pieces = subtract(polygon, covers, overlap)
    return np.concatenate([NO_TRIANGLES, *(fan(widen(piece, overlap)) for piece in pieces)])


def _interpolated(corners: Array, normals: Array, pieces: Array) -> Array:
    """Interpolated normals (m, 3, 3), not of unit length, at the corners of a triangle's pieces."""
    a, b, c = corners
    basis = np.stack([b - a, c - a, np.cross(b - a, c - a)], axis=1)
    weights = np.linalg.solve(basis, (pieces - a).reshape(-1, 3).T).T
    mixed = normals[0] + weights[:, :2] @ (normals[1:] - normals[0])
    return np.asarray(mixed.reshape(-1, 3, 3))
