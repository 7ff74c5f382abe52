"""Scene files from the view: with the size and the names that the scene came with."""

from __future__ import annotations

import tomllib
from io import BytesIO
from typing import TYPE_CHECKING
from zipfile import ZipFile

import pytest

import drpt
from drpt.view.edits import edited
from drpt.view.saving import scene_file
from drpt.view.scenes import Scenes
from drpt.view.state import Orbit

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path
    from typing import Any

    from drpt.view.saving import File

SCENE = """
description = "Two balls and a floor"

[camera]
eye = [0, 2, 7]
target = [0, 1, 0]
up = [0, 1, 0]
fov = 35
width = 1600
height = 900

[materials.gold]
type = "phong"
albedo = [0.9, 0.7, 0.3]
exponent = 50

[materials.unused]
type = "diffuse"
albedo = 0.1

[[shapes]]
type = "sphere"
center = [0, 1, 0]
radius = 1
material = "gold"

[[shapes]]
type = "sphere"
center = [3, 1, 0]
radius = 1
material = "gold"

[[shapes]]
type = "mesh"
FLOOR
material = { type = "diffuse", albedo = 0.5 }

[[shapes]]
type = "sphere"
center = [2, 4, 1]
radius = 0.5
radiance = [30, 27, 20]
"""
INLINE = "vertices = [[-4, 0, -4], [-4, 0, 4], [4, 0, 4]]\nfaces = [[0, 1, 2]]"
OBJ = "v -4 0 -4\nv -4 0 4\nv 4 0 4\nf 1 2 3\n"
GOLD = {"type": "phong", "albedo": [0.9, 0.7, 0.3], "exponent": 50.0}
GREEN = {"type": "phong", "albedo": [0.1, 0.5, 0.1], "exponent": 50.0}


def save(folder: Path, edits: Mapping[int, Mapping[str, Any]], floor: str = INLINE) -> File:
    """Save a scene that was changed, as the view would show it: smaller than it is."""
    path = folder / "mine.toml"
    path.write_text(SCENE.replace("FLOOR", floor))
    scenes = Scenes(str(path))
    shown = scenes.load("mine.toml")
    assert shown.camera.width < 1600
    return scene_file(edited(shown, edits, Orbit()), scenes.file("mine.toml"))


def saved_table(folder: Path, edits: Mapping[int, Mapping[str, Any]]) -> dict[str, Any]:
    return tomllib.loads(save(folder, edits).content.decode())


def test_what_was_not_changed_is_as_it_was(tmp_path: Path) -> None:
    file = save(tmp_path, {})
    assert (file.name, file.media) == ("mine.toml", "application/toml")
    (tmp_path / "again.toml").write_bytes(file.content)
    assert drpt.load_scene(tmp_path / "again.toml") == drpt.load_scene(tmp_path / "mine.toml")


class TestMaterials:
    def test_keep_their_names(self, tmp_path: Path) -> None:
        table = saved_table(tmp_path, {0: {"radius": 0.5}, 3: {"center": [1, 4, 1]}})
        assert table["materials"].keys() == {"gold", "unused"}
        materials = [shape.get("material") for shape in table["shapes"]]
        assert materials[:2] == ["gold", "gold"]
        assert materials[2]["type"] == "diffuse"
        assert table["shapes"][0]["radius"] == 0.5
        assert table["shapes"][3]["center"] == [1, 4, 1]

    def test_that_change_for_all_shapes_change_under_their_name(self, tmp_path: Path) -> None:
        green = {"albedo": [0.1, 0.5, 0.1]}
        table = saved_table(tmp_path, {0: green, 1: green})
        assert table["materials"]["gold"] == GREEN
        assert [shape.get("material") for shape in table["shapes"][:2]] == ["gold", "gold"]

    def test_that_change_for_one_shape_stand_there(self, tmp_path: Path) -> None:
        table = saved_table(tmp_path, {1: {"albedo": [0.1, 0.5, 0.1]}})
        assert table["materials"]["gold"] == GOLD
        assert [shape.get("material") for shape in table["shapes"][:2]] == ["gold", GREEN]


class TestMeshFiles:
    @pytest.mark.parametrize("name", ["floor.obj", "parts/floor.obj"])
    def test_keep_their_names(self, name: str, tmp_path: Path) -> None:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(OBJ)
        file = save(tmp_path, {}, f'file = "{name}"')
        assert (file.name, file.media) == ("mine.zip", "application/zip")
        with ZipFile(BytesIO(file.content)) as archive:
            assert archive.read(name).decode() == OBJ
            archive.extractall(tmp_path / "unpacked")
        again = drpt.load_scene(tmp_path / "unpacked/mine.toml")
        assert again == drpt.load_scene(tmp_path / "mine.toml")
        table = tomllib.loads((tmp_path / "unpacked/mine.toml").read_text())
        assert [shape.get("file") for shape in table["shapes"]] == [None, None, name, None]
        assert not list((tmp_path / "unpacked").glob("*-meshes"))

    @pytest.mark.parametrize("absolute", [True, False])
    def test_from_elsewhere_are_put_into_the_archive(self, absolute: bool, tmp_path: Path) -> None:
        (tmp_path / "floor.obj").write_text(OBJ)
        (tmp_path / "scenes").mkdir()
        name = str(tmp_path / "floor.obj") if absolute else "../floor.obj"
        file = save(tmp_path / "scenes", {}, f'file = "{name}"')
        with ZipFile(BytesIO(file.content)) as archive:
            archive.extractall(tmp_path / "unpacked")
        again = drpt.load_scene(tmp_path / "unpacked/mine.toml")
        assert again == drpt.load_scene(tmp_path / "scenes/mine.toml")
        (copy,) = (tmp_path / "unpacked/meshes").iterdir()
        assert copy.name.endswith("-floor.obj")

    def test_that_are_gone_are_told_of(self, tmp_path: Path) -> None:
        (tmp_path / "floor.obj").write_text(OBJ)
        (tmp_path / "mine.toml").write_text(SCENE.replace("FLOOR", 'file = "floor.obj"'))
        scenes = Scenes(str(tmp_path / "mine.toml"))
        (tmp_path / "floor.obj").unlink()
        with pytest.raises(drpt.SceneError, match=r"floor\.obj: there is no such file"):
            scene_file(scenes.load("mine.toml"), scenes.file("mine.toml"))
