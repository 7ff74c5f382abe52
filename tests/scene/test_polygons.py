from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np
import pytest

from drpt.scene.polygons import BENT, CROSSED, MAX_COMPARED, Triangulation, fan, triangulate

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tests.oracle.arrays import Floats

L_SHAPE = [[2, 0], [2, 1], [1, 1], [1, 2], [0, 2], [0, 0]]
DEGREES = np.pi / 180
ROUNDING = 1e-12  # relative, of areas in float64


def in_space(flat: object, turn: int = 0) -> Floats:
    """Return points of the plane z = 0, or of another plane, of any size and place."""
    points = np.pad(np.array(flat, np.float64), ((0, 0), (0, 1)))
    if turn:
        random = np.random.default_rng(turn)
        axes = np.linalg.qr(random.normal(size=(3, 3)))[0]
        points = (points + random.normal(size=3)) @ axes * 10.0 ** random.integers(-6, 6)
    return points


def cut(points: Floats) -> Triangulation:
    return triangulate(points, np.array([len(points)]))


def normal_of(points: Floats) -> Floats:
    """Return the vector of a polygon's area."""
    area: Floats = np.cross(points - points[0], np.roll(points, -1, axis=0) - points[0]).sum(0) / 2
    return area


def areas(points: Floats, triangles: NDArray[np.int64]) -> Floats:
    """Return each triangle's area, negative if it is turned away from the polygon."""
    a, b, c = points[triangles].swapaxes(0, 1)
    normal = normal_of(points)
    signed: Floats = np.cross(b - a, c - a) @ normal / np.linalg.norm(normal) / 2
    return signed


def assert_cut(points: Floats, count: int, thinnest: float) -> None:
    """Assert that triangles of one side cover a polygon once, and that none is too thin."""
    found = cut(points)
    total = np.linalg.norm(normal_of(points))
    assert found.flaws == {}
    assert len(found.corners) == count
    signed = areas(points, found.corners) / total
    assert signed.min() > thinnest
    np.testing.assert_allclose(signed.sum(), 1, rtol=ROUNDING * len(points))


@pytest.mark.parametrize("turn", range(4))
@pytest.mark.parametrize("first", range(6))
@pytest.mark.parametrize("side", [1, -1])
def test_concave_polygons_in_any_plane(first: int, side: int, turn: int) -> None:
    assert_cut(in_space(np.roll(L_SHAPE, first, axis=0)[::side], turn), 4, 0.1)


@pytest.mark.parametrize("count", [3, 4, 5, 17, 100, 1000])
@pytest.mark.parametrize("turn", range(3))
def test_stars_and_combs_of_up_to_a_thousand_corners(count: int, turn: int) -> None:
    angle = 2 * np.pi * np.arange(count) / count
    radius = 1 + 0.5 * (np.arange(count) % 2)
    star = radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    assert_cut(in_space(star, turn), count - 2, 1e-9)
    teeth = [[i, 5 * (i % 2)] for i in range(count - 2)]
    assert_cut(in_space([*teeth, [count, 9], [-1, 9]], turn), count - 2, 1e-9)


def test_random_polygons_without_intersections() -> None:
    random = np.random.default_rng(0)
    for turn in range(60):
        count = int(random.integers(3, 30))
        angle = np.sort(random.uniform(0, 2 * np.pi, count))
        if np.diff(angle, append=angle[0] + 2 * np.pi).max() > 0.9 * np.pi:
            continue  # the origin is not in it
        star = random.uniform(0.2, 1, count)[:, None] * np.array([np.cos(angle), np.sin(angle)]).T
        assert_cut(in_space(star, turn), count - 2, 0)


@pytest.mark.parametrize("turn", range(3))
@pytest.mark.parametrize("first", range(7))
def test_corners_on_a_line_are_kept(first: int, turn: int) -> None:
    house = [[0, 0], [1, 0], [2, 0], [4, 0], [4, 4], [2, 4], [0, 4]]
    points = in_space(np.roll(house, first, axis=0), turn)
    assert_cut(points, 5, 0.01)
    assert set(cut(points).corners.ravel()) == set(range(7))


def test_repeated_corners_are_left_out() -> None:
    corners = [[0, 0], [0, 0], [2, 0], [2, 1], [1, 1], [1, 1], [1, 1], [1, 2], [0, 2], [0, 0]]
    for first in range(10):
        assert_cut(in_space(np.roll(corners, first, axis=0)), 4, 0.1)


