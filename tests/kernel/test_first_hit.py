"""First hits against closed forms, against the render's own samples, and against Mitsuba."""

from __future__ import annotations

from math import radians, tan
from typing import TYPE_CHECKING, Any

import drjit as dr
import numpy as np
import pytest

import drpt
from drpt.crosscheck import to_mitsuba
from drpt.kernel import first_hit
from drpt.kernel.first_hit import first_hits
from tests.conftest import TYPES
from tests.oracle.arrays import dot, normalize

if TYPE_CHECKING:
    from drpt.scene import Camera, Material, Scene, Shape
    from tests.oracle.arrays import Floats

# Float32 positions, relative to scenes of some units; on a sphere they are normals, too.
ROUNDING = 2e-5
# Means of 1024 independent samples of Mitsuba's against 256 Sobol' points, relative to the step at
# an edge: five standard errors of a pixel that is half covered.
EDGE = 5 * 0.5 / 32
# Depths of the same samples, relative: five standard errors of a pixel of the side walls, which
# are 45 deep. Distances from the eye would be off by up to 0.12.
DEPTH = 3e-3

GREEN = (0.2, 0.8, 0.4)
EYE = np.array([0.5, 1, 6])


def camera(
    eye: Any = tuple(EYE), target: Any = (0.5, 1, 0), fov: float = 40, side: int = 15
) -> Camera:
    return drpt.Camera(eye, target, (0, 1, 0), fov, side, side)


def centres(camera: Camera) -> Floats:
    """Directions (height, width, 3) through the centres of pixels, of depth 1; −z is ahead."""
    half = tan(radians(camera.fov / 2))
    across = (np.arange(camera.width) + 0.5) / camera.width * 2 - 1
    x, y = np.meshgrid(half * across, -half * across)
    return np.stack([x, y, np.full_like(x, -1)], axis=-1)


def at_centres(scene: Scene) -> dict[str, Any]:
    return first_hits(TYPES, scene, 1, jitter=False)


def quad(*corners: Any, **surface: Any) -> drpt.Mesh:
    return drpt.Mesh(corners, [[0, 1, 2], [0, 2, 3]], **surface)


@pytest.mark.parametrize(
    ("surface", "albedo"),
    [
        ({"material": drpt.Diffuse(GREEN)}, GREEN),
        ({"material": drpt.Phong(GREEN, 30)}, GREEN),
        ({"radiance": (7, 2, 0)}, (1, 1, 1)),
        ({"radiance": 0}, (0, 0, 0)),
    ],
    ids=["diffuse", "phong", "light", "black"],
)
def test_a_sphere(surface: dict[str, Any], albedo: tuple[float, ...]) -> None:
    center, radius = np.array([0.4, 1.6, 0.3]), 1.2
    found = at_centres(drpt.Scene(camera(), [drpt.Sphere(center, radius, **surface)]))
    through = centres(camera())
    # |EYE + z through − center| = radius, at the nearer root
    a, b = dot(through, through), dot(through, EYE - center)
    root = b**2 - a * (dot(EYE - center, EYE - center) - radius**2)
    hit = root > 0
    assert 30 < hit.sum() < hit.size - 30
    depth = np.where(hit, (-b - np.sqrt(np.maximum(root, 0))) / a, np.inf)
    normal = (EYE + np.where(hit, depth, 0)[..., None] * through - center) / radius
    np.testing.assert_allclose(found["depth"], depth, rtol=ROUNDING)
    np.testing.assert_allclose(found["normal"], np.where(hit[..., None], normal, 0), atol=ROUNDING)
    expected = np.where(hit[..., None], np.array(albedo), 0)
    np.testing.assert_array_equal(found["albedo"], expected.astype(np.float32))


