import tomllib
from pathlib import Path

import numpy as np
import pytest

from drpt.scene import Diffuse, Mesh, Phong, Scene, Sphere, builtin_names, load_scene
from drpt.scene.builtin import builtin_descriptions, builtin_path

TILT = 1e-4  # of a plate's normal: its corners are written with four decimals
CORNELL_LIGHTS = {
    "cornell-box": 60,
    "cornell-box-medium-light": 30,
    "cornell-box-small-light": 10,
    "cornell-box-glossy": 60,
}
Quad = list[tuple[float, float, float]]

FLOOR: Quad = [(552.8, 0, 0), (0, 0, 0), (0, 0, 559.2), (549.6, 0, 559.2)]
CEILING: Quad = [(556, 548.8, 0), (556, 548.8, 559.2), (0, 548.8, 559.2), (0, 548.8, 0)]
BACK: Quad = [(549.6, 0, 559.2), (0, 0, 559.2), (0, 548.8, 559.2), (556, 548.8, 559.2)]
GREEN: Quad = [(0, 0, 559.2), (0, 0, 0), (0, 548.8, 0), (0, 548.8, 559.2)]
RED: Quad = [(552.8, 0, 0), (549.6, 0, 559.2), (556, 548.8, 559.2), (556, 548.8, 0)]
SMALL_TOP: Quad = [(130, 165, 65), (82, 165, 225), (240, 165, 272), (290, 165, 114)]
LARGE_TOP: Quad = [(423, 330, 247), (265, 330, 296), (314, 330, 456), (472, 330, 406)]


def box(top: Quad) -> list[Quad]:
    low: Quad = [(x, 0, z) for x, _, z in top]
    following = [1, 2, 3, 0]
    return [top, *([top[i], low[i], low[j], top[j]] for i, j in enumerate(following))]


def triangles(quads: list[Quad]) -> list[Quad]:
    return [[quad[0], quad[i], quad[i + 1]] for quad in quads for i in (1, 2)]


def surfaces(scene: Scene) -> list[tuple[Quad, object]]:
    """Return the triangles of all meshes, in order, each with its material."""
    return [
        ([tuple(vertex) for vertex in triangle.tolist()], mesh.material)
        for mesh in scene.shapes
        if isinstance(mesh, Mesh)
        for triangle in mesh.vertices[mesh.faces]
    ]


def test_names_and_descriptions() -> None:
    assert set(builtin_names()) == {
        *CORNELL_LIGHTS,
        "spheres",
        "many-lights",
        "veach",
        "furnace",
    }
    assert tuple(builtin_descriptions()) == builtin_names()
    for name, description in builtin_descriptions().items():
        assert load_scene(name).description == description
        assert 20 <= len(description) <= 70
        assert "\n" not in description
    assert builtin_path("no-such-scene") is None


@pytest.mark.parametrize("name", CORNELL_LIGHTS)
def test_cornell_boxes(name: str) -> None:
    glossy = name == "cornell-box-glossy"
    white = Diffuse(0.76)
    scene = load_scene(name)
    expected: list[tuple[list[Quad], object]] = [
        ([FLOOR], Diffuse(0.86) if glossy else white),
        ([CEILING], white),
        ([BACK], Phong(0.76, 50) if glossy else white),
        ([GREEN], Diffuse((0.16, 0.76, 0.16))),
        ([RED], Diffuse((0.76, 0.16, 0.16))),
        (box(SMALL_TOP), white),
        (box(LARGE_TOP), Phong(0.86, 1000) if glossy else white),
    ]
    assert surfaces(scene) == [
        (triangle, material) for quads, material in expected for triangle in triangles(quads)
    ]


@pytest.mark.parametrize(("name", "radius"), CORNELL_LIGHTS.items())
def test_cornell_camera_and_light(name: str, radius: float) -> None:
    scene = load_scene(name)
    camera = scene.camera
    assert (camera.eye, camera.target, camera.up) == ((278, 273, -770), (278, 273, -769), (0, 1, 0))
    assert (camera.fov, camera.width, camera.height) == (39, 256, 256)
    light = Sphere((278, 450, 179.5), radius, radiance=19.5 * (60 / radius) ** 2)
    assert [shape for shape in scene.shapes if isinstance(shape, Sphere)] == [light]


def test_spheres_has_spheres_only() -> None:
    scene = load_scene("spheres")
    assert all(isinstance(shape, Sphere) for shape in scene.shapes)
    assert {type(shape.material) for shape in scene.shapes} == {Diffuse, Phong, type(None)}
    assert any(shape.is_light for shape in scene.shapes)


def test_many_lights() -> None:
    lights = [shape for shape in load_scene("many-lights").shapes if shape.is_light]
    spheres = [light for light in lights if isinstance(light, Sphere)]
    assert len({light.radius for light in spheres}) == 12
    assert len({light.radiance for light in spheres}) == 12
    (panel,) = (light for light in lights if isinstance(light, Mesh))
    a, b, c = panel.vertices[panel.faces].swapaxes(0, 1)
    normals = np.cross(b - a, c - a)
    assert (normals[:, 1] < 0).all()
    assert not normals[:, [0, 2]].any()


def test_veach_plates_mirror_the_lights_into_the_camera() -> None:
    scene = load_scene("veach")
    lights = [shape for shape in scene.shapes if isinstance(shape, Sphere)]
    assert [light.radius for light in lights] == [0.1, 0.2, 0.4, 0.8]
    powers = [light.radiance[0] * light.radius**2 for light in lights if light.radiance]
    assert powers == pytest.approx([1, 1, 1, 1], rel=1e-15)
    plates = [
        (shape, shape.material.exponent)
        for shape in scene.shapes
        if isinstance(shape, Mesh) and isinstance(shape.material, Phong)
    ]
    assert [exponent for _, exponent in plates] == [50000, 5000, 500, 50]
    for plate, _ in plates:
        middle = plate.vertices.mean(axis=0)
        to_eye, to_lights = np.array(scene.camera.eye) - middle, -middle
        half = to_eye / np.linalg.norm(to_eye) + to_lights / np.linalg.norm(to_lights)
        edges = plate.vertices[1:] - plate.vertices[0]
        assert np.abs(edges @ half / np.linalg.norm(half)).max() < TILT


def test_furnace_is_concentric_and_seen_from_inside() -> None:
    scene = load_scene("furnace")
    wall, light = scene.shapes
    assert isinstance(wall, Sphere)
    assert isinstance(light, Sphere)
    assert wall.center == light.center == (0, 0, 0)
    assert light.is_light
    assert isinstance(wall.material, Diffuse)
    assert light.radius < np.linalg.norm(scene.camera.eye) < wall.radius


def test_files_are_for_people() -> None:
    for name in builtin_names():
        path = builtin_path(name)
        assert isinstance(path, Path)
        text = path.read_text(encoding="utf-8")
        assert max(map(len, text.splitlines())) <= 100
        assert all("file" not in shape for shape in tomllib.loads(text)["shapes"])
