"""Triangulates polygons of mesh files.

If the other corners of a polygon follow each other counter-clockwise around the first one, as in
every convex polygon, it is cut into the fan of that corner. Other polygons are cut by ear clipping
(mapbox-earcut), projected to the coordinate plane that is nearest to theirs.
"""

from __future__ import annotations

import math
import warnings
from typing import TYPE_CHECKING, NamedTuple

import mapbox_earcut
import numpy as np

from drpt.messages import one_line

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Integers = NDArray[np.int64]

CROSSED = "intersects itself"
BENT = "is far from planar"
MAX_BEND = 0.05
"""Largest distance of a corner from the mean plane of a planar polygon, relative to its extent, as
in a square that is folded along its diagonal by 22 degrees."""
MIN_SINE = 1e-6
"""Smallest sine of a fan triangle's angle at the first corner. In files with seven digits, rounding
decides which side a thinner triangle faces."""
SLIVER = 1e-3
"""Height of a triangle, relative to its longest edge, below which that edge may be flipped."""
ROUNDING = 1e-12
"""Relative areas below this count as 0: several thousand roundings of float64."""
MAX_COMPARED = 1000
"""Up to this number of corners, all pairs of edges are tested for an intersection. In larger
polygons only a wrong sum of the triangles' areas reveals one."""


class Triangulation(NamedTuple):
    """Triangles of several polygons, whose corners have consecutive numbers.

    Attributes
    ----------
    corners
        Numbers of each triangle's corners, (t, 3).
    owners
        The polygon of each triangle, ascending, (t,).
    fanned
        Whether a polygon is cut into the fan of its first corner, (n,).
    flaws
        `CROSSED` or `BENT` for each polygon with such a flaw, by number.
    """

    corners: Integers
    owners: Integers
    fanned: NDArray[np.bool_]
    flaws: dict[int, str]


def triangulate(points: Floats, sizes: Integers) -> Triangulation:
    """Cut polygons into triangles.

    ``points`` (k, 3) are the corners of all polygons in order, and ``sizes`` (n,) their numbers of
    corners, three or more. Repeated corners are left out.
    """
    starts = np.cumsum(sizes) - sizes
    fanned = np.ones(len(sizes), bool)
    flaws: dict[int, str] = {}
    corners, owners = [np.zeros((0, 3), np.int64)], [np.zeros(0, np.int64)]
    for size in np.unique(sizes):
        group = np.flatnonzero(sizes == size)
        polygons = points[starts[group, None] + np.arange(size)]
        right, bent = _judged(polygons)
        fanned[group] = right
        flaws.update(dict.fromkeys(group[bent].tolist(), BENT))
        corners.append((starts[group[right], None, None] + fan(size)).reshape(-1, 3))
        owners.append(np.repeat(group[right], size - 2))
        for index in np.flatnonzero(~right).tolist():
            triangles, crossed = _cut(polygons[index])
            if crossed:
                flaws[int(group[index])] = CROSSED
            corners.append(starts[group[index]] + triangles)
            owners.append(np.full(len(triangles), group[index]))
    order = np.argsort(np.concatenate(owners), kind="stable")
    return Triangulation(
        np.concatenate(corners)[order],
        np.concatenate(owners)[order],
        fanned,
        dict(sorted(flaws.items())),
    )


def warn_of_flaws(path: Path, flaws: Mapping[str, str]) -> None:
    """Give one warning for each kind of flaw; the keys of ``flaws`` are places in the file."""
    for flaw in dict.fromkeys(flaws.values()):
        places = [place for place, found in flaws.items() if found == flaw]
        more = f" (the first of {len(places)})" if len(places) > 1 else ""
        message = one_line(f"{path}: {places[0]}: this polygon {flaw}{more}")
        warnings.warn(message, stacklevel=2)


def fan(size: int) -> Integers:
    """Return the triangles around the first corner, (size - 2, 3)."""
    if size == 4:  # the second triangle starts at the third corner, as trimesh has it
        return np.array([[0, 1, 2], [2, 3, 0]])
    last = np.arange(2, size)
    return np.stack([0 * last, last - 1, last], axis=1)


