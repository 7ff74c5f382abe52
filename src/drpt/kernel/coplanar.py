"""Triangles that overlap in one plane, up to rounding, found among very many (host)."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

from drpt.kernel.nearby import close_pairs
from drpt.kernel.triangle_pairs import overlap_width, separation

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from drpt.kernel.parts import Part, Triangles

    Array: TypeAlias = NDArray[np.float64]
    Indices: TypeAlias = NDArray[np.intp]
    Mask: TypeAlias = NDArray[np.bool_]

SAME_PLACE = 2.0**-22
"""Surfaces are in one plane if they differ by no more than this, relative to their coordinates.

Rounding the corners of two triangles to float32 moves their planes apart by up to four times 2⁻²⁴.
What is farther apart keeps its order on the device, up to `intersect.SPAWN_OFFSET`.
"""
ROUNDING = 2.0**-22
"""How far the corners of a triangle may be off its plane, relative to its coordinates, over its
size: by how much its normal may be turned. Some roundings to float32, for triangles that are
longer than high."""
BESIDE = np.array([1.1, 1.3, 1.7])
"""Where a point beside the scene is, over the scene's largest coordinate."""
LARGE = 2**14
"""Of meshes with more triangles, only those that are near others are compared with them."""
FEW_OTHERS = 2**10
"""Where others are no more than this, only those triangles of a large mesh are compared that are in
a plane of theirs; else those in the box around them."""
DIGITS = 9
"""Planes that are the same in this many digits are looked at once."""


class _Planes(NamedTuple):
    """Planes of triangles: unit normals (n, 3), offsets (n,), and by how much both may be off.

    Within the scene, a point of a triangle is no farther from the plane of another one that it lies
    on than that one's ``tolerance`` (n,).
    """

    normals: Array
    offsets: Array
    tolerance: Array


def coplanar_pairs(triangles: Triangles, groups: Indices) -> Indices:
    """Pairs (k, 2) of triangles of different groups (n,) that overlap in one plane, in order."""
    sizes = np.array([_size(part) for part in triangles.parts])
    numbers = _screened(triangles, groups, sizes)
    if not len(numbers):
        return np.empty((0, 2), np.intp)

    def boxes(some: Indices) -> tuple[Array, Array]:
        return _boxes(triangles, numbers[some])

    near = close_pairs(*_feet(triangles, numbers, sizes), groups[numbers], boxes)
    return _overlapping(triangles, numbers[near])


def _screened(triangles: Triangles, groups: Indices, sizes: Array) -> Indices:
    """Numbers of the triangles that are compared: of large meshes only some."""
    kept = np.ones(len(groups), bool)
    for place in np.flatnonzero(np.diff(triangles.first) > LARGE).tolist():
        start, stop = triangles.first[place : place + 2]
        if not triangles.parts[place].is_light:
            others = np.flatnonzero(groups != groups[start])
            kept[start:stop] = _near(triangles, place, others, sizes)
    return np.flatnonzero(kept)


def _near(triangles: Triangles, place: int, others: Indices, sizes: Array) -> Mask:
    """Which triangles of a mesh may be in one plane with some of the others."""
    part = triangles.parts[place]
    if len(others) > FEW_OTHERS:
        low, high = _boxes(triangles, others)
        outside = [*(part.points < low.min(axis=0)).T, *(part.points > high.max(axis=0)).T]
        return ~_all_corners(part.faces, outside)
    normals, offsets, tolerance = _planes(triangles, others, sizes)
    rows = np.round(np.column_stack([normals, offsets / sizes.max()]), DIGITS)
    distinct = np.unique(rows, axis=0, return_index=True)[1]
    heights = (part.points @ normals[k] - offsets[k] for k in distinct.tolist())
    on_plane = [np.abs(h) <= 2 * tolerance[k] for h, k in zip(heights, distinct, strict=True)]
    return _all_corners(part.faces, on_plane)


def _all_corners(faces: NDArray[np.int32], masks: list[Mask]) -> Mask:
    """Which triangles have all of their corners in one of some sets of points."""
    found = np.zeros(len(faces), bool)
    for mask in masks:
        if mask.any():
            left = np.flatnonzero(mask[faces[:, 0]])
            for corner in (1, 2):
                left = left[mask[faces[left, corner]]]
            found[left] = True
    return found


def _planes(triangles: Triangles, numbers: Indices, sizes: Array) -> _Planes:
    """Planes of some triangles. The larger a triangle, the less its plane is turned by rounding."""
    vectors, starts = triangles.vectors[numbers], triangles.corners(numbers)[:, 0]
    lengths = np.sqrt(np.einsum("ij,ij->i", vectors, vectors))
    normals = vectors / lengths[:, None]
    turns = ROUNDING * 2 / np.sqrt(lengths)
    tolerance = sizes[triangles.part[numbers]] * (SAME_PLACE + turns * 4 * sizes.max())
    return _Planes(normals, np.einsum("ij,ij->i", normals, starts), tolerance)


def _feet(triangles: Triangles, numbers: Indices, sizes: Array) -> tuple[Array, Array]:
    """A point (n, 3) that stands for the plane of each triangle, and its tolerances (n,).

    It is the plane's nearest point to a point beside the scene, relative to that: unlike normals it
    is the same for triangles that face opposite ways.
    """
    normals, offsets, tolerance = _planes(triangles, numbers, sizes)
    heights = offsets - normals @ (sizes.max() * BESIDE)
    return normals * heights[:, None], tolerance


def _size(part: Part) -> float:
    """Largest coordinate of a mesh' part, also as its numbers were given."""
    return float(np.abs(part.points).max(initial=0) + np.abs(part.zero).max())


def _boxes(triangles: Triangles, numbers: Indices) -> tuple[Array, Array]:
    """Boxes around some triangles, which intersect where those touch each other."""
    corners = triangles.corners(numbers)
    room = SAME_PLACE * triangles.reach(numbers, corners)[:, None]
    return corners.min(axis=1) - room, corners.max(axis=1) + room


def _overlapping(triangles: Triangles, pairs: Indices) -> Indices:
    """Those of pairs of triangles that are in one plane and have an area in common."""
    corners = triangles.corners(pairs.ravel()).reshape(-1, 2, 3, 3)
    reach = [triangles.reach(pairs[:, i], corners[:, i]) for i in range(2)]
    tolerance = SAME_PLACE * np.minimum(*reach)
    areas = np.linalg.norm(triangles.vectors[pairs], axis=2)
    rows, larger = np.arange(len(pairs)), areas.argmax(axis=1)
    normals = triangles.vectors[pairs[rows, larger]] / areas[rows, larger, None]
    one_plane = separation(corners, normals) <= tolerance
    return pairs[one_plane & (overlap_width(corners) > tolerance)]
