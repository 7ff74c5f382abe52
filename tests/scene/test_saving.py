import os
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drpt.scene import Camera, Diffuse, Mesh, Scene, SceneError, Sphere, builtin_names, load_scene
from drpt.scene.saving import to_toml

CAMERA = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), 40, 4, 3)
TRIANGLE = Mesh(np.eye(3) / 3, [[0, 1, 2]], np.eye(3), Diffuse(0.1))
SCENE = Scene(CAMERA, [TRIANGLE, Sphere((0, 0, 0), 1, Diffuse(0.1)), TRIANGLE], "Two and one")


def files(folder: Path) -> list[str]:
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*.*"))


@pytest.mark.parametrize("name", builtin_names())
def test_built_in_scenes_round_trip(tmp_path: Path, name: str) -> None:
    scene = load_scene(name)
    scene.save(tmp_path / "x.toml")
    assert load_scene(tmp_path / "x.toml") == scene


def test_equal_materials_and_meshes_are_written_once(tmp_path: Path) -> None:
    SCENE.save(tmp_path / "x.toml")
    table = tomllib.loads((tmp_path / "x.toml").read_text())
    assert list(table["materials"]) == ["material-1"]
    mesh_file = table["shapes"][0]["file"]
    assert files(tmp_path) == [mesh_file, "x.toml"]


def test_a_folder_with_its_scene_can_move(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    SCENE.save(str(tmp_path / "a" / "x.toml"))
    (tmp_path / "a").rename(tmp_path / "b")
    assert load_scene(tmp_path / "b" / "x.toml") == SCENE


def test_a_failure_leaves_the_old_scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "x.toml"
    SCENE.save(path)
    before = files(tmp_path)

    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", fail)
    with pytest.raises(SceneError, match=r"x\.toml: it cannot be written: No space left on device"):
        Scene(CAMERA, [Mesh(np.eye(3), [[0, 1, 2]], radiance=1)]).save(path)
    assert files(tmp_path) == before
    assert load_scene(path) == SCENE


def test_where_nothing_can_be_written(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="No such file or directory"):
        SCENE.save(tmp_path / "no" / "x.toml")
    with pytest.raises(SceneError, match="Is a directory"):
        SCENE.save(tmp_path)


@pytest.mark.parametrize("path", ["", None, 3, b"x.toml"])
def test_what_is_no_path(path: Any) -> None:
    with pytest.raises(SceneError, match="is not allowed; it must be the path of a scene file"):
        SCENE.save(path)


def test_what_no_file_can_hold(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"x\.toml: it cannot be written: .*surrogates"):
        Scene(CAMERA, SCENE.shapes, "\ud800").save(tmp_path / "x.toml")
    with pytest.raises(SceneError, match="it cannot be written: embedded null"):
        SCENE.save(tmp_path / "x\0.toml")


def test_small_scenes_are_one_text(tmp_path: Path) -> None:
    (tmp_path / "x.toml").write_text(to_toml(SCENE))
    assert load_scene(tmp_path / "x.toml") == SCENE


def test_large_meshes_are_summarised() -> None:
    grid = Mesh(np.ones((1001, 3)), [[0, 1, 1000]], material=Diffuse(1))
    moved = Mesh(np.zeros((1001, 3)), [[0, 1, 1000]], material=Diffuse(1))
    first, second, third = (
        tomllib.loads(to_toml(Scene(CAMERA, [mesh])))["shapes"][0] for mesh in (grid, grid, moved)
    )
    assert first["vertex_count"] == 1001
    assert first["face_count"] == 1
    assert first == second
    assert first["sha256"] != third["sha256"]
