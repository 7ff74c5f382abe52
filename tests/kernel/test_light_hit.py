"""Lights that a ray runs into, looked for without what else it may meet."""

from __future__ import annotations

from random import Random
from typing import TYPE_CHECKING

import numpy as np
import pytest

import drpt
from drpt.kernel.camera import Ray
from drpt.kernel.intersect import closest_hit, light_hit
from drpt.kernel.launch import make_launcher
from drpt.kernel.spheres import CROWDED_LIMIT
from tests.conftest import TYPES, to_device
from tests.oracle.arrays import normalize, sample_uniform_sphere
from tests.random_scenes import tame_scene

if TYPE_CHECKING:
    from drpt.scene import Shape
    from tests.oracle.arrays import Floats

RAYS = 2**15
OUTLINE = 1e-3  # share of the rays that meet an outline within rounding, at the most
CAMERA = drpt.Camera((0, 0, 9), (0, 0, 0), (0, 1, 0), 40, 8, 8)
DULL = drpt.Diffuse(0.5)
LAMPS = (
    drpt.Sphere((0, 0, 3), 1, radiance=1),
    drpt.Sphere((0, 0.5, 5), 1, radiance=2),
    drpt.Mesh([[-2, -2, 6], [2, -2, 6], [0, 3, 6]], [[0, 2, 1]], radiance=3),
)
SCREEN = drpt.Mesh([[-2, -2, 1.5], [0, -2, 1.5], [-1, 3, 1.5]], [[0, 1, 2]], material=DULL)
BALL = drpt.Sphere((1, 0, 1), 0.7, material=DULL)
MANY = tuple(drpt.Sphere((k % 9 - 4, k // 9 - 4, 3), 0.3, radiance=1) for k in range(CROWDED_LIMIT))
SHAPES: dict[str, tuple[Shape, ...]] = {
    "lamps behind lamps": LAMPS,
    "screen and ball": (*LAMPS, SCREEN, BALL),
    "many": (*MANY, *LAMPS, SCREEN),
    **{f"random {seed}": tame_scene(Random(seed), 8).shapes for seed in range(4)},
}


@pytest.mark.parametrize("name", SHAPES)
def test_it_is_the_closest_hit_where_that_is_a_light(name: str) -> None:
    scene = drpt.Scene(camera=CAMERA, shapes=SHAPES[name])
    tracer = make_launcher(TYPES, scene, 1, drpt.Mode.MIS, "independent", jitter=False).tracer
    device, types = tracer.scene.geometry, tracer.scene.types
    rng = np.random.default_rng(0)
    points = np.concatenate([_extent(shape) for shape in scene.shapes])
    origins = np.einsum(
        "nk,nki->ni", rng.dirichlet(np.ones(3), RAYS), rng.choice(points, (RAYS, 3))
    )
    ways = np.where(
        np.arange(RAYS)[:, None] % 2,
        sample_uniform_sphere(rng, RAYS),
        normalize(rng.choice(points, RAYS) - origins + rng.normal(scale=0.1, size=(RAYS, 3))),
    )
    ray = Ray(types.Array3f(to_device(origins)), types.Array3f(to_device(ways)))
    closest = closest_hit(device, tracer.features, ray, types.Bool(True))
    lit = light_hit(device, tracer.features, ray, types.Bool(True))
    of_light = closest.valid & (closest.primitive >= device.first_light)
    seen, same = np.array(of_light), np.array(lit.valid == of_light)
    assert 0.01 < seen.mean() < 0.99
    assert (~same).mean() < OUTLINE
    both = seen & same
    for a, b in ((lit.primitive, closest.primitive), (lit.front, closest.front)):
        assert (np.array(a) == np.array(b))[both].mean() > 1 - OUTLINE
    np.testing.assert_array_equal(np.array(lit.distance)[both], np.array(closest.distance)[both])


def _extent(shape: Shape) -> Floats:
    """Points of a shape, for rays to be aimed at."""
    if isinstance(shape, drpt.Mesh):
        return np.asarray(shape.vertices)
    center = np.array(shape.center)
    return np.asarray(center + shape.radius * np.concatenate([np.eye(3), -np.eye(3)]))


def test_nothing_is_met_by_rays_that_are_not_there() -> None:
    scene = drpt.Scene(camera=CAMERA, shapes=LAMPS)
    tracer = make_launcher(TYPES, scene, 1, drpt.Mode.MIS, "independent", jitter=False).tracer
    ray = Ray(to_device(np.zeros((4, 3))), to_device(np.array([[0, 0, 1.0]] * 4)))
    there = TYPES.Bool([True, False, True, False])
    hit = light_hit(tracer.scene.geometry, tracer.features, ray, there)
    assert np.array(hit.valid).tolist() == [True, False, True, False]


def test_walls_hide_a_lamp_from_a_camera_outside() -> None:
    shapes = drpt.load_scene("cornell-box").shapes
    for z, shows in ((2000, False), (-2000, True)):
        camera = drpt.Camera((278, 273, z), (278, 450, 180), (0, 1, 0), 20, 8, 8)
        assert drpt.render(drpt.Scene(camera=camera, shapes=shapes), 4, 0).image.any() == shows
