"""Triangles that overlap in one plane, up to rounding, found among very many (host)."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

from drpt.kernel.overlaps.nearby import close_pairs
from drpt.kernel.overlaps.triangle_pairs import overlap_width, separation

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from drpt.kernel.parts import Part, Triangles

    Array: TypeAlias = NDArray[np.float64]
    Indices: TypeAlias = NDArray[np.intp]
    Mask: TypeAlias = NDArray[np.bool_]

SAME_PLACE = 2.0**-22
"""Largest distance between two surfaces in one plane, relative to their coordinates.

Rounding the corners of two triangles to float32 moves their planes apart by up to four times 2⁻²⁴.
Surfaces that are farther apart keep their order on the device, up to `intersect.SPAWN_OFFSET`.
"""
ROUNDING = 2.0**-22
"""Largest distance of a triangle's corners from its exact plane, relative to its coordinates: four
roundings to float32, for triangles that are longer than high. Divided by the triangle's size, it
bounds the angle by which rounding turns the normal."""
BESIDE = np.array([1.1, 1.3, 1.7])
"""A point outside the scene, in units of the scene's largest coordinate."""
LARGE = 2**14
"""In a mesh with more triangles than this, only those near other meshes are compared."""
FEW_OTHERS = 2**10
"""If a large mesh has no more other triangles around it than this, only its triangles in one of
their planes are compared; otherwise those in the box around the others."""
DIGITS = 9
"""Planes that agree to this many digits are tested once."""


class _Planes(NamedTuple):
    """Planes of triangles: unit normals (n, 3), offsets (n,), and their tolerances (n,).

    A point of the scene in the exact plane of a triangle is no farther from the computed plane than
    that triangle's ``tolerance``.
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
    """Numbers of the triangles that are compared: all but some of large meshes."""
    kept = np.ones(len(groups), bool)
    for place in np.flatnonzero(np.diff(triangles.first) > LARGE).tolist():
        start, stop = triangles.first[place : place + 2]
        if not triangles.parts[place].is_light:
            others = np.flatnonzero(groups != groups[start])
            kept[start:stop] = _near(triangles, place, others, sizes)
    return np.flatnonzero(kept)


def _near(triangles: Triangles, place: int, others: Indices, sizes: Array) -> Mask:
    """Which triangles of a mesh may be in one plane with one of the others."""
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
    """Which triangles (n, 3) have all corners in one of several sets of points, each a mask."""
    found = np.zeros(len(faces), bool)
    for mask in masks:
        if mask.any():
            left = np.flatnonzero(mask[faces[:, 0]])
            for corner in (1, 2):
                left = left[mask[faces[left, corner]]]
            found[left] = True
    return found


def _planes(triangles: Triangles, numbers: Indices, sizes: Array) -> _Planes:
    """Planes of some triangles. Rounding turns the plane of a large triangle less."""
    vectors, starts = triangles.vectors[numbers], triangles.corners(numbers)[:, 0]
    lengths = np.sqrt(np.einsum("ij,ij->i", vectors, vectors))
    normals = vectors / lengths[:, None]
    turns = ROUNDING * 2 / np.sqrt(lengths)
    tolerance = sizes[triangles.part[numbers]] * (SAME_PLACE + turns * 4 * sizes.max())
    return _Planes(normals, np.einsum("ij,ij->i", normals, starts), tolerance)


def _feet(triangles: Triangles, numbers: Indices, sizes: Array) -> tuple[Array, Array]:
    """A point (n, 3) that identifies the plane of each triangle, and its tolerance (n,).

    It is the foot of the perpendicular from `BESIDE`, relative to that point. Unlike the normal, it
    is the same for triangles that face opposite ways.
    """
    normals, offsets, tolerance = _planes(triangles, numbers, sizes)
    heights = offsets - normals @ (sizes.max() * BESIDE)
    return normals * heights[:, None], tolerance


def _size(part: Part) -> float:
    """Largest coordinate of a mesh, relative to the kernels' origin and to that of its file."""
    points = part.points
    largest = max(points.max(initial=0), -points.min(initial=0))  # `abs` would copy them
    return float(largest + np.abs(part.zero).max())


def _boxes(triangles: Triangles, numbers: Indices) -> tuple[Array, Array]:
    """Boxes around some triangles, padded so that boxes of touching triangles intersect."""
    corners = triangles.corners(numbers)
    room = SAME_PLACE * triangles.reach(numbers, corners)[:, None]
    return corners.min(axis=1) - room, corners.max(axis=1) + room


def _overlapping(triangles: Triangles, pairs: Indices) -> Indices:
    """Select the pairs of triangles that are in one plane and share an area."""
    corners = triangles.corners(pairs.ravel()).reshape(-1, 2, 3, 3)
    reach = [triangles.reach(pairs[:, i], corners[:, i]) for i in range(2)]
    tolerance = SAME_PLACE * np.minimum(*reach)
    _, normals = triangles.larger(pairs)
    one_plane = separation(corners, normals) <= tolerance
    return pairs[one_plane & (overlap_width(corners) > tolerance)]