def tilted_plane(pieces: int, material: Material, *, turned: bool) -> drpt.Mesh:
    """The plane 4 z = x, 60 units wide, each side in so many pieces."""
    x, y = np.meshgrid(np.linspace(-30, 30, pieces + 1), np.linspace(-30, 30, pieces + 1))
    corner = np.arange((pieces + 1) ** 2).reshape(x.shape)
    a, b, c, d = (
        corner[rows, columns].ravel()
        for rows in (slice(-1), slice(1, None))
        for columns in (slice(-1), slice(1, None))
    )
    faces = np.concatenate([np.stack([a, b, d], axis=-1), np.stack([a, d, c], axis=-1)])
    vertices = np.stack([x.ravel(), y.ravel(), x.ravel() / 4], axis=-1)
    return drpt.Mesh(vertices, faces[:, ::-1] if turned else faces, material=material)


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("pieces", [1, 12], ids=["facet", "mesh"])
def test_a_tilted_plane(pieces: int, turned: bool) -> None:
    plane = tilted_plane(pieces, drpt.Diffuse(GREEN), turned=turned)
    behind = drpt.Sphere((0, 0, 20), 1, material=drpt.Diffuse(0.1))  # so kernels know both kinds
    found = at_centres(drpt.Scene(camera(), [plane, behind]))
    through = centres(camera())
    depth = (4 * EYE[2] - EYE[0]) / (through[..., 0] - 4 * through[..., 2])
    np.testing.assert_allclose(found["depth"], depth, rtol=ROUNDING)
    normal = np.broadcast_to(normalize(np.array([[-1.0, 0, 4]])), through.shape)
    np.testing.assert_allclose(found["normal"], normal, atol=ROUNDING)
    expected = np.broadcast_to(np.array(GREEN, np.float32), normal.shape)
    np.testing.assert_array_equal(found["albedo"], expected)


def test_depth_is_along_the_axis_of_any_camera() -> None:
    aslant = camera((3, 4, 5), (1, 3, 2), fov=30)
    center = np.array([-4.0, 0, -7])
    room = drpt.Sphere(center, 20, material=drpt.Diffuse(1))
    found = at_centres(drpt.Scene(aslant, [room]))
    point = center - 20 * found["normal"].astype(np.float64)  # normals face inward
    ahead = normalize(np.subtract([aslant.target], aslant.eye))[0]
    np.testing.assert_allclose(found["depth"], (point - aslant.eye) @ ahead, rtol=ROUNDING)


def test_normals_are_interpolated_without_any_light() -> None:
    corners = [[-1, -1, 0], [2, -1, 0], [-1, 2, 0]]
    normals = np.array([[0.6, 0, 0.8], [0, 0.6, 0.8], [0, 0, 1]])
    mesh = drpt.Mesh(corners, [[0, 1, 2]], normals, drpt.Diffuse(0.5))
    for eye, side in ((3, 1), (-3, -1)):
        seen = camera((0, 0, eye), (0, 0, 0), side=1)
        found = at_centres(drpt.Scene(seen, [mesh]))
        expected = side * normalize(normals.sum(axis=0, keepdims=True))
        np.testing.assert_allclose(found["normal"][0], expected, atol=ROUNDING)


@pytest.mark.parametrize(
    "light",
    [
        quad((-9, -9, 0), (-9, 9, 0), (9, 9, 0), (9, -9, 0), radiance=3),
        drpt.Sphere((0.5, 1, 6), 2, radiance=3),
    ],
    ids=["triangles", "sphere"],
)
def test_the_back_of_a_light_is_black_and_faces_the_camera(light: Shape) -> None:
    found = at_centres(drpt.Scene(camera(), [light]))
    assert not found["albedo"].any()
    assert np.all(dot(found["normal"], -centres(camera())) > 0)
    assert np.all(np.isfinite(found["depth"]))


def test_a_light_whose_points_round_to_its_centre_faces_the_camera() -> None:
    shapes: list[Shape] = [
        drpt.Sphere((0, 0, 1), 1e-9, radiance=1),
        drpt.Sphere((0, 5, 0), 1, radiance=1),
    ]
    found = at_centres(drpt.Scene(camera((0, 0, 6), (0, 0, 0), side=1), shapes))
    np.testing.assert_array_equal(found["normal"], [[(0, 0, 1)]])
    assert found["depth"] == 5


