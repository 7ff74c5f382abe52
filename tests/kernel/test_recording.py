"""Recorded paths: the same samples, vertex by vertex, at points where they can be."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

import drpt
from drpt.kernel.recording import NONE, Vertices

if TYPE_CHECKING:
    from drpt.scene import Shape

COUNT = 24
# A path's contributions add up in float64 here, in float32 in the kernel.
SUMMATION = 2e-6
# Of float32 coordinates up to 1000, some operations long.
ROUNDING = 2e-3


def recorded(scene: drpt.Scene, mode: str) -> Vertices:
    column, row = scene.camera.width // 2, 2 * scene.camera.height // 3
    return drpt.Rendering(scene, mode=mode).vertices(column, row, COUNT)


@pytest.mark.parametrize("mode", drpt.Mode)
@pytest.mark.parametrize(
    ("name", "spp", "bounces"),
    [
        ("cornell-box", 16, 3),
        ("cornell-box", 128, 2),  # paths share their camera rays
        pytest.param("many-lights", 64, 3, marks=pytest.mark.slow),
        pytest.param("cornell-box-glossy", 64, 5, marks=pytest.mark.slow),
        pytest.param("spheres", 64, 6, marks=pytest.mark.slow),
        pytest.param("veach", 64, 0, marks=pytest.mark.slow),
    ],
)
def test_contributions_add_up_to_the_sample(name: str, spp: int, bounces: int, mode: str) -> None:
    scene = drpt.load_scene(name)
    column, row = scene.camera.width // 2, 2 * scene.camera.height // 3
    rendering = drpt.Rendering(scene, spp, bounces, mode)
    first = 5
    totals = rendering.vertices(column, row, COUNT // 4, first).contribution.sum(axis=0)
    samples = [rendering.sample(column, row, first + k) for k in range(COUNT // 4)]
    assert totals == pytest.approx(np.array(samples), rel=SUMMATION)


def test_vertices_follow_each_other_along_their_rays() -> None:
    scene = drpt.load_scene("cornell-box")
    found = recorded(scene, "implicit")
    starts = np.concatenate(
        [np.broadcast_to(scene.camera.eye, found.point[:1].shape), found.point[:-1]]
    )
    met = found.reached & (found.shape != NONE)
    ways = (found.point - starts)[met]
    ways /= np.linalg.norm(ways, axis=-1, keepdims=True)
    assert ways == pytest.approx(found.direction[met], abs=ROUNDING)


def test_a_path_that_ended_stays_ended_and_adds_nothing() -> None:
    found = recorded(drpt.load_scene("spheres"), "mis")
    assert found.reached[0].all()
    assert not (found.reached[1:] & ~found.reached[:-1]).any()
    ended = ~found.reached | (found.shape == NONE)
    assert ended.any()
    assert not found.contribution[ended].any()


def test_light_that_arrives_was_not_blocked() -> None:
    scene = drpt.load_scene("cornell-box")
    found = drpt.Rendering(scene, mode="explicit").vertices(90, 230, COUNT)  # beside the small box
    lamp = next(n for n, shape in enumerate(scene.shapes) if shape.is_light)
    looked = found.light_shape != NONE
    assert set(found.light_shape[looked]) == {lamp}
    sphere = scene.shapes[lamp]
    assert isinstance(sphere, drpt.Sphere)
    away = np.linalg.norm(found.light_point[looked] - sphere.center, axis=-1)
    assert away == pytest.approx(sphere.radius, abs=10 * ROUNDING)
    arrived = looked & (found.contribution.max(axis=-1) > 0)
    assert 0 < arrived.sum() < looked.sum()


def test_shapes_are_those_of_the_scene() -> None:
    """Their order here is none of the orders that kernels have."""
    wall = drpt.Mesh(
        [[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]],
        [[0, 1, 2], [0, 2, 3]],
        material=drpt.Diffuse(0.5),
    )
    shapes: list[Shape] = [
        drpt.Sphere((3, 3, 6), 0.5, radiance=9),
        drpt.Sphere((0, 0, 2), 1, material=drpt.Phong(0.5, 9)),
        wall,
    ]
    camera = drpt.Camera((0, 0, 9), (0, 0, 0), (0, 1, 0), 60, 9, 9)
    rendering = drpt.Rendering(drpt.Scene(camera=camera, shapes=shapes), 16, 2)
    assert set(rendering.vertices(4, 4, 16).shape[0]) == {1}
    assert set(rendering.vertices(0, 4, 16).shape[0]) == {2}
    assert set(rendering.vertices(0, 4, 16).light_shape[0]) == {0}


def test_a_scene_without_light_has_no_vertices() -> None:
    dark = drpt.Sphere((0, 0, 0), 1, material=drpt.Diffuse(0.5))
    camera = drpt.Camera((0, 0, 9), (0, 0, 0), (0, 1, 0), 60, 9, 9)
    found = drpt.Rendering(drpt.Scene(camera=camera, shapes=[dark])).vertices(4, 4, 3)
    assert found.reached.shape == (0, 3)
    assert found.point.shape == (0, 3, 3)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((9, 0, 1), "column: 9 is not allowed; it must be a whole number from 0 to 8"),
        ((0, -1, 1), "row: -1 is not allowed"),
        ((0, 0, 0), "count: 0 is not allowed; it must be a whole number from 1 to 64"),
        ((0, 0, 1, 64), "first: 64 is not allowed; it must be a whole number from 0 to 63"),
        ((0, 0, 2, 63), "count: 2 is not allowed; it must be a whole number from 1 to 1"),
    ],
)
def test_what_is_out_of_range_is_named(arguments: tuple[int, ...], words: str) -> None:
    camera = drpt.Camera((0, 0, 9), (0, 0, 0), (0, 1, 0), 60, 9, 9)
    scene = drpt.Scene(camera=camera, shapes=[drpt.Sphere((0, 0, 0), 1, radiance=1)])
    with pytest.raises(ValueError, match=words):
        drpt.Rendering(scene).vertices(*arguments)
