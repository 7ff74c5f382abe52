"""Cuts the areas that later surfaces cover away from meshes (host)."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

from drpt.kernel.facets import area_vectors, has_area, merge_coplanar
from drpt.kernel.overlaps.batches import Polygons
from drpt.kernel.overlaps.clipping import uncovered
from drpt.kernel.overlaps.coplanar import SAME_PLACE
from drpt.kernel.overlaps.triangle_pairs import lies_inside
from drpt.kernel.parts import NO_TRIANGLES, Part

if TYPE_CHECKING:
    from collections.abc import Iterator

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
    places = np.unique(triangles.part[np.concatenate([gone, pairs[:, 0]])])
    tasks = [_task(triangles, place, gone, pairs) for place in places]
    cut = {task.part.number: part for task, part in zip(tasks, _cut(tasks), strict=True)}
    return [cut.get(part.number, part) for part in parts]


class _Task(NamedTuple):
    """A part, its triangles that are gone or cut, and the polygons that are to be cut.

    ``covers`` cover the polygons with the numbers ``of``, ascending. If the part has normals, the
    polygons are the triangles with the numbers ``cut``.
    """

    part: Part
    gone: Indices
    cut: Indices
    polygons: list[Array]
    covers: list[Array]
    of: Indices


def _wholly_covered(triangles: Triangles, pairs: Indices) -> Indices:
    """Numbers of the triangles that lie in a single one that covers them, ascending."""
    corners = triangles.corners(pairs[:, ::-1].ravel()).reshape(-1, 2, 3, 3)
    rooms = SAME_PLACE * np.abs(corners).max(axis=(1, 2, 3))
    return np.unique(pairs[lies_inside(corners, rooms), 0])


def _task(triangles: Triangles, place: int, gone: Indices, pairs: Indices) -> _Task:
    """What is to be done with a part; ``gone`` and ``pairs`` are those of all parts."""
    part, first = triangles.parts[place], triangles.first[place]
    ends = triangles.first[place : place + 2]
    gone = gone[slice(*np.searchsorted(gone, ends))] - first
    pairs = pairs[slice(*np.searchsorted(pairs[:, 0], ends))]
    covered, at = np.unique(pairs[:, 0], return_inverse=True)
    if len(part.normals) or len(pairs) > MERGE_LIMIT:
        polygons, covers = list(triangles.corners(covered)), list(triangles.corners(pairs[:, 1]))
        return _Task(part, gone, covered - first, polygons, covers, at.ravel())
    return _Task(part, gone, covered - first, *_merged(triangles, pairs))


def _merged(triangles: Triangles, pairs: Indices) -> tuple[list[Array], list[Array], Indices]:
    """Polygons of flat triangles in one plane, their covers, and which polygon each covers."""
    polygons: list[Array] = []
    covers: list[Array] = []
    of: list[int] = []
    corners, vectors = triangles.corners(pairs[:, 0]), triangles.vectors[pairs[:, 0]]
    normals = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    offsets = np.einsum("ij,ij->i", normals, corners[:, 0]) / np.abs(corners).max(initial=1e-300)
    rows = np.round(np.column_stack([normals, offsets]), DIGITS)
    plane = np.unique(rows, axis=0, return_inverse=True)[1].ravel()
    for k in range(plane.max(initial=-1) + 1):
        first, second = (np.unique(column) for column in pairs[plane == k].T)
        above = merge_coplanar(triangles.corners(second))
        for polygon in merge_coplanar(triangles.corners(first)):
            of += [len(polygons)] * len(above)
            covers += above
            polygons.append(polygon)
    return polygons, covers, np.array(of, np.intp)


def _cut(tasks: list[_Task]) -> Iterator[Part]:
    """The parts without what is gone and what is covered; all polygons are cut at once."""
    ends = np.cumsum([0, *(len(task.polygons) for task in tasks)])
    polygons = [polygon for task in tasks for polygon in task.polygons]
    covers = [cover for task in tasks for cover in task.covers]
    of = np.concatenate([task.of + end for task, end in zip(tasks, ends, strict=False)])
    pieces, owners = NO_TRIANGLES, np.empty(0, np.intp)
    if polygons:
        pieces, owners = uncovered(Polygons.of(polygons), Polygons.of(covers), of, SAME_PLACE)
    for task, start, stop in zip(tasks, ends, ends[1:], strict=False):
        here = slice(*np.searchsorted(owners, [start, stop]))
        yield _cut_part(task, pieces[here], owners[here] - start)


def _cut_part(task: _Task, pieces: Array, owners: Indices) -> Part:
    """A part with pieces in place of its triangles that are cut."""
    part, normals = task.part, task.part.normals
    left = np.delete(np.arange(len(part.primitives)), np.concatenate([task.gone, task.cut]))
    if len(normals):
        mixed = _interpolated(part.primitives[task.cut], normals[task.cut], pieces, owners)
        normals = np.concatenate([normals[left], mixed])
    whole = np.concatenate([part.primitives[left], pieces])
    vectors = area_vectors(whole)
    kept = has_area(vectors)
    normals = normals[kept] if len(normals) else normals
    return Part(part.number, part.shape, whole[kept], normals, vectors[kept], is_cut=True)


def _interpolated(corners: Array, normals: Array, pieces: Array, owners: Indices) -> Array:
    """Interpolated normals (m, 3, 3), not of unit length, at the corners of triangles' pieces."""
    a, b, c = corners[owners].swapaxes(0, 1)
    basis = np.stack([b - a, c - a, np.cross(b - a, c - a)], axis=2)
    weights = np.linalg.solve(basis[:, None], (pieces - a[:, None])[..., None])[..., :2, 0]
    first, others = normals[owners, :1], normals[owners, 1:]
    return np.asarray(first + weights @ (others - first))
