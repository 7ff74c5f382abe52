"""Merging of coplanar triangles, slabs around polygons, and facets that cast no shadow."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, Delaunay

from drpt.kernel.facets import Facet, area_vectors, bounds, has_area, make_facet, merge_coplanar
from tests.oracle.arrays import dot

Floats: TypeAlias = NDArray[np.float64]
Bools: TypeAlias = NDArray[np.bool_]

ROUNDING = 1e-12  # of float64, with some hundred operations
# How far from an edge a point may lie on either side, relative to the largest coordinate: float32
# directions of slabs are off by 2^-25, and slabs are wider by 2^-23 to close seams.
EDGE = 1e-6

SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
QUAD = np.array([[0, 1, 2], [0, 2, 3]])


def area(corners: Floats) -> float:
    spokes = corners[1:] - corners[0]
    return float(np.linalg.norm(np.cross(spokes[:-1], spokes[1:]).sum(axis=0)) / 2)


def depth_inside(corners: Floats, points: Floats) -> Floats:
    """Distance (n,) to the nearest edge's line, positive inside a convex polygon."""
    spokes = corners[1:] - corners[0]
    normal = np.cross(spokes[:-1], spokes[1:]).sum(axis=0)
    edges = np.roll(corners, -1, axis=0) - corners
    inward = np.cross(normal, edges)
    inward /= np.linalg.norm(inward, axis=1, keepdims=True)
    return np.asarray((points @ inward.T - np.einsum("kc,kc->k", inward, corners)).min(axis=1))


def within_slabs(facet: Facet, points: Floats) -> Bools:
    inside = np.ones(len(points), bool)
    for slab in facet.slabs:
        x = points @ np.array(slab.direction)
        inside &= (slab.low <= x) & (x <= slab.high)
    return inside


def random_plane(rng: np.random.Generator, flat: Floats) -> Floats:
    """Points (..., 2) of a plane, put somewhere in space."""
    axes, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    return np.asarray(flat @ axes[:2] + rng.uniform(-2, 2, 3))


def random_polygon(rng: np.random.Generator, corners: int) -> Floats:
    """A convex polygon (k, 3) in a random plane; its first two edges are not degenerate."""
    angles = np.sort(rng.uniform(0, 2 * np.pi, corners))
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return random_plane(rng, circle * rng.uniform(0.1, 3, 2))


def grid(cells: int) -> Floats:
    """Triangles of a square that is cut into cells, each with a diagonal."""
    x, y = (k.ravel() for k in np.meshgrid(np.arange(cells), np.arange(cells)))
    first = np.stack([x, y, 0 * x], axis=1)[:, None, None, :]
    return np.asarray((first + SQUARE[QUAD]).reshape(-1, 3, 3) / cells)


def test_a_planar_quad_is_one_polygon() -> None:
    (polygon,) = merge_coplanar(SQUARE[QUAD])
    assert len(polygon) == 4
    assert area(polygon) == 1
    assert make_facet(polygon).normal == (0, 0, 1)


def test_corners_along_straight_edges_vanish() -> None:
    strip = np.concatenate([SQUARE[QUAD], SQUARE[QUAD] + [1, 0, 0]])
    (polygon,) = merge_coplanar(strip)
    assert len(polygon) == 4
    assert area(polygon) == 2


@pytest.mark.parametrize("lift", [1e-6, 1e-3, 1.0])
def test_a_bent_quad_stays_two_triangles(lift: float) -> None:
    bent = SQUARE + np.array([0, 0, 0, lift])[:, None] * [0, 0, 1]
    assert len(merge_coplanar(bent[QUAD])) == 2


def test_what_is_not_convex_stays_apart() -> None:
    arrow = np.array([[0.0, 0, 0], [2, 1, 0], [0, 0.5, 0], [-2, 1, 0]])
    assert len(merge_coplanar(arrow[QUAD])) == 2


