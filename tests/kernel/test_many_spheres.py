"""Walks through many spheres, in a grid and in a tree, against all spheres one by one."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import drjit as dr
import numpy as np
import pytest

import drpt
from drpt.kernel.camera import Ray
from drpt.kernel.estimator import Mode
from drpt.kernel.intersect import closest_hit, occluded
from drpt.kernel.launch import forget, make_launcher, prepare
from drpt.kernel.sphere_grid import SphereGrid
from drpt.kernel.sphere_tree import SphereTree
from drpt.kernel.spheres import CROWDED_LIMIT
from tests.conftest import TYPES, to_device, to_host
from tests.oracle.arrays import normalize, sample_uniform_sphere

if TYPE_CHECKING:
    from tests.oracle.arrays import Bools, Floats, Ints

RAYS = 2**13
# How close to an outline a ray may be told otherwise than in float64, in units of the scene.
OUTLINE = 1e-5


@pytest.fixture(params=[SphereGrid, SphereTree])
def hierarchy(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> type:
    """What spheres are in: a tree where no crowd is small enough for a grid."""
    kind: type = request.param
    monkeypatch.setattr("drpt.kernel.spheres.CROWD", 0 if kind is SphereTree else np.inf)
    return kind


class Balls:
    """Spheres, the last few of which are lights, on the device and in float64."""

    def __init__(self, count: int, *, lights: int = 5, same: bool = False) -> None:
        rng = np.random.default_rng(count)
        self.centers = rng.uniform(-1, 1, (count, 3)).astype(np.float32).astype(np.float64)
        self.radii = (0.5 / count ** (1 / 3) * rng.uniform(0.2, 1, count)).astype(np.float32)
        if same:  # but for the lights, which would cover them
            self.centers[: count - lights], self.radii[:] = self.centers[0], 0.5
            self.centers[count - lights :] = self.centers[0] + (4, 0, 0)
        dull = drpt.Diffuse(0.5)
        shapes = [
            drpt.Sphere(center, float(radius), radiance=1 + i)
            if i >= count - lights
            else drpt.Sphere(center, float(radius), material=dull)
            for i, (center, radius) in enumerate(zip(self.centers, self.radii, strict=True))
        ]
        scene = drpt.Scene(drpt.Camera((0, 0, 9), (0, 0, 0), (0, 1, 0), 40, 8, 8), shapes)
        launcher = make_launcher(TYPES, scene, 1, Mode.MIS, "independent", jitter=False)
        self.scene, self.features = launcher.tracer.scene.geometry, launcher.tracer.features
        self.hierarchy = type(self.scene.many_spheres)

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
@pytest.mark.parametrize("count", [CROWDED_LIMIT + 1, pytest.param(500, marks=pytest.mark.slow)])
def test_closest_hits_are_those_of_all_spheres(hierarchy: type, count: int, around: float) -> None:
    balls, (origins, directions) = Balls(count), rays(around)
    assert balls.hierarchy is hierarchy
    number, distance = balls.closest(origins, directions)
    expected, t, sure = balls.truth(origins, directions)
    assert sure.mean() > 0.95
    assert (expected >= 0).mean() > 0.02
    assert np.array_equal(number[sure], expected[sure])
    hit = sure & (expected >= 0)
    assert distance[hit] == pytest.approx(t[hit], abs=OUTLINE)


@pytest.mark.parametrize("count", [CROWDED_LIMIT + 1, pytest.param(500, marks=pytest.mark.slow)])
def test_shadows_are_those_of_all_spheres_but_the_light(hierarchy: type, count: int) -> None:
    balls, (origins, _) = Balls(count), rays(1.0)
    assert balls.hierarchy is hierarchy
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


def test_of_coincident_spheres_the_last_one_counts(
    hierarchy: type, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("drpt.kernel.cells.SHARES", np.inf)
    balls = Balls(CROWDED_LIMIT + 9, lights=1, same=True)
    assert balls.hierarchy is hierarchy
    origins = balls.centers[0] + 3 * sample_uniform_sphere(np.random.default_rng(4), 64)
    number, _ = balls.closest(origins, (balls.centers[0] - origins) / 3)
    assert (number == CROWDED_LIMIT + 7).all()


def test_from_afar_nothing_is_lost_where_cells_meet() -> None:
    """The spheres of a plane are discs, and whole, also from 10⁴ times its side away."""
    k = np.arange(-8, 9)
    centers = np.array(np.meshgrid(k, k, [0.0])).reshape(3, -1).T
    shapes = [drpt.Sphere(tuple(center), 0.3, radiance=1) for center in centers.tolist()]
    camera = drpt.Camera((0, 0, 2e5), (0, 0, 0), (0, 1, 0), np.degrees(17 / 2e5), 1700, 1700)
    assert isinstance(prepare(tuple(shapes), TYPES)[1].geometry.many_spheres, SphereGrid)
    image = drpt.render(drpt.Scene(camera, shapes), 1, 0, "implicit").image[..., 0]
    assert image.mean() == pytest.approx(np.pi * 0.3**2, rel=2e-3)


@pytest.mark.parametrize("distance", [1e3, 1e6, 1e9, 1e12, 1e13, 1e15, 1e18])
def test_walks_from_afar_stay_in_the_grid(distance: float) -> None:
    """Where a ray cannot be told to meet a grid, it meets nothing, or a sphere of it."""
    balls, rng = Balls(500), np.random.default_rng(8)
    ways = sample_uniform_sphere(rng, RAYS)
    aims = balls.centers[rng.integers(0, 500, RAYS)]
    number, t = balls.closest(aims - distance * ways, ways)
    hit = number >= 0
    assert hit.all() if distance < 1e4 else (number < 500).all()
    assert t[hit] == pytest.approx(distance, abs=4, rel=1e-5)


@pytest.mark.parametrize("distance", [4, 1e3, 1e6])
@pytest.mark.parametrize("off", [0, 900])
def test_a_grid_gives_the_bits_of_a_tree(
    off: float, distance: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also far from the origin, and seen from afar: spheres are met by the same arithmetic."""
    rng = np.random.default_rng(9)
    shapes = [drpt.Sphere(off + center, 0.02, radiance=1) for center in rng.uniform(0, 1, (500, 3))]
    shapes.append(drpt.Sphere((-off, -off, -off - 1), 0.5, drpt.Diffuse(0.5)))
    middle = off + 0.5
    eye, target = (middle, middle, off + distance), (middle, middle, middle)
    camera = drpt.Camera(eye, target, (0, 1, 0), float(np.degrees(1.5 / distance)), 128, 128)
    scene = drpt.Scene(camera, shapes)
    images = []
    for crowd in (np.inf, 0):
        monkeypatch.setattr("drpt.kernel.spheres.CROWD", crowd)
        forget()
        images.append(drpt.render(scene, 16, 2, "mis").image)
    forget()
    assert images[0].mean() > 0.05
    assert np.array_equal(images[0], images[1])


