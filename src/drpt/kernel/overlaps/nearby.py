"""Pairs of points or boxes that are close to each other, found among very many (host).

Only pairs of different groups are found. Pairs within a group cost no time, however close they are.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    Array: TypeAlias = NDArray[np.float64]
    Indices: TypeAlias = NDArray[np.intp]
    Boxes: TypeAlias = Callable[[Indices], tuple[Array, Array]]

STEP = 16.0
"""Ratio of the tolerances of two levels. The size of cells follows the tolerances of a level."""
CELL = 32.0
"""Width of a cell over the largest tolerance in it. Points near the border of a cell belong to the
next cell, too; with this width they are few."""
PRIMES = np.array([73856093, 19349663, 83492791, 39916801])
"""Factors of a hash of cells (Teschner et al. 2003, "Optimized Spatial Hashing for Collision
Detection of Deformable Objects"; one more for a fourth coordinate)."""
COMPARED = 2**20
"""Pairs of boxes that are compared at once, which bounds the memory to some 10 MiB."""
FEW = 32
"""Up to this number, all pairs are compared."""
PROGRESS = 1.5
"""A set of boxes is halved only if both halves together have at most this many times its boxes."""


class _Cells(NamedTuple):
    """Points sorted by cell: their numbers, and the numbers of their cells, both (m,)."""

    members: Indices
    cells: Indices


def close_pairs(points: Array, tolerances: Array, groups: Indices, boxes: Boxes) -> Indices:
    """Pairs (k, 2) of points (n, d) that may coincide; no pair is missed, few are superfluous.

    Parameters
    ----------
    points, tolerances
        Two points may coincide if they differ by no more than the sum of their tolerances (n,) in
        each coordinate; d is 4 at most.
    groups
        The number of the group (n,) of each point; the points of a pair are of different groups.
    boxes
        Function that returns the lowest and the highest corners (m, 3) of boxes around the objects
        that some of the points stand for. The boxes of a pair intersect.
    """
    found = [np.empty((0, 2), np.intp)]
    for members, cells in _crowded_cells(points, tolerances, groups):
        sizes = np.bincount(cells)[cells]
        small = sizes <= FEW
        found.append(_pairs_in_cells(members[small], cells[small]))
        ends = np.flatnonzero(np.diff(cells[~small])) + 1
        crowds = np.split(members[~small], ends) if (~small).any() else ()
        distinct = {np.sort(crowd).tobytes(): crowd for crowd in crowds}  # near borders all recur
        for crowd in distinct.values():
            found.append(crowd[box_pairs(*boxes(crowd), groups[crowd])])
    pairs = np.sort(np.concatenate(found), axis=1)
    pairs = np.unique(pairs[groups[pairs[:, 0]] != groups[pairs[:, 1]]], axis=0)
    return pairs[_intersect(*boxes(pairs[:, 0]), *boxes(pairs[:, 1]))]


def box_pairs(low: Array, high: Array, groups: Indices) -> Indices:
    """Pairs (k, 2) of boxes (n, 3) of different groups that intersect."""
    found, left = [np.empty((0, 2), np.intp)], [np.arange(len(low))]
    while left:
        among = left.pop()
        if (groups[among] == groups[among[0]]).all():
            continue
        halves = _halves(low[among], high[among]) if len(among) > FEW else None
        if halves is None:
            found.append(_all_pairs(low, high, groups, among))
        else:
            left += [among[half] for half in halves]
    return np.unique(np.concatenate(found), axis=0)


def _crowded_cells(points: Array, tolerances: Array, groups: Indices) -> Iterator[_Cells]:
    """Cells with points of several groups, on each level of tolerances.

    A level contains its own points and those of finer levels.
    """
    coarsest = tolerances.max()
    levels = np.floor(np.log(coarsest / tolerances) / np.log(STEP)).astype(np.intp)
    for level in np.flatnonzero(np.bincount(levels)).tolist():
        width = CELL * coarsest / STEP**level
        natives = levels == level
        if level == 0:
            members, cells = _sorted_by_cell(points / width)
        else:
            finer = np.flatnonzero(levels >= level)
            members, cells = _sorted_by_cell(points[finer] / width)
            members = finer[members]
        among = groups[members]
        mixed = (cells[1:] == cells[:-1]) & (among[1:] != among[:-1])
        wanted = np.zeros(cells[-1] + 1, bool)
        wanted[cells[1:][mixed]] = True
        if wanted.any():
            has_native = np.zeros_like(wanted)
            has_native[cells[natives[members]]] = True
            kept = (wanted & has_native)[cells]
            if kept.any():
                yield _Cells(members[kept], cells[kept])


def _sorted_by_cell(points: Array) -> _Cells:
    """Points (n, d) in cells of width 1, and those near a border in both of its cells."""
    corners = np.floor(points)
    offsets = points - corners
    cells = (corners.astype(np.int64) * PRIMES[: points.shape[1]]).sum(axis=1)
    members = np.arange(len(points))
    for axis in range(points.shape[1]):
        near = np.flatnonzero(offsets[members, axis] < 2 / CELL)
        members = np.concatenate([members, members[near]])
        cells = np.concatenate([cells, cells[near] - PRIMES[axis]])
    bits = max(len(members) - 1, 1).bit_length()
    packed = np.left_shift(cells.view(np.uint64), np.uint64(bits)) | np.arange(
        len(members), dtype=np.uint64
    )
    packed.sort()  # several times as fast as `argsort`
    keys = packed >> np.uint64(bits)
    order = (packed & np.uint64(2**bits - 1)).astype(np.intp)
    return _Cells(members[order], np.cumsum(np.diff(keys, prepend=keys[:1]) != 0))


def _pairs_in_cells(members: Indices, cells: Indices) -> Indices:
    """All pairs (k, 2) of members of the same cell."""
    found = [np.empty((0, 2), np.intp)]
    for ahead in range(1, len(members)):
        same = np.flatnonzero(cells[ahead:] == cells[:-ahead])
        if not len(same):
            break
        found.append(np.column_stack([members[same], members[same + ahead]]))
    return np.concatenate(found)


def _halves(low: Array, high: Array) -> tuple[Indices, Indices] | None:
    """Boxes on either side of a plane across an axis; None if most are on both sides."""
    middles = (low + high) / 2
    for axis in np.argsort(-np.ptp(middles, axis=0)):
        cut = np.median(middles[:, axis])
        halves = np.flatnonzero(low[:, axis] <= cut), np.flatnonzero(high[:, axis] >= cut)
        if sum(map(len, halves)) <= PROGRESS * len(low):
            return halves
    return None


def _all_pairs(low: Array, high: Array, groups: Indices, among: Indices) -> Indices:
    rows = max(1, COMPARED // len(among))
    found = [
        _pairs_of_rows(low, high, groups, among, range(start, min(start + rows, len(among))))
        for start in range(0, len(among), rows)
    ]
    return np.sort(np.concatenate(found), axis=1)


def _pairs_of_rows(
    low: Array, high: Array, groups: Indices, among: Indices, rows: range
) -> Indices:
    """Pairs of the boxes in some rows of a list, each with those after it."""
    these, others = among[rows.start : rows.stop, None], among[None, rows.start + 1 :]
    later = np.arange(others.size) >= np.arange(len(rows))[:, None]
    hit = later & (groups[these] != groups[others])
    for axis in range(low.shape[1]):
        hit &= low[others, axis] <= high[these, axis]
        hit &= low[these, axis] <= high[others, axis]
    first, second = np.nonzero(hit)
    return np.column_stack([these[first, 0], others[0, second]])


def _intersect(low: Array, high: Array, lows: Array, highs: Array) -> NDArray[np.bool_]:
    return np.asarray(((lows <= high) & (low <= highs)).all(axis=-1))