def test_neighbours_that_face_opposite_ways_stay_apart() -> None:
    opposite = np.array([SQUARE[[0, 1, 2]], SQUARE[[0, 3, 2]]])
    assert len(merge_coplanar(opposite)) == 2


@pytest.mark.parametrize("short", [1e-12, 1e-9, 1e-6])
def test_of_a_short_edge_one_end_is_left(short: float) -> None:
    a, b, c, d = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, short, 0)], float)
    polygons = merge_coplanar([np.array([a, b, c]), np.array([a, c, d])])
    assert sum(area(polygon) for polygon in polygons) == pytest.approx(0.5, abs=short)


def test_a_globe_keeps_its_poles() -> None:
    """Whose corners are apart there by what is left of sin π."""
    longitudes, latitudes = np.linspace(0, 2 * np.pi, 9), np.linspace(0, np.pi, 5)
    globe = [
        [np.sin(v) * np.cos(u), np.sin(v) * np.sin(u), np.cos(v)]
        for v in latitudes
        for u in longitudes
    ]
    at = np.array(globe).reshape(5, 9, 3)
    triangles = [
        np.array(corners)
        for i in range(4)
        for j in range(8)
        for corners in (
            (at[i, j], at[i + 1, j], at[i + 1, j + 1]),
            (at[i, j], at[i + 1, j + 1], at[i, j + 1]),
        )
        if np.linalg.norm(np.cross(corners[1] - corners[0], corners[2] - corners[0])) > 0
    ]
    whole = sum(area(triangle) for triangle in triangles)
    assert sum(map(area, merge_coplanar(triangles))) == pytest.approx(whole, rel=1e-9)


def test_triangles_that_share_no_edge_stay_apart() -> None:
    assert len(merge_coplanar(np.array([SQUARE[[0, 1, 3]], SQUARE[[1, 2, 3]] + 1e-3]))) == 2


@pytest.mark.parametrize("seed", range(20))
def test_merged_polygons_cover_what_the_triangles_cover(seed: int) -> None:
    rng = np.random.default_rng(seed)
    flat = rng.uniform(-1, 1, (12, 2))
    faces = Delaunay(flat).simplices[rng.permutation(8)]  # leaves some out: holes and dents
    triangles = random_plane(np.random.default_rng(seed), flat[faces])
    points = random_plane(np.random.default_rng(seed), rng.uniform(-1, 1, (2000, 2)))

    polygons = merge_coplanar(triangles)

    before = np.max([depth_inside(t, points) for t in triangles], axis=0)
    after = np.max([depth_inside(p, points) for p in polygons], axis=0)
    clear = np.abs(before) > EDGE
    assert clear.mean() > 0.99
    assert np.array_equal(before[clear] > 0, after[clear] > 0)
    total = sum(map(area, triangles))
    assert sum(map(area, polygons)) == pytest.approx(total, rel=ROUNDING)
    assert all(map(is_convex, polygons))


def is_convex(polygon: Floats) -> bool:
    """Whether every corner is one of the convex hull, too."""
    spokes = polygon - polygon[0]
    _, _, axes = np.linalg.svd(spokes)
    return len(ConvexHull(spokes @ axes[:2].T).vertices) == len(polygon)


def test_a_grid_becomes_few_polygons_of_the_same_area() -> None:
    polygons = merge_coplanar(grid(6))
    assert len(polygons) <= 12  # of 72 triangles
    assert sum(map(area, polygons)) == pytest.approx(1, rel=ROUNDING)


@pytest.mark.parametrize("seed", range(20))
def test_slabs_hold_the_polygon_and_nothing_else(seed: int) -> None:
    rng = np.random.default_rng(seed)
    corners = random_polygon(rng, int(rng.integers(3, 7)))
    weights = rng.dirichlet(np.full(len(corners), 0.4), 4000)
    centre = corners.mean(axis=0)
    points = centre + rng.uniform(0, 2, (4000, 1)) * (weights @ corners - centre)

    depth = depth_inside(corners, points)
    inside = within_slabs(make_facet(corners), points)

    room = EDGE * np.abs(corners).max()
    sure = np.abs(depth) > room
    assert 0.1 < (depth[sure] > 0).mean() < 0.95
    assert np.array_equal(inside[sure], depth[sure] > 0)