def test_means_over_a_pixel_that_is_partly_covered() -> None:
    """A quarter is a surface, a quarter a light, and half is background."""
    surface = quad((0, -9, 0), (9, -9, 0), (9, 0, 0), (0, 0, 0), material=drpt.Diffuse(GREEN))
    light = quad((0, 0, 2), (9, 0, 2), (9, 9, 2), (0, 9, 2), radiance=5)
    scene = drpt.Scene(camera((0, 0, 6), (0, 0, 0), side=1), [surface, light])
    found = first_hits(TYPES, scene, 64)  # Sobol' points: a quarter of each run of four each
    np.testing.assert_allclose(found["albedo"][0, 0], np.add(GREEN, 1) / 4, rtol=ROUNDING)
    np.testing.assert_allclose(found["normal"][0, 0], (0, 0, 0.5), atol=ROUNDING)
    np.testing.assert_allclose(found["depth"], 5, rtol=ROUNDING)


@pytest.mark.parametrize("sampler", ["sobol", "independent"])
def test_samples_are_those_of_a_render(sampler: str) -> None:
    lamps = [drpt.Sphere((x, 0.7, 0), 0.6, radiance=1) for x in (-0.5, 1, 2)]
    scene = drpt.Scene(camera(), lamps)
    found = first_hits(TYPES, scene, 5, sampler=sampler, seed=7)
    seen = drpt.render(scene, 5, 0, sampler=sampler, seed=7)
    assert np.sum((seen.image > 0) & (seen.image < 1)) > 30  # of pixels at edges
    np.testing.assert_array_equal(found["albedo"], seen.image)


def test_launches_are_bounded_and_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = drpt.load_scene("spheres")
    scene = drpt.Scene(camera(scene.camera.eye, scene.camera.target), scene.shapes)
    whole = first_hits(TYPES, scene, 10)
    monkeypatch.setattr(first_hit, "LAUNCH_PIXELS", 100)
    monkeypatch.setattr(first_hit, "LAUNCH_SAMPLES", 4)
    parts = first_hits(TYPES, scene, 10)
    for name, layer in whole.items():
        np.testing.assert_allclose(parts[name], layer, rtol=1e-6)  # a rounding to float32


def test_another_camera_or_seed_compiles_nothing() -> None:
    def trace(eye: tuple[float, ...], seed: int, spp: int) -> None:
        sphere = drpt.Sphere((0, 0, 0), 1, material=drpt.Diffuse(GREEN))
        first_hits(TYPES, drpt.Scene(camera(eye), [sphere]), spp, seed=seed)

    trace((0, 0, 5), 1, 3)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        trace((1, 2, 6), 2, 5)
        kernels = dr.kernel_history((dr.KernelType.JIT,))
    assert len(kernels) >= 3
    assert all(kernel["cache_hit"] for kernel in kernels)


@pytest.mark.slow
def test_mitsuba_sees_the_same() -> None:
    import mitsuba as mi

    box = drpt.load_scene("cornell-box")
    view = box.camera
    small = drpt.Camera(view.eye, view.target, view.up, view.fov, 64, 64)
    scene = drpt.Scene(small, box.shapes)
    theirs = to_mitsuba(scene)
    aovs = {"type": "aov", "aovs": "a:albedo,n:sh_normal,p:position"}
    layers = np.array(mi.render(theirs, integrator=mi.load_dict(aovs), spp=1024), np.float64)
    albedo, normal, position = layers[..., :3], layers[..., 3:6], layers[..., 6:9]
    ours = first_hits(TYPES, scene, 256)
    no_lamp = np.all(ours["albedo"] < 0.77, axis=-1)  # Mitsuba's lamps have a black albedo
    one_face = np.linalg.norm(normal, axis=-1) > 1 - ROUNDING
    assert np.mean(no_lamp & one_face) > 0.7
    np.testing.assert_allclose(ours["albedo"][no_lamp], albedo[no_lamp], atol=EDGE)
    ours_flat, theirs_flat = ours["normal"][one_face], normal[one_face]
    outward = np.sign(dot(ours_flat, theirs_flat))[:, None]  # Mitsuba's have a side of their own
    np.testing.assert_allclose(ours_flat, outward * theirs_flat, atol=EDGE)
    depth = position[..., 2] - view.eye[2]
    flat = one_face & no_lamp
    np.testing.assert_allclose(ours["depth"][flat], depth[flat], rtol=DEPTH)
