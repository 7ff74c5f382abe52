"""Pixels that one facet fills: what is said to be known is true, and most of what is, is said."""

from __future__ import annotations

from random import Random
from typing import TYPE_CHECKING

import numpy as np
import pytest

import drpt
from benchmarks.bench.scenes import resized
from drpt.kernel.coverage import covering_facets
from drpt.kernel.intersect import UNKNOWN
from drpt.kernel.primitives import make_primitives
from drpt.scene import builtin_names
from tests.oracle import geometry
from tests.oracle.path_tracer import camera_rays
from tests.random_scenes import tame_scene

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy.typing as npt
    from numpy.typing import NDArray

    from drpt.scene import Camera, Shape

SIDE = 64
RAYS = 16
"""Through each pixel."""
CLOSE = 1e-9
"""Of distances in float64, relative."""
SEEDS = [*range(10), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(10, 60))]
GREY = drpt.Diffuse(0.5)
LAMP = drpt.Sphere((0, 50, 0), 1, radiance=1)


class Corners:
    """Numbers at the ends of the unit interval, for points in the corners of pixels."""

    def __init__(self, number: int) -> None:
        self._sides = iter((number % 2, number // 2) if number < 4 else (0.5, 0.5))

    def random(self, count: int) -> NDArray[np.float64]:
        return np.full(count, next(self._sides) * (1 - 2.0**-24))


def known(camera: Camera, shapes: Sequence[Shape]) -> NDArray[np.uint32]:
    """Find the facets that fill pixels; assert that rays through these meet nothing before them."""
    primitives = make_primitives(tuple(shapes))
    facets = covering_facets(camera, primitives)
    rows, columns = np.nonzero(facets != UNKNOWN)
    number = facets[rows, columns]
    planes = np.array([[*facet.normal, facet.offset] for facet in primitives.facets]).reshape(-1, 4)
    rng = np.random.default_rng(1)
    for k in range(RAYS):
        origins, ways = camera_rays(camera, rows, columns, Corners(k) if k < 5 else rng)  # type: ignore[arg-type]
        normal, offset = planes[number, :3], planes[number, 3]
        height = offset - np.einsum("ij,ij->i", normal, origins - primitives.origin)
        t = height / np.einsum("ij,ij->i", normal, ways)
        hits = geometry.closest_hit(shapes, origins, ways)
        np.testing.assert_allclose(hits.t, t, rtol=CLOSE)
        assert (hits.shape == primitives.shape[number]).all()
    return facets


def camera(
    eye: npt.ArrayLike = (0, -5, 0),
    target: npt.ArrayLike = (0, 0, 0),
    *,
    fov: float = 40,
    width: int = SIDE,
) -> Camera:
    return drpt.Camera(np.array(eye), np.array(target), (0, 0, 1), fov, width, SIDE)


def quad(
    corner: npt.ArrayLike, a: npt.ArrayLike, b: npt.ArrayLike, radiance: float | None = None
) -> drpt.Mesh:
    o, u, v = (np.array(vector, float) for vector in (corner, a, b))
    corners, halves = [o, o + u, o + u + v, o + v], [(0, 1, 2), (0, 2, 3)]
    if radiance is None:
        return drpt.Mesh(corners, halves, material=GREY)
    return drpt.Mesh(corners, halves, radiance=radiance)


WALL = quad((-9, 0, -9), (18, 0, 0), (0, 0, 18))
"""In the plane y = 0; it fills the picture."""


def test_a_wall_fills_all_pixels() -> None:
    assert (known(camera(), [WALL, LAMP]) == 0).all()
    assert (known(camera(eye=(0, 5, 0)), [WALL, LAMP]) == 0).all()
    assert (known(camera(target=(1, 0, 2), width=48, fov=50), [WALL, LAMP]) == 0).all()


@pytest.mark.parametrize("name", builtin_names())
def test_built_in_scenes(name: str) -> None:
    scene = resized(drpt.load_scene(name), SIDE)
    known(scene.camera, scene.shapes)


def test_most_pixels_of_the_cornell_box_are_known() -> None:
    scene = drpt.load_scene("cornell-box")
    facets = covering_facets(scene.camera, make_primitives(scene.shapes))
    assert np.mean(facets != UNKNOWN) > 0.93
    assert len(np.unique(facets)) == 1 + 6 + 2 + 3  # unknown; the walls; what is seen of the boxes


@pytest.mark.parametrize("seed", SEEDS)
def test_random_scenes(seed: int) -> None:
    scene = tame_scene(Random(seed), SIDE)
    known(scene.camera, scene.shapes)


@pytest.mark.parametrize("seed", SEEDS)
def test_random_triangles_and_balls(seed: int) -> None:
    """Large and small ones, through each other, flush with each other, and on the eye's plane."""
    rng = np.random.default_rng(seed)
    shapes: list[Shape] = [LAMP]
    for _ in range(rng.integers(1, 12)):
        corners = rng.normal(size=(3, 3)) * 2.0 ** rng.integers(-6, 4)
        corners = np.round(corners, 1) if rng.random() < 0.5 else corners
        if np.linalg.norm(np.cross(corners[1] - corners[0], corners[2] - corners[0])) > 0:
            shapes.append(drpt.Mesh(corners, [(0, 1, 2)], material=GREY))
    shapes += [
        drpt.Sphere(rng.normal(size=3), 2.0 ** rng.integers(-7, 1), material=GREY)
        for _ in range(rng.integers(3))
    ]
    eye = np.round(rng.normal(size=3), 1) * 3
    known(camera(eye, eye + rng.normal(size=3), fov=rng.uniform(5, 120)), shapes)


def test_what_is_smaller_than_a_pixel_is_not_missed() -> None:
    speck = drpt.Sphere((0.001, -1, 0.002), 1e-6, material=GREY)
    needle = drpt.Mesh([(-9, -1, 1), (9, -1, 1), (9, -1, 1.00001)], [(0, 1, 2)], material=GREY)
    for thing, fewest in ((speck, 1), (needle, SIDE)):
        unknown = known(camera(), [WALL, thing, LAMP]) == UNKNOWN
        assert fewest <= unknown.sum() <= 4 * fewest


@pytest.mark.parametrize("above", [0, 1e-7, -1e-7])
def test_a_lamp_flush_with_a_wall_is_not_hidden(above: float) -> None:
    lamp = quad((-1, -above, -1), (2, 0, 0), (0, 0, 2), radiance=1)
    facets = known(camera(), [WALL, lamp]) if above else self_or_unknown(lamp)
    assert facets[SIDE // 2, SIDE // 2] == UNKNOWN
    assert facets[0, 0] == 0


def self_or_unknown(lamp: drpt.Mesh) -> NDArray[np.uint32]:
    """As `known`, but the oracle could not tell which one is met."""
    return covering_facets(camera(), make_primitives((WALL, lamp)))


def test_a_lamp_behind_a_wall_hides_nothing() -> None:
    lamp = quad((-1, 1, -1), (2, 0, 0), (0, 0, 2), radiance=1)
    assert (known(camera(), [lamp, WALL]) == 0).all()


@pytest.mark.parametrize("size", [1e-17, 1e-16, 1e-15, 1e-12, 1e-6])
def test_a_speck_fills_no_pixel(size: float) -> None:
    speck = drpt.Mesh([(0, 0, 0), (size, 0, 0), (0, 0, size)], [(0, 1, 2)], material=GREY)
    wall = quad((-9, 1, -9), (18, 0, 0), (0, 0, 18))
    facets = known(camera((1.3, -5, 0.7)), [speck, wall, LAMP])
    assert (facets != 0).all()
    assert np.mean(facets == 1) > 0.9


@pytest.mark.parametrize("reach", [1e4, 1e5, 1e7])
def test_a_tile_before_the_near_edge_of_a_wide_ground(reach: float) -> None:
    side = 2e-9 * reach
    tile = quad((-side / 2, 0, -side / 2), (side, 0, 0), (0, 0, side))
    ground = quad((-reach, -0.45 * side, 0), (2 * reach, 0, 0), (0, 2 * reach, 0))
    lamp = drpt.Sphere((0, 0, reach / 2), reach / 10, radiance=1)
    view = camera((0, -3 * side, 3 * side), fov=20)
    known(view, [tile, ground, lamp])


def test_what_the_eye_lies_upon_fills_no_pixel() -> None:
    """Where float32 cannot tell on which side the eye is."""
    rng = np.random.default_rng(5)
    for height in (1e-6, 1e-4):
        normal = rng.normal(size=3)
        normal /= np.linalg.norm(normal)
        along = np.cross(normal, (0, 1, 0))
        along /= np.linalg.norm(along)
        ground = quad(20 * normal - 50 * along, 100 * along, 100 * np.cross(normal, along))
        eye = 20 * normal + height * normal
        facets = known(camera(eye, eye + along - 0.3 * normal), [ground, LAMP])
        assert (facets == UNKNOWN).all()


def test_what_is_behind_the_eye_hides_nothing() -> None:
    behind = quad((-1, -6, -1), (2, 0, 0), (0, 0, 2))
    assert (known(camera(), [WALL, behind, LAMP]) == 0).all()


def test_what_reaches_around_the_eye_hides_what_it_does() -> None:
    floor = quad((-9, -20, -1), (18, 0, 0), (0, 20, 0))
    facets = known(camera(), [WALL, floor, LAMP])
    assert (facets[:24] == 0).all()
    assert (facets[-8:] == 1).all()


def test_neighbours_in_a_plane_do_not_hide_each_other() -> None:
    tiles = [quad((x, 0, z), (1, 0, 0), (0, 0, 1)) for x in (-1, 0) for z in (-1, 0)]
    facets = known(camera(fov=20), [*tiles, LAMP])
    assert np.mean(facets == UNKNOWN) < 0.1
    assert set(range(4)) < set(np.unique(facets))


def test_of_an_eye_in_a_plane_or_a_ball() -> None:
    edge_on = quad((-1, -2, 0), (2, 0, 0), (0, 1, 0))
    facets = known(camera(), [WALL, edge_on, LAMP])
    assert (facets[SIDE // 2] == UNKNOWN).any()
    assert (facets[0] == 0).all()
    bubble = drpt.Sphere((0, -5, 0), 1, material=GREY)
    assert (known(camera(), [WALL, bubble, LAMP]) == UNKNOWN).all()


def test_bars_that_hide_each_other_in_a_ring() -> None:
    """No order paints them; all that they touch is unknown, the wall behind them known."""
    bars: list[Shape] = []
    for k in range(3):
        angle = 2 * np.pi * k / 3
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        start, end = turn @ [-1.2, -0.6], turn @ [1.2, -0.6]
        across = turn @ [0.0, 0.2]
        bars.append(
            quad(
                (start[0], -1.2, start[1]),
                (end[0] - start[0], 0.4, end[1] - start[1]),
                (across[0], 0, across[1]),
            )
        )
    facets = known(camera(), [WALL, *bars, LAMP])
    assert set(np.unique(facets)) <= {0, UNKNOWN}
    assert 0.5 < np.mean(facets == 0) < 0.95
