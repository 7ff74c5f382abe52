"""Rays that come to spheres from afar, however the spheres are laid out, against float64."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import drjit as dr
import numpy as np
import pytest

import drpt
from drpt.kernel.camera import Ray
from drpt.kernel.estimator import Mode
from drpt.kernel.first_hit import first_hits
from drpt.kernel.intersect import closest_hit, occluded
from drpt.kernel.launch import make_launcher
from drpt.kernel.sphere_grid import SphereGrid
from drpt.kernel.sphere_tree import SphereTree
from drpt.scene.builtin import builtin_names
from tests.conftest import TYPES, to_device, to_host

if TYPE_CHECKING:
    from drpt.kernel.launch import Launcher
    from tests.oracle.arrays import Bools, Floats

RADIUS = 2.0**-10
# In radii; coordinates of a scene are 1e9 at the most.
DISTANCES = (7e4, 1e7, 1e9)
# Distance from the outline, in radii, within which float32 may decide otherwise than float64.
OUTLINE = 1e-5
# Error of a normal: near the outline it is off by the square root of `OUTLINE`.
NORMAL = 4e-3
RAYS = 2**12
COMPANIONS = 100
DULL = drpt.Diffuse(0.5)


def with_radiance(center: tuple[float, float, float], radiance: float | None) -> drpt.Sphere:
    if radiance is None:
        return drpt.Sphere(center, RADIUS, material=DULL)
    return drpt.Sphere(center, RADIUS, radiance=radiance)


class World:
    """A sphere at the origin, by itself or with others aside of it, and a camera far away."""

    def __init__(self, away: float, layout: type | None, radiance: float | None) -> None:
        far = away * RADIUS
        ring = 2 * np.pi * np.arange(COMPANIONS if layout else 1) / COMPANIONS
        aside = far * np.stack([np.cos(ring), np.sin(ring), 0.1 * np.sin(5 * ring)], axis=1) / 2
        if layout is SphereTree:
            aside = (0.5 * far, 0, 0) + aside / far * RADIUS
        shapes = [with_radiance((0, 0, 0), radiance)]
        shapes += [with_radiance(tuple(center), 1) for center in aside.tolist()]
        camera = drpt.Camera((0, 0, far), (0, 0, 0), (0, 1, 0), 1, 8, 8)
        launcher = make_launcher(
            TYPES, drpt.Scene(camera, shapes), 1, Mode.MIS, "independent", jitter=False
        )
        assert not launcher.primitives.origin.any()
        assert isinstance(launcher.tracer.scene.geometry.many_spheres, layout or type(None))
        self.far, self.number = far, launcher.tracer.scene.geometry.first_sphere
        self.scene, self.features = launcher.tracer.scene.geometry, launcher.tracer.features


# A rotation that leaves no coordinate of a ray 0.
ASKEW = np.array([[0.48, 0.64, -0.6], [-0.8, 0.6, 0.0], [0.36, 0.48, 0.8]])


class Rays(NamedTuple):
    """Rays as float32 has them, and where they pass the origin.

    They come about along the z axis, where it tells all of them apart, or askew.
    """

    origins: Floats
    directions: Floats
    aside: Floats

    @classmethod
    def past_the_origin(cls, far: float, axes: Floats | None = None) -> Rays:
        rng = np.random.default_rng(0)
        near, there = rng.uniform(-1.2 * RADIUS, 1.2 * RADIUS, (2, RAYS, 2))
        axes = np.eye(3) if axes is None else axes
        origins = _rounded(np.column_stack([there, np.full(RAYS, far)]) @ axes)
        ways = np.column_stack([near - there, np.full(RAYS, -far)]) @ axes
        directions = _rounded(ways / np.linalg.norm(ways, axis=1, keepdims=True))
        along = np.einsum("ij,ij->i", origins, directions)[:, None]
        length = np.einsum("ij,ij->i", directions, directions)[:, None]
        return cls(origins, directions, (origins - along / length * directions) / RADIUS)

    @property
    def sure(self) -> Bools:
        return np.asarray(np.abs(np.linalg.norm(self.aside, axis=1) - 1) > OUTLINE)

    @property
    def meets(self) -> Bools:
        return np.asarray(np.linalg.norm(self.aside, axis=1) < 1)

    @property
    def normals(self) -> Floats:
        height = np.sqrt(np.maximum(1 - np.square(self.aside).sum(axis=1, keepdims=True), 0))
        return np.asarray(self.aside - height * self.directions)

    def on_device(self) -> Ray:
        return Ray(to_device(self.origins), to_device(self.directions))


def _rounded(numbers: Floats) -> Floats:
    return numbers.astype(np.float32).astype(np.float64)


LAYOUTS = pytest.mark.parametrize("layout", [None, SphereGrid, SphereTree])


@pytest.mark.parametrize("away", DISTANCES)
@pytest.mark.parametrize("radiance", [None, 1.0])
@LAYOUTS
def test_a_sphere_is_whole_and_faces_the_ray(
    layout: type | None, radiance: float | None, away: float
) -> None:
    world = World(away, layout, radiance)
    rays = Rays.past_the_origin(world.far)
    hit = closest_hit(world.scene, world.features, rays.on_device(), TYPES.Bool(True))
    dr.eval(hit)
    sure, meets = rays.sure, rays.meets
    assert 0.4 < meets.mean() < 0.7
    assert sure.mean() > 0.99
    assert np.array_equal(np.array(hit.valid)[sure], meets[sure])
    met = sure & meets
    assert (np.array(hit.primitive)[met] == world.number).all()
    assert np.array(hit.front)[met].all()
    assert np.abs(to_host(hit.normal) - rays.normals)[met].max() < NORMAL


@LAYOUTS
def test_a_sphere_casts_its_shadow(layout: type | None) -> None:
    """Also where the directions are no unit vectors, by their rounding."""
    world = World(1e7, layout, None)
    rays = Rays.past_the_origin(world.far, ASKEW)
    distance = TYPES.Float32(1.9 * world.far)
    blocked = occluded(world.scene, rays.on_device(), distance, TYPES.UInt32(0), TYPES.Bool(True))
    assert np.array_equal(np.array(blocked)[rays.sure], rays.meets[rays.sure])


def test_from_within_a_sphere_its_back_is_seen() -> None:
    """The kernel handles distant rays because of another sphere, 1e5 times as small."""
    shapes = [drpt.Sphere((0, 0, 0), 1, material=DULL), drpt.Sphere((0, 0, 0.5), 1e-5, radiance=1)]
    camera = drpt.Camera((0.2, 0.1, 0), (0, 0, 0.5), (0, 1, 0), 90, 32, 32)
    layers = first_hits(TYPES, drpt.Scene(camera, shapes), 1, jitter=False)
    points = np.array(camera.eye) + ways(camera) * layers["depth"][..., None]
    assert np.linalg.norm(points, axis=-1) == pytest.approx(1, abs=1e-5)
    assert np.abs(layers["normal"] + points).max() < 1e-5


def ways(camera: drpt.Camera) -> Floats:
    """From the eye through each pixel's centre, one unit ahead."""
    from drpt.scene.picture_plane import picture_plane

    plane = picture_plane(camera)
    y, x = np.mgrid[: camera.height, : camera.width] + 0.5
    return np.asarray(plane.corner + x[..., None] * plane.right + y[..., None] * plane.down)


@pytest.mark.parametrize("away", [10, 1e3, 1e4, 1e8])
def test_a_sphere_on_the_origin_is_seen_from_afar(away: float) -> None:
    """A sphere whose surface has the kernel's origin uses other arithmetic for near rays."""
    center = np.array([0.0, 1.0, 0.0])
    fov = float(np.degrees(2 * np.arctan(2 / away)))
    camera = drpt.Camera((0, 1, away), center, (0, 1, 0), fov, 64, 64)
    image = drpt.render(drpt.Scene(camera, [drpt.Sphere(center, 1, radiance=1)]), 16, 0).image
    seen = np.pi * np.tan(np.arcsin(1 / away)) ** 2 / (4 / away) ** 2
    assert image.mean() == pytest.approx(seen, rel=1e-3)


def launcher_of(name: str) -> Launcher:
    return drpt.Rendering(drpt.load_scene(name)).launcher


def test_kernels_of_plain_scenes_have_nothing_of_it() -> None:
    assert not any(launcher_of(name).tracer.scene.geometry.afar for name in builtin_names())