def test_slabs_let_no_seam_open_between_neighbours() -> None:
    rng = np.random.default_rng(1)
    a, b, c, d = random_plane(rng, np.array([[0.0, 0], [3, 0.1], [2, 2], [-1, 1]]))
    shared = a + rng.uniform(0, 1, (4000, 1)) * (c - a)
    rounded = shared.astype(np.float32).astype(np.float64)
    left, right = make_facet(np.array([a, b, c])), make_facet(np.array([a, c, d]))
    assert (within_slabs(left, rounded) | within_slabs(right, rounded)).all()


def test_parallel_edges_share_a_slab() -> None:
    assert len(make_facet(SQUARE).slabs) == 2


@pytest.mark.parametrize("seed", range(5))
def test_plane_of_a_facet_holds_its_corners(seed: int) -> None:
    rng = np.random.default_rng(seed)
    corners = random_polygon(rng, 5)
    facet = make_facet(corners)
    assert np.linalg.norm(facet.normal) == pytest.approx(1, rel=ROUNDING)
    assert np.abs(corners @ facet.normal - facet.offset).max() < 1e-8  # small components are 0
    spoke = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    assert spoke @ facet.normal > 0


def test_triangles_without_area_are_told() -> None:
    point, line = SQUARE[[0, 0, 0]], np.array([[0.0, 0, 0], [1, 1, 1], [3, 3, 3]])
    thin = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1e-9, 0]])
    assert has_area(area_vectors(np.array([SQUARE[:3], point, line, thin]))).tolist() == [
        True,
        False,
        False,
        True,
    ]


def test_a_facet_bounds_what_is_on_one_side_of_its_plane() -> None:
    facet = make_facet(SQUARE)
    above = np.array([[0.5, 0.5, 1.0], [5, 5, 2]])
    assert bounds(facet, above, np.zeros(2))
    assert bounds(facet, -above, np.zeros(2))
    assert bounds(facet, np.concatenate([SQUARE, above]), np.zeros(6))
    assert bounds(facet, above, np.array([1.0, 2]))
    assert not bounds(facet, above, np.array([1.001, 0]))
    assert not bounds(facet, np.array([[5.0, 5, 1], [5, 5, -1]]), np.zeros(2))


@pytest.mark.parametrize("seed", range(10))
def test_no_two_points_are_separated_by_a_facet_that_bounds_them(seed: int) -> None:
    rng = np.random.default_rng(seed)
    corners = random_polygon(rng, 4)
    facet = make_facet(corners)
    points = rng.uniform(-3, 3, (400, 3))
    points = points[(points @ facet.normal - facet.offset) * rng.choice([-1, 1]) >= 0]
    assert bounds(facet, points, np.zeros(len(points)))
    a, b = points[rng.integers(0, len(points), (2, 2000))]
    assert not _crosses(facet, a, b).any()
    mirrored = points - 2 * (points @ facet.normal - facet.offset)[:, None] * facet.normal
    assert not bounds(facet, np.concatenate([points, mirrored]), np.zeros(2 * len(points)))


def _crosses(facet: Facet, a: Floats, b: Floats) -> Bools:
    """Whether the segments between points (n, 3) cross the facet's inside."""
    height_a, height_b = (points @ facet.normal - facet.offset for points in (a, b))
    through = height_a * height_b < 0
    share = np.where(through, height_a / np.where(through, height_a - height_b, 1), 0)
    points = a + share[:, None] * (b - a)
    assert np.allclose(dot(points[through], np.array(facet.normal)), facet.offset)
    return through & (depth_inside(facet.corners, points) > 0)
