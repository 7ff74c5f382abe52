import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from drpt.scene import (
    Camera,
    Diffuse,
    Mesh,
    Phong,
    Scene,
    SceneError,
    Sphere,
    builtin_names,
    load_scene,
)

CAMERA = """
[camera]
eye = [0, 0, 5]
target = [0, 0, 0]
up = [0, 1, 0]
fov = 40
width = 4
height = 3
"""
SPHERE = """
[[shapes]]
type = "sphere"
center = [0, 0, 0]
radius = 1
"""
TRIANGLE = """
[[shapes]]
type = "mesh"
vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
faces = [[0, 1, 2]]
"""
WHITE = """
[materials.white]
type = "diffuse"
albedo = 1
"""


def load(tmp_path: Path, text: str) -> Scene:
    path = tmp_path / "scene.toml"
    path.write_text(text, encoding="utf-8")
    return load_scene(path)


def refusal(where: object) -> str:
    """Return the one line that a `SceneError` says of a scene."""
    with pytest.raises(SceneError) as caught:
        load_scene(where)  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_a_file_gives_the_scene_that_it_describes(tmp_path: Path) -> None:
    shapes = f"""
    {SPHERE} material = "white"
    {SPHERE} material = {{ type = "phong", albedo = [0.1, 0.2, 0.3], exponent = 5 }}
    {SPHERE} radiance = 2
    {TRIANGLE} normals = [[0, 0, 1], [0, 0, 1], [0, 1, 1]]
    material = "white"
    """
    scene = load(tmp_path, f'description = "Ω"\n{CAMERA}{WHITE}{shapes}')
    vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    normals = [[0, 0, 1], [0, 0, 1], [0, 1, 1]]
    assert scene == Scene(
        Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), 40, 4, 3),
        [
            Sphere((0, 0, 0), 1, Diffuse(1)),
            Sphere((0, 0, 0), 1, Phong((0.1, 0.2, 0.3), 5)),
            Sphere((0, 0, 0), 1, radiance=2),
            Mesh(vertices, [[0, 1, 2]], normals, Diffuse(1)),
        ],
        "Ω",
    )


