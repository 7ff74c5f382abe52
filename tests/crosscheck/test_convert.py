from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from drpt import Camera, Diffuse, Mesh, Scene, Sphere, render
from drpt.crosscheck import reference, to_mitsuba
from drpt.kernel.camera import make_camera
from tests.conftest import TYPES, to_device, to_host

if TYPE_CHECKING:
    from drpt.scene import Shape
    from tests.oracle.arrays import Floats

DIRECTION = 1e-6  # of camera rays: some float32 roundings
ORIGIN = 3e-5  # of camera rays: Mitsuba's start at its near plane
SPP = 256

TRIANGLE = [[-1, -1, 0], [1, -1, 0], [0, 1, 0]]  # its front faces +z
FACES = [[0, 1, 2]]
SLANTED = [[0, 0.6, 0.8], [0.6, 0, 0.8], [0, 0, 1]]
INWARD = [[0, 0, -1]] * 3
LIGHT = Sphere((0, 0, 0), 1, radiance=1)


def camera(width: int = 8, height: int = 8, eye: tuple[float, float, float] = (0, 0, 4)) -> Camera:
    return Camera(eye, (0, 0, 0), (0, 1, 0), 40, width, height)


def mean(scene: Scene, bounces: int = 1) -> float:
    return float(reference(scene, SPP, bounces).mean.mean())


@pytest.mark.parametrize(("width", "height"), [(64, 64), (96, 32), (24, 80)])
def test_camera_rays_are_drpts(mi: Any, width: int, height: int) -> None:
    tilted = Camera((3.1, -2.2, 5.3), (0.4, 0.3, -0.2), (0.3, 1, 0.1), 53, width, height)
    pixel = np.arange(width * height)
    offset = np.random.default_rng(0).random((len(pixel), 2)).astype(np.float32)
    ray = make_camera(tilted, np.zeros(3), TYPES).ray(TYPES.UInt32(pixel), to_device(offset))
    film = (np.stack([pixel % width, pixel // width]) + offset.T) / [[width], [height]]
    sensor = to_mitsuba(Scene(tilted, [LIGHT])).sensors()[0]
    theirs, weight = sensor.sample_ray(0.0, 0.5, mi.Point2f(film), mi.Point2f(0.5))
    np.testing.assert_allclose(np.array(theirs.d).T, to_host(ray.direction), rtol=0, atol=DIRECTION)
    np.testing.assert_allclose(np.array(theirs.o).T - tilted.eye, 0, atol=ORIGIN)
    assert np.all(np.array(weight) == 1)


def test_pictures_are_not_mirrored() -> None:
    red_on_the_right = Sphere((1, 0, 0), 0.3, radiance=(1, 0, 0))
    green_on_top = Sphere((0, 0.9, 0), 0.3, radiance=(0, 1, 0))
    scene = Scene(camera(24, 12), [red_on_the_right, green_on_top])
    theirs = reference(scene, SPP, 0).mean
    ours = render(scene, SPP, 0).image
    np.testing.assert_allclose(theirs, ours, rtol=0, atol=0.2)  # 5 σ of a pixel half covered
    assert theirs[:, 12:, 0].sum() > 1
    assert theirs[:, :12, 0].sum() == 0
    assert theirs[:6, :, 1].sum() > 1
    assert theirs[6:, :, 1].sum() == 0


@pytest.mark.parametrize(("eye", "seen"), [((0, 0, 4), True), ((0, 0, -4), False)])
@pytest.mark.parametrize("normals", [None, np.array(INWARD)])
def test_mesh_lights_emit_from_their_front(
    eye: tuple[float, float, float], seen: bool, normals: Floats | None
) -> None:
    scene = Scene(camera(eye=eye), [Mesh(TRIANGLE, FACES, normals, radiance=1)])
    assert (mean(scene) > 0) == seen
    assert render(scene, SPP).image.any() == seen


def test_sphere_lights_emit_outward() -> None:
    inside = Scene(camera(eye=(0, 0, 0.5)), [LIGHT])
    assert mean(inside) == 0
    assert mean(Scene(camera(), [LIGHT])) > 0


def test_lights_reflect_nothing(mi: Any) -> None:
    shapes: list[Shape] = [
        LIGHT,
        Mesh(TRIANGLE, FACES, radiance=1),
        Sphere((3, 0, 0), 1, radiance=0),
    ]
    copies = to_mitsuba(Scene(camera(), shapes)).shapes()
    assert [copy.is_emitter() for copy in copies] == [True, True, False]
    for copy in copies:
        assert not np.array(mi.traverse(copy.bsdf())["reflectance.value"]).any()


def test_normals_are_carried_over(mi: Any) -> None:
    grey = Diffuse(0.5)
    meshes = [Mesh(TRIANGLE, FACES, normals, grey) for normals in (np.array(SLANTED), None)]
    ray = mi.Ray3f([0, 0, 4], [0, 0, -1])
    smooth, flat = (to_mitsuba(Scene(camera(), [mesh])).ray_intersect(ray) for mesh in meshes)
    expected = np.array([0.25, 0.25, 0.5]) @ SLANTED
    expected /= np.linalg.norm(expected)
    np.testing.assert_allclose(np.array(smooth.sh_frame.n).ravel(), expected, atol=DIRECTION)
    for normal in (smooth.n, flat.n, flat.sh_frame.n):
        np.testing.assert_allclose(np.array(normal).ravel(), [0, 0, 1], atol=DIRECTION)


@pytest.mark.parametrize(
    ("light", "eye"),
    [((5, 0, -1), (1, 0, 3)), ((-4, 3, 1), (-4, 0, 1.5))],
    ids=["light from behind the surface", "seen against the shading normal"],
)
def test_mitsuba_ignores_the_geometric_normal(
    light: tuple[float, float, float], eye: tuple[float, float, float]
) -> None:
    """What the documentation of `to_mitsuba` says of interpolated normals."""
    normals = [[0.866, 0, 0.5]] * 3
    surface = Mesh(TRIANGLE, FACES, normals, Diffuse(0.5))
    view = Camera(eye, (0, 0, 0), (0, 1, 0), 1, 4, 4)
    scene = Scene(view, [surface, Sphere(light, 0.5, radiance=1)])
    assert mean(scene) > 1e-3
    assert not render(scene, SPP, 1).image.any()


def test_the_variant_that_is_set_counts(mi: Any) -> None:
    before = mi.variant()
    scene = Scene(camera(2, 2), [LIGHT])
    try:
        mi.set_variant("scalar_rgb")
        assert isinstance(to_mitsuba(scene), mi.Scene)
        reference(scene, 64)
        assert mi.variant() == "scalar_rgb"
        mi.set_variant("scalar_spectral")
        with pytest.raises(ValueError, match="variant: 'scalar_spectral' is not allowed"):
            to_mitsuba(scene)
    finally:
        mi.set_variant(before)
