"""The order of primitives, their rows, their common origin, and which of them cast shadows."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import drpt
from drpt.kernel.primitives import Primitives, make_primitives
from tests.oracle.geometry import any_hit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from drpt.scene import Shape
    from tests.oracle.arrays import Floats

ROUNDING = 1e-12  # of float64
# A render of a mesh of 50 000 triangles begins after about a second; processor time, twice that,
# since a machine that has other work has cold caches, too.
MAX_SECONDS = 2.0

WHITE = drpt.Diffuse(0.75)
GREY = drpt.Diffuse(0.25)
GLOSSY = drpt.Phong((0.1, 0.2, 0.3), 40)
CAMERA = drpt.Camera((0, 0, 9), (0, 0, 0), (0, 1, 0), 40, 8, 8)
SQUARE = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
QUAD = [[0, 1, 2], [0, 2, 3]]

DIFFUSE = -1.0  # code of the material


def prepare(*shapes: Shape) -> Primitives:
    return make_primitives(drpt.Scene(camera=CAMERA, shapes=shapes).shapes)


def quad(z: float = 0.0, **kwargs: Any) -> drpt.Mesh:
    return drpt.Mesh(np.add(SQUARE, [0, 0, z]), QUAD, **kwargs)


def uv_sphere(rings: int, segments: int, **kwargs: Any) -> drpt.Mesh:
    """2 · rings · segments triangles, those at the poles without area."""
    theta, phi = np.meshgrid(
        np.linspace(0, np.pi, rings + 1), np.linspace(0, 2 * np.pi, segments, endpoint=False)
    )
    vertices = np.stack(
        [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1
    ).reshape(-1, 3)
    i, j = (k.ravel() for k in np.meshgrid(np.arange(segments), np.arange(rings), indexing="ij"))
    a, b = i * (rings + 1) + j, (i + 1) % segments * (rings + 1) + j
    faces = np.concatenate([np.stack([a, a + 1, b + 1], 1), np.stack([a, b + 1, b], 1)])
    return drpt.Mesh(vertices, faces, **kwargs)


def test_order_is_flat_smooth_dull_spheres_lit_spheres_lit_triangles() -> None:
    smooth = drpt.Mesh(
        np.add(SQUARE[:3], [0, 0, 2]), [[0, 1, 2]], normals=[[0, 0, 1]] * 3, material=GLOSSY
    )
    found = prepare(
        quad(1, radiance=5),
        drpt.Sphere((4, 0, 0), 0.5, radiance=(1, 2, 3)),
        smooth,
        drpt.Sphere((0, 4, 0), 0.25, material=GREY),
        quad(3, material=WHITE),
    )
    assert (found.first_smooth, found.first_sphere, found.first_light) == (1, 2, 3)
    assert found.spheres.tolist() == [[0, 4, 0, 0.25], [4, 0, 0, 0.5]]
    assert found.sphere_lights == 1
    assert found.planes.tolist() == [[0, 0, 1, 3], [0, 0, 1, 2], [0, 0, 1, 1], [0, 0, 1, 1]]
    assert found.reflectance.tolist() == [
        [0.75, 0.75, 0.75, DIFFUSE],
        [0.1, 0.2, 0.3, 40],
        [0.25, 0.25, 0.25, DIFFUSE],
    ]
    assert found.diffuse.tolist() == [True, False, True]
    assert found.radiance.tolist() == [[1, 2, 3], [5, 5, 5], [5, 5, 5]]
    assert found.smooth_corners.tolist() == [smooth.vertices.tolist()]
    assert found.smooth_normals.tolist() == [[[0, 0, 1]] * 3]
    assert found.light_corners.shape == (2, 3, 3)
    assert found.shape.tolist() == [4, 2, 3, 1, 0, 0]


def test_coincident_lights_are_of_the_first_shape() -> None:
    lamp = drpt.Sphere((4, 0, 0), 0.5, radiance=1)
    found = prepare(quad(material=WHITE), lamp, drpt.Sphere((0, 0, 0), 1, radiance=1), lamp)
    assert found.shape.tolist() == [0, 1, 2]


def test_shape_of_no_radiance_is_black() -> None:
    found = prepare(drpt.Sphere((0, 0, 0), 1, radiance=0), quad(radiance=0))
    assert found.first_light == 2
    assert found.reflectance.tolist() == [[0, 0, 0, DIFFUSE]] * 2
    assert len(found.radiance) == 0


def test_lights_have_areas_and_balls_around_them() -> None:
    found = prepare(drpt.Sphere((4, 0, 0), 0.5, radiance=1), quad(radiance=3))
    assert found.light_areas() == pytest.approx([4 * np.pi * 0.5**2, 0.5, 0.5], rel=ROUNDING)
    balls = found.light_balls()
    assert balls[0].tolist() == [4, 0, 0, 0.5]
    away = np.linalg.norm(found.light_corners - balls[1:, None, :3], axis=2)
    assert away.max(axis=1) == pytest.approx(balls[1:, 3], rel=ROUNDING)


def test_a_quad_is_one_facet_and_meshes_stay_apart() -> None:
    assert len(prepare(quad(material=WHITE)).facets) == 1
    beside = drpt.Mesh(np.add(SQUARE, [1, 0, 0]), QUAD, material=GREY)
    assert len(prepare(quad(material=WHITE), beside).facets) == 2


def test_cornell_box_needs_sixteen_facets() -> None:
    found = make_primitives(drpt.load_scene("cornell-box").shapes)
    assert len(found.facets) == 4 + 2 + 5 + 5  # the red wall is not planar
    red = found.reflectance[:, 0] > 2 * found.reflectance[:, 1]
    assert red[: found.first_smooth].sum() == 2
    assert sorted(len(f.corners) for f in found.facets) == [3, 3, *[4] * 14]


def test_smooth_and_emitting_triangles_are_not_merged() -> None:
    assert len(prepare(quad(radiance=1)).planes) == 2
    assert len(prepare(quad(normals=[[0, 0, 1]] * 4, material=WHITE)).planes) == 2


@pytest.mark.parametrize("kind", ["flat", "smooth", "light"])
def test_triangles_without_area_are_dropped(kind: str) -> None:
    kinds: dict[str, dict[str, Any]] = {
        "flat": {"material": WHITE},
        "smooth": {"material": WHITE, "normals": [[0, 0, 1]] * 4},
        "light": {"radiance": 1},
    }
    given = kinds[kind]
    found = prepare(drpt.Mesh(SQUARE, [[0, 1, 1], [0, 1, 2], [3, 3, 3]], **given))
    assert len(found.planes) == 1
    assert len(found.reflectance) + len(found.radiance) == 1
    assert np.isfinite(found.planes).all()


def test_origin_is_zero_unless_the_scene_is_far_from_it() -> None:
    assert not prepare(quad(material=WHITE)).origin.any()
    assert not make_primitives(drpt.load_scene("cornell-box").shapes).origin.any()


@pytest.mark.parametrize("shift", [1e3, -1e5, 12345678.0])
def test_far_scenes_are_moved_to_the_origin(shift: float) -> None:
    move = np.array([shift, 0, -shift / 3])
    far = drpt.Mesh(np.add(SQUARE, move), QUAD, material=WHITE)
    found = prepare(far, drpt.Sphere(move, 0.5, radiance=1))
    assert np.abs(found.facets[0].corners).max() < 8
    assert np.abs(found.spheres[:, :3]).max() < 8
    assert np.array_equal(found.origin, found.origin.astype(np.float32))
    assert found.spheres[0, :3] + found.origin == pytest.approx(move, rel=ROUNDING)


@pytest.mark.parametrize("scale", [2.0**-10, 2.0**10])
def test_origin_scales_with_the_scene(scale: float) -> None:
    def origin(factor: float) -> Floats:
        center = np.array([1000.0, 70, -3]) * factor
        return prepare(drpt.Sphere(center, factor, material=WHITE)).origin

    assert np.array_equal(origin(scale), scale * origin(1))


def test_large_meshes_are_prepared_quickly() -> None:
    mesh = uv_sphere(158, 158, material=WHITE)
    assert 49_000 < len(mesh.faces) < 51_000
    start = time.process_time()
    found = prepare(mesh, drpt.Sphere((0, 0, 3), 0.5, radiance=1))
    assert time.process_time() - start < MAX_SECONDS
    assert found.facets == ()
    assert len(found.triangles) == len(found.planes) == (mesh.areas() > 0).sum()


def surface_points(rng: np.random.Generator, shapes: Sequence[Shape], count: int) -> Floats:
    """Points on and in the shapes: wherever a shadow ray may start or end."""
    parts = []
    for shape in shapes:
        if isinstance(shape, drpt.Sphere):
            inside = rng.uniform(-1, 1, (count, 3))
            inside /= np.maximum(np.linalg.norm(inside, axis=1, keepdims=True), 1)
            parts.append(np.array(shape.center) + shape.radius * inside)
        else:
            corners = shape.vertices[shape.faces[rng.integers(0, len(shape.faces), count)]]
            weights = rng.dirichlet([1, 1, 1], count)
            parts.append(np.einsum("nk,nkc->nc", weights, corners))
    return np.concatenate(parts)


@pytest.mark.parametrize(
    ("name", "bounding"),
    [("cornell-box", 6), ("cornell-box-glossy", 6), ("many-lights", 2), ("veach", 2)],
)
def test_facets_said_to_cast_no_shadow_never_do(name: str, bounding: int) -> None:
    scene = drpt.load_scene(name)
    found = make_primitives(scene.shapes)
    silent = [f for f, b in zip(found.facets, found.blockers(), strict=True) if not b]
    assert len(silent) == bounding
    rng = np.random.default_rng(0)
    points = surface_points(rng, scene.shapes, 400)
    a, b = points[rng.integers(0, len(points), (2, 20_000))]
    a, b = a[(a != b).any(axis=1)], b[(a != b).any(axis=1)]
    way = b - a
    length = np.linalg.norm(way, axis=1)
    for facet in silent:
        mesh = drpt.Mesh(facet.corners, fan(len(facet.corners)), material=WHITE)
        heights = np.abs(np.stack([a, b]) @ facet.normal - facet.offset).min(axis=0)
        off = heights > ROUNDING * length.max()  # an end on the facet is not between the ends
        direction = way[off] / length[off, None]
        assert not any_hit([mesh], a[off], direction, 0, length[off]).any()


def fan(corners: int) -> list[list[int]]:
    return [[0, k, k + 1] for k in range(1, corners - 1)]


def test_a_facet_that_a_sphere_pierces_casts_shadows() -> None:
    floor = quad(material=WHITE)
    resting = prepare(floor, drpt.Sphere((0.5, 0.5, 0.25), 0.25, radiance=1))
    sunk = prepare(floor, drpt.Sphere((0.5, 0.5, 0.25), 0.3, radiance=1))
    assert (resting.blockers(), sunk.blockers()) == ([False], [True])