def test_mesh_files_are_relative_to_the_scene_file(tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    np.savez(tmp_path / "meshes" / "a.npz", v=np.eye(3), f=[[0, 1, 2]])
    mesh = '[[shapes]]\ntype = "mesh"\nfile = "meshes/a.npz"\nradiance = 1'
    (shape,) = load(tmp_path, CAMERA + mesh).shapes
    assert shape == Mesh(np.eye(3), [[0, 1, 2]], radiance=1)


def test_windows_files(tmp_path: Path) -> None:
    text = f"{CAMERA}{SPHERE}radiance = 1\n".replace("\n", "\r\n")
    (tmp_path / "x.toml").write_bytes(b"\xef\xbb\xbf" + text.encode())
    assert load_scene(tmp_path / "x.toml").camera.width == 4


def test_a_name_is_a_built_in_scene_before_it_is_a_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    text = f"{CAMERA}{SPHERE}radiance = 1"
    Path("furnace").write_text(text)
    Path("mine").write_text(text)
    assert load_scene("furnace") != load_scene("mine")
    assert load_scene(Path("furnace")) == load_scene("mine") == load_scene("./furnace")


LIGHT = SPHERE + "radiance = 1\n"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("camera", "it is not TOML: Expected '=' after a key"),
        ("x = " + "[" * 9999, "it is not TOML"),
        (f"x = {'1' * 5000}", "it is not TOML"),
        ("", "camera: this key is missing"),
        (CAMERA, "shapes: this key is missing"),
        (f"shapes = []\n{CAMERA}", "shapes: there are none"),
        (f"shapes = 3\n{CAMERA}", "shapes: 3 is not allowed; it must be an array of tables"),
        (f"shapes = [3]\n{CAMERA}", "shapes[0]: 3 is not allowed; it must be a table"),
        (f"camera = 3\n{LIGHT}", "camera: 3 is not allowed; it must be a table"),
        (f"materials = 3\n{CAMERA}{LIGHT}", "materials: 3 is not allowed; it must be a table"),
        (f"description = 3\n{CAMERA}{LIGHT}", "description: 3 is not allowed"),
        (f"shape = 1\n{CAMERA}{LIGHT}", "shape: there is no key 'shape' (did you mean 'shapes'?)"),
        (f"{CAMERA}fow = 3\n{LIGHT}", "camera.fow: there is no key 'fow' (did you mean 'fov'?)"),
        (f"{CAMERA.replace('fov = 40', '')}{LIGHT}", "camera.fov: this key is missing"),
        (f"{CAMERA.replace('40', '180')}{LIGHT}", "camera.fov: 180 is not allowed"),
        (f"{CAMERA.replace('= 3', '= 3.0')}{LIGHT}", "camera.height: 3.0 is not allowed"),
        (f"{CAMERA.replace('[0, 0, 5]', '[0, 0, 0]')}{LIGHT}", "camera.target: "),
        (f"{CAMERA}{LIGHT}{LIGHT.replace('= 1', '= -1')}", "shapes[1].radius: -1 is not allowed"),
        (f"{CAMERA}{SPHERE}radiance = nan", "shapes[0].radiance: nan is not allowed"),
        (f"{CAMERA}{SPHERE}radiance = 1979-05-27", "shapes[0].radiance: datetime.date"),
        (f"{CAMERA}{SPHERE}", "shapes[0]: it has neither"),
        (f"{WHITE}{CAMERA}{LIGHT}material = 'white'", "shapes[0]: it has both"),
        (f"{CAMERA}{LIGHT}radios = 3", "shapes[0].radios: there is no key 'radios' (did you mean"),
        (f"{CAMERA}{LIGHT}vertices = []", "shapes[0].vertices: there is no key 'vertices'"),
        (f"{CAMERA}{LIGHT.replace('sphere', 'shpere')}", "(did you mean 'sphere'?)"),
        (f"{CAMERA}[[shapes]]", "shapes[0].type: this key is missing; it must be one of sphere"),
        (f"{CAMERA}[[shapes]]\ntype = []", "shapes[0].type: there is no type []"),
        (f"{CAMERA}[[shapes]]\ntype = 'mesh'", "shapes[0].vertices: this key is missing"),
        (f"{CAMERA}{TRIANGLE}file = 'a.ply'", "shapes[0].vertices: there is no key"),
        (f"{CAMERA}{TRIANGLE.replace('2', '3')}radiance = 1", "shapes[0].faces[0]: (0, 1, 3)"),
        (f"{CAMERA}{TRIANGLE.replace('2', '2.0')}radiance = 1", "shapes[0].faces: an array of"),
        (f"{CAMERA}{WHITE}{SPHERE}material = 'wite'", "(did you mean 'white'?); it must be one"),
        (
            f"{CAMERA}{SPHERE}material = 'white'",
            "shapes[0].material: there is no material 'white'; it must be a table",
        ),
        (f"{CAMERA}{SPHERE}material = 3", "shapes[0].material: 3 is not allowed"),
        (f"{CAMERA}{SPHERE}material = {{}}", "shapes[0].material.type: this key is missing"),
        (f"{CAMERA}{LIGHT}{WHITE}exponent = 3", "materials.white.exponent: there is no key"),
        (f"{CAMERA}{LIGHT}{WHITE.replace('1', '2')}", "materials.white.albedo: 2 is not allowed"),
        (f"{CAMERA}{LIGHT}{WHITE.replace('diffuse', 'phong')}", "materials.white.exponent: this"),
        (f"{CAMERA}{LIGHT}[materials]\nwhite = 0.5", "materials.white: 0.5 is not allowed"),
        (f"{CAMERA}[[shapes]]\ntype = 'mesh'\nfile = 3", "shapes[0].file: 3 is not allowed"),
        (f"{CAMERA}[[shapes]]\ntype = 'mesh'\nfile = 'no.ply'\nradiance = 1", "no such file"),
        (f"{CAMERA}[[shapes]]\ntype = 'mesh'\nfile = 'a\\u0000.ply'", "shapes[0].file: "),
    ],
)
def test_bad_files(tmp_path: Path, text: str, expected: str) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(text)
    message = refusal(path)
    assert message.startswith(f"{path}: ")
    assert expected in message