def test_walks_end_whatever_a_ray_is() -> None:
    """Also those of rays that are not numbers, run along the cells' sides, or start at infinity."""
    balls = Balls(CROWDED_LIMIT + 1)
    low = balls.centers.min(axis=0)
    odd = [np.nan, np.inf, -np.inf, 0.0, -0.0, 1.0, 1e38, 1e-38, *low]
    numbers = np.array(np.meshgrid(*3 * [odd])).reshape(3, -1).T
    for origins in (numbers, np.broadcast_to(low, numbers.shape)):
        ray = Ray(to_device(origins), to_device(numbers[::-1]))
        hit = closest_hit(balls.scene, balls.features, ray, TYPES.Bool(True))
        dr.eval(hit)
    number, _ = balls.closest(np.full((1, 3), np.nan), np.full((1, 3), np.nan))
    assert number == -1


@pytest.mark.slow
def test_pictures_of_many_spheres_are_lit(hierarchy: type) -> None:
    rng, count = np.random.default_rng(5), 3000
    centers = rng.uniform(-1, 1, (count, 3))
    shapes: list[Any] = [
        drpt.Sphere(c, 0.02, radiance=3) if i % 3 else drpt.Sphere(c, 0.02, drpt.Diffuse(0.7))
        for i, c in enumerate(centers)
    ]
    camera = drpt.Camera((0, 0, 6), (0, 0, 0), (0, 1, 0), 20, 32, 32)
    assert isinstance(prepare(tuple(shapes), TYPES)[1].geometry.many_spheres, hierarchy)
    means = [
        drpt.render(drpt.Scene(camera, shapes), 64, 2, mode).image.mean()
        for mode in ("implicit", "mis")
    ]
    assert means[0] == pytest.approx(means[1], rel=0.02)