def test_holes_on_a_bridge() -> None:
    outer, inner = [[0, 0], [4, 0], [4, 4], [0, 4]], [[1, 1], [1, 3], [3, 3], [3, 1]]
    ring = in_space([*outer, outer[0], *inner, inner[0]], 3)
    assert_cut(ring, 8, 0.01)


def test_what_is_convex_is_a_fan() -> None:
    angle = 2 * np.pi * np.arange(1000) / 1000
    found = cut(in_space(np.stack([np.cos(angle), np.sin(angle)], axis=1), 1))
    assert found.fanned.all()
    assert np.array_equal(found.corners, fan(1000))
    square = [[0, 0], [1, 0], [1, 1], [0, 1]]
    assert cut(in_space(square)).corners.tolist() == [[0, 1, 2], [2, 3, 0]]


def test_polygons_of_several_sizes_keep_their_order() -> None:
    square = [[0, 0], [1, 0], [1, 1], [0, 1]]
    polygons = [L_SHAPE, square, L_SHAPE[:3], L_SHAPE, square[::-1]]
    points = in_space(np.concatenate(polygons))
    found = triangulate(points, np.array([6, 4, 3, 6, 4]))
    assert found.owners.tolist() == [0] * 4 + [1] * 2 + [2] + [3] * 4 + [4] * 2
    assert found.fanned.tolist() == [False, True, True, False, True]
    a, b, c = points[found.corners].swapaxes(0, 1)
    area = np.bincount(found.owners, np.cross(b - a, c - a)[:, 2] / 2)
    assert area.tolist() == [3, 1, 0.5, 3, -1]


BOW_TIE = [[0, 0], [1, 1], [1, 0], [0, 1]]
PENTAGRAM = [[np.cos(144 * DEGREES * i), np.sin(144 * DEGREES * i)] for i in range(5)]
OVERLAPPING = [[0, 0], [4, 0], [4, 4], [1, 4], [1, 1], [5, 1], [5, 3], [2, 3], [2, 5], [0, 5]]


@pytest.mark.parametrize("turn", range(3))
@pytest.mark.parametrize("flat", [BOW_TIE, PENTAGRAM, OVERLAPPING])
def test_polygons_that_intersect_themselves_are_told(flat: object, turn: int) -> None:
    points = in_space(flat, turn)
    for first in range(len(points)):
        assert cut(np.roll(points, first, axis=0)).flaws == {0: CROSSED}


def test_all_random_quads_that_intersect_themselves_are_told() -> None:
    random = np.random.default_rng(0)
    for _ in range(150):
        points = in_space(random.normal(size=(4, 2)))
        a, b, c, d = points
        crossing = any(
            side(p, q, r) * side(p, q, s) < 0 and side(r, s, p) * side(r, s, q) < 0
            for p, q, r, s in [(a, b, c, d), (b, c, d, a)]
        )
        assert (cut(points).flaws == {0: CROSSED}) == crossing


def side(a: Floats, b: Floats, c: Floats) -> float:
    return float(np.cross(b - a, c - a)[2])


def test_polygons_of_many_corners_are_not_compared_in_pairs() -> None:
    angle = 4 * np.pi * np.arange(2 * MAX_COMPARED + 1) / (2 * MAX_COMPARED + 1)
    twice = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    assert cut(in_space(twice)).flaws == {0: CROSSED}  # by its area


@pytest.mark.parametrize("height", [0.1, 0.3, -0.3, 1.0])
def test_polygons_far_from_planar_are_told(height: float) -> None:
    points = in_space([[0, 0], [1, 0], [1, 1], [0, 1]])
    points[2, 2] = height
    assert cut(points).flaws == ({0: BENT} if abs(height) > 0.2 else {})
    assert cut(points).fanned.all()


@pytest.mark.parametrize("value", [0.0, 1e-300, 1e300, np.nan, np.inf])
@pytest.mark.parametrize("count", [3, 4, 6])
def test_what_has_no_area_or_is_not_finite_is_a_fan(count: int, value: float) -> None:
    with warnings.catch_warnings(action="error"):
        points = np.full((count, 3), value)
        assert np.array_equal(cut(points).corners, fan(count))
        points[1] = 0
        assert np.array_equal(cut(points).corners, fan(count))
        line = np.arange(count)[:, None] * np.array([1.0, 2, 3])
        assert np.array_equal(cut(line).corners, fan(count))