def _judged(polygons: Floats) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which polygons (m, k, 3) have a correct fan, and which are far from planar."""
    with np.errstate(all="ignore"):  # polygons that are not finite are neither
        spokes = polygons[:, 1:] - polygons[:, :1]
        spokes = spokes / np.abs(spokes).max(axis=(1, 2), keepdims=True)
        areas = np.cross(spokes[:, :-1], spokes[:, 1:])
        normal = areas.sum(axis=1, keepdims=True)
        normal = normal / np.linalg.norm(normal, axis=2, keepdims=True)
        facing = (areas * normal).sum(axis=2)
        lengths = np.linalg.norm(spokes, axis=2)
        angles = np.arctan2(facing, (spokes[:, :-1] * spokes[:, 1:]).sum(axis=2))
        turns_once = angles.sum(axis=1) < 2 * np.pi
        right = (facing > MIN_SINE * lengths[:, :-1] * lengths[:, 1:]).all(axis=1) & turns_once
        height = np.pad((spokes * normal).sum(axis=2), ((0, 0), (1, 0)))
        height = np.abs(height - height.mean(axis=1, keepdims=True)).max(axis=1)
        bent = height > MAX_BEND * lengths.max(axis=1)
    return right, bent


def _cut(points: Floats) -> tuple[Integers, bool]:
    """Clip the ears of a polygon (k, 3); return triangles, and whether it intersects itself."""
    if not np.isfinite(points).all():
        return fan(len(points)), False
    kept = np.flatnonzero((points != np.roll(points, 1, axis=0)).any(axis=1))
    flat = _flattened(points[kept]) if len(kept) > 2 else None
    if flat is None:
        return fan(len(points)), False
    ends = np.array([len(flat)], np.uint32)
    triangles = mapbox_earcut.triangulate_float64(flat, ends).reshape(-1, 3).astype(np.int64)
    areas = _areas(*flat[triangles].swapaxes(0, 1))
    if areas.sum() < 0:
        triangles = triangles[:, ::-1]
    triangles = _without_slivers(flat, triangles)
    return kept[triangles], _crossed(flat, float(np.abs(areas).sum()))


def _flattened(points: Floats) -> Floats | None:
    """Return a polygon in the coordinate plane that it faces, counter-clockwise, of size 1.

    None if it has no area at all.
    """
    spokes = points - points[0]
    spokes = spokes / np.abs(spokes).max()
    areas = np.cross(spokes[1:-1], spokes[2:])
    normal = areas.sum(axis=0)
    if np.abs(normal).max() <= ROUNDING:  # areas on both sides, or none at all
        normal = areas[np.abs(areas).max(axis=1).argmax()]
    if np.abs(normal).max() <= ROUNDING:
        return None
    axis = int(np.abs(normal).argmax())
    axes = [(axis + 1) % 3, (axis + 2) % 3]
    return np.ascontiguousarray(spokes[:, axes if normal[axis] > 0 else axes[::-1]])


def _without_slivers(flat: Floats, triangles: Integers) -> Integers:
    """Flip the longest edges of slivers where that gives thicker triangles."""
    thin = np.flatnonzero(_heights(flat, triangles) < SLIVER).tolist()
    corners = triangles.tolist()
    at = {edge: index for index, triangle in enumerate(corners) for edge in _edges(triangle)}
    for _ in range(2 * len(corners) if thin else 0):  # nearly always, each sliver is flipped once
        first = thin.pop()
        u, v, w = _longest_first(flat, corners[first])
        second = at.get((v, u))
        if second is not None:  # else it is an edge of the polygon
            x = sum(corners[second]) - u - v
            pair = [[w, u, x], [x, v, w]]
            heights = _heights(flat, np.array(pair))
            if heights.min() > _heights(flat, np.array([corners[first], corners[second]])).min():
                corners[first], corners[second] = pair
                at.update(dict.fromkeys(_edges(pair[0]), first))
                at.update(dict.fromkeys(_edges(pair[1]), second))
                thin += [i for i, h in zip((first, second), heights, strict=True) if h < SLIVER]
        if not thin:
            break
    return np.array(corners, np.int64).reshape(-1, 3)


def _edges(triangle: list[int]) -> list[tuple[int, int]]:
    a, b, c = triangle
    return [(a, b), (b, c), (c, a)]


def _longest_first(flat: Floats, triangle: list[int]) -> tuple[int, int, int]:
    """Return the corners of a triangle, those of its longest edge first."""
    a, b, c = triangle
    turns = (a, b, c), (b, c, a), (c, a, b)
    return max(turns, key=lambda turn: math.dist(flat[turn[0]], flat[turn[1]]))


def _heights(flat: Floats, triangles: Integers) -> Floats:
    """Return each triangle's height on its longest edge, relative to that; < 0 if clockwise."""
    corners = flat[triangles]
    squares = ((corners - np.roll(corners, 1, axis=1)) ** 2).sum(axis=2).max(axis=1)
    heights: Floats = _areas(*corners.swapaxes(0, 1)) / squares
    return heights


def _crossed(flat: Floats, covered: float) -> bool:
    """Return whether a polygon (k, 2) intersects itself; `covered` is twice its triangles' area."""
    following = np.roll(flat, -1, axis=0)
    area = float(_areas(np.zeros(2), flat, following).sum())
    if abs(covered - area) > ROUNDING * len(flat) * max(covered, area):
        return True
    if len(flat) > MAX_COMPARED:
        return False
    sides = _areas(flat[:, None], following[:, None], flat[None])  # of each corner, by each edge
    sides[np.abs(sides) <= ROUNDING] = 0
    parted = sides * np.roll(sides, -1, axis=1) < 0  # the ends of one edge, by another
    return bool((parted & parted.T).any())


def _areas(a: Floats, b: Floats, c: Floats) -> Floats:
    """Return twice the signed areas of triangles in the plane."""
    first, second = b - a, c - a
    areas: Floats = first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]
    return areas