def test_what_is_not_toml_is_located(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text("a = 1\nb = ]")
    assert refusal(path).endswith("(at line 2, column 5)")


def test_bad_mesh_files_name_both_files(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", v=np.eye(3), f=[[0, 1, 3]])
    path = tmp_path / "scene.toml"
    path.write_text(f"{CAMERA}[[shapes]]\ntype = 'mesh'\nfile = 'a.npz'\nradiance = 1")
    message = refusal(path)
    assert message.startswith(f"{path}: shapes[0].file: {tmp_path / 'a.npz'}: faces[0]: (0, 1, 3)")
    np.savez(tmp_path / "a.npz", v=np.eye(3), f=[[0, 1, 2]])
    path.write_text(path.read_text().replace("= 1", "= -1"))
    assert refusal(path).startswith(f"{path}: shapes[0].radiance: -1 is not allowed")


def test_bad_paths(tmp_path: Path) -> None:
    assert "there is no such file" in refusal(tmp_path / "no.toml")
    assert "there is no such file" in refusal("no.toml")
    assert "this is a folder, and it must be a file" in refusal(tmp_path)
    assert "null" in refusal("a\0.toml")
    (tmp_path / "latin.toml").write_bytes('description = "é"'.encode("latin-1"))
    assert "byte 15 is not UTF-8" in refusal(tmp_path / "latin.toml")


def test_unreadable_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> int:
        raise PermissionError(13, "Permission denied")

    (tmp_path / "secret.toml").touch()
    monkeypatch.setattr(os, "open", fail)  # root may read everything
    assert "it cannot be read: Permission denied" in refusal(tmp_path / "secret.toml")


def test_unknown_names() -> None:
    message = refusal("cornel-box")
    assert "there is no scene 'cornel-box' (did you mean 'cornell-box'?)" in message
    assert all(name in message for name in builtin_names())
    for name in ["zzz", None, 3, b"furnace", "a" * 5000, "a" * 5000 + "/b"]:
        refusal(name)
    assert len(refusal("a" * 5000)) < 500
    assert refusal("").startswith("there is no scene ''; it must be one of")


def colours(most: float) -> Any:
    return st.tuples(*3 * [st.floats(0, most)]).map(lambda rgb: tuple(round(x, 9) for x in rgb))


POINTS = st.tuples(*3 * [st.floats(-1e9, 1e9)])
MATERIALS = st.one_of(
    st.builds(Diffuse, colours(1)), st.builds(Phong, colours(1), st.floats(0, 1e8))
)
SURFACES = st.one_of(
    st.fixed_dictionaries({"material": MATERIALS}),
    st.fixed_dictionaries({"radiance": colours(1e9)}),
)
SPHERES = st.builds(lambda c, r, s: Sphere(c, r, **s), POINTS, st.floats(1e-9, 1e9), SURFACES)
TRIANGLES = st.lists(POINTS, min_size=3, max_size=3).filter(
    lambda points: (
        np.linalg.norm(np.cross(points[0], points[1])) > 1
        and Mesh(points, [[0, 1, 2]], material=Diffuse(1)).areas().sum() > 1
    )
)
MESHES = st.builds(
    lambda v, smooth, s: Mesh(v, [[0, 1, 2], [2, 2, 0]], np.eye(3) if smooth else None, **s),
    TRIANGLES,
    st.booleans(),
    SURFACES,
)


@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(SPHERES | MESHES, min_size=1, max_size=4), st.text(), st.floats(1e-3, 179))
def test_a_saved_scene_is_equal(tmp_path: Path, shapes: Any, description: str, fov: float) -> None:
    scene = Scene(Camera((0, 0, 1 / 3), (0, 0, 0), (0, 1, 0.1), fov, 4, 3), shapes, description)
    scene.save(tmp_path / "x.toml")
    assert load_scene(tmp_path / "x.toml") == scene
