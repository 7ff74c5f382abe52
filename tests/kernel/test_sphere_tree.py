"""The tree of many spheres: its order, its boxes, and walks against all spheres one by one."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import drjit as dr
import numpy as np
import pytest

import drpt
from drpt.kernel.camera import Ray
from drpt.kernel.estimator import Mode
from drpt.kernel.intersect import closest_hit, occluded
from drpt.kernel.launch import make_launcher
from drpt.kernel.primitives import SPHERE_LIMIT
from drpt.kernel.sphere_tree import arrange, boxes_around
from tests.conftest import TYPES, to_device, to_host
from tests.oracle.arrays import normalize, sample_uniform_sphere

if TYPE_CHECKING:
    from tests.oracle.arrays import Bools, Floats, Ints

RAYS = 2**13
# How close to an outline a ray may be told otherwise than in float64, in units of the scene.
OUTLINE = 1e-5


@pytest.mark.parametrize("count", [1, 2, 64, 1024])
def test_an_order_has_every_point_once_and_halves_apart(count: int) -> None:
    points = np.random.default_rng(1).random((count, 3)) * (1, 99, 0.1)
    order = arrange(points)
    assert sorted(order) == [*range(count)]
    if count > 1:
        left, right = np.split(points[order], 2)
        assert left[:, 1].max() < right[:, 1].min()  # the longest side is cut at the median


def test_boxes_hold_what_is_below_them() -> None:
    rng = np.random.default_rng(2)
    spheres = np.column_stack([rng.normal(size=(16, 3)), rng.random(16)])
    spheres[13:] = np.nan
    boxes = boxes_around(spheres)
    assert len(boxes) == 32
    for node in range(1, 16):
        below = boxes[[2 * node, 2 * node + 1]]
        assert (boxes[node, :3] == below[:, :3].min(axis=0)).all()
        assert (boxes[node, 3:] == below[:, 3:].max(axis=0)).all()
    inside = spheres[:13]
    assert (boxes[16:29, :3] < inside[:, :3] - inside[:, 3:]).all()
    assert (boxes[16:29, 3:] > inside[:, :3] + inside[:, 3:]).all()
    assert (boxes[29:, :3] > boxes[29:, 3:]).all()


class Balls:
    """Spheres, the last few of which are lights, on the device and in float64."""

    def __init__(self, count: int, *, lights: int = 5, same: bool = False) -> None:
        rng = np.random.default_rng(count)
        self.centers = rng.uniform(-1, 1, (count, 3)).astype(np.float32).astype(np.float64)
        self.radii = (0.5 / count ** (1 / 3) * rng.uniform(0.2, 1, count)).astype(np.float32)
        if same:
            self.centers[:], self.radii[:] = self.centers[0], 0.5
        dull = drpt.Diffuse(0.5)
        shapes = [
            drpt.Sphere(center, float(radius), radiance=1 + i)
            if i >= count - lights
            else drpt.Sphere(center, float(radius), material=dull)
            for i, (center, radius) in enumerate(zip(self.centers, self.radii, strict=True))
        ]
        scene = drpt.Scene(drpt.Camera((0, 0, 9), (0, 0, 0), (0, 1, 0), 40, 8, 8), shapes)
        launcher = make_launcher(TYPES, scene, 1, Mode.MIS, "independent", jitter=False)
        self.scene, self.features = launcher.tracer.scene, launcher.tracer.features
        assert self.scene.sphere_tree is not None

    def closest(self, origins: Floats, directions: Floats) -> tuple[Ints, Floats]:
        ray = Ray(to_device(origins), to_device(directions))
        hit = closest_hit(self.scene, self.features, ray, TYPES.Bool(True))
        dr.eval(hit)
        distance = np.where(np.array(hit.valid), to_host(hit.distance), np.inf)
        return np.where(np.isinf(distance), -1, np.array(hit.primitive, np.int64)), distance

    def truth(self, origins: Floats, directions: Floats) -> tuple[Ints, Floats, Bools]:
        """Closest sphere, where it is met, and whether the ray keeps off all outlines."""
        to_center = self.centers - origins[:, None]
        along = np.einsum("rsk,rk->rs", to_center, directions)
        aside = np.linalg.norm(to_center - along[..., None] * directions[:, None], axis=2)
        half = np.sqrt(np.maximum(self.radii**2 - aside**2, 0))
        inner = along - half > 0
        t = np.where(inner, along - half, along + half)
        t = np.where((aside < self.radii) & (t > 0), t, np.inf)
        sure = (np.abs(aside - self.radii) > OUTLINE).all(axis=1)
        sure &= (np.abs(np.linalg.norm(to_center, axis=2) - self.radii) > OUTLINE).all(axis=1)
        return np.where(np.isinf(t.min(axis=1)), -1, t.argmin(axis=1)), t.min(axis=1), sure


def rays(around: float) -> tuple[Floats, Floats]:
    rng = np.random.default_rng(3)
    origins = rng.uniform(-around, around, (RAYS, 3)).astype(np.float32).astype(np.float64)
    directions = normalize(rng.uniform(-1, 1, (RAYS, 3)) - origins)
    directions[: RAYS // 4] = np.eye(3)[rng.integers(0, 3, RAYS // 4)]
    directions[: RAYS // 4] *= rng.choice([-1.0, 1.0], (RAYS // 4, 3))  # with zeros of both signs
    return origins, directions


@pytest.mark.parametrize("around", [1.0, 5.0])
@pytest.mark.parametrize("count", [SPHERE_LIMIT + 1, pytest.param(500, marks=pytest.mark.slow)])
def test_closest_hits_are_those_of_all_spheres(count: int, around: float) -> None:
    balls, (origins, directions) = Balls(count), rays(around)
    number, distance = balls.closest(origins, directions)
    expected, t, sure = balls.truth(origins, directions)
    assert sure.mean() > 0.95
    assert (expected >= 0).mean() > 0.02
    assert np.array_equal(number[sure], expected[sure])
    hit = sure & (expected >= 0)
    assert distance[hit] == pytest.approx(t[hit], abs=OUTLINE)


@pytest.mark.parametrize("count", [SPHERE_LIMIT + 1, pytest.param(500, marks=pytest.mark.slow)])
def test_shadows_are_those_of_all_spheres_but_the_light(count: int) -> None:
    balls, (origins, _) = Balls(count), rays(1.0)
    for light in (0, 4):
        target = count - 5 + light
        way = balls.centers[target] - origins
        distance = np.linalg.norm(way, axis=1)
        directions, distance = way / distance[:, None], distance - balls.radii[target]
        blocked = occluded(
            balls.scene,
            Ray(to_device(origins), to_device(directions)),
            to_device(distance),
            TYPES.UInt32(light),
            TYPES.Bool(True),
        )
        expected, t, sure = balls.truth(origins, directions)
        sure &= (distance > 0) & (np.abs(t - distance) > OUTLINE)
        sure |= (distance > 0) & (expected == target)
        assert sure.mean() > 0.5
        assert np.array_equal(np.array(blocked)[sure], (t < distance - OUTLINE)[sure])


def test_of_coincident_spheres_the_last_one_counts() -> None:
    balls = Balls(SPHERE_LIMIT + 9, lights=1, same=True)
    origins = balls.centers[0] + 3 * sample_uniform_sphere(np.random.default_rng(4), 64)
    number, _ = balls.closest(origins, (balls.centers[0] - origins) / 3)
    assert (number == SPHERE_LIMIT + 8).all()


@pytest.mark.slow
def test_pictures_of_many_spheres_are_lit() -> None:
    rng, count = np.random.default_rng(5), 3000
    centers = rng.uniform(-1, 1, (count, 3))
    shapes: list[Any] = [
        drpt.Sphere(c, 0.02, radiance=3) if i % 3 else drpt.Sphere(c, 0.02, drpt.Diffuse(0.7))
        for i, c in enumerate(centers)
    ]
    camera = drpt.Camera((0, 0, 6), (0, 0, 0), (0, 1, 0), 20, 32, 32)
    means = [
        drpt.render(drpt.Scene(camera, shapes), 64, 2, mode).image.mean()
        for mode in ("implicit", "mis")
    ]
    assert means[0] == pytest.approx(means[1], rel=0.02)
