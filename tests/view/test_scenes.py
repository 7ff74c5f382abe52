"""The scenes that are served, and their sizes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

import drpt
from drpt.scene.builtin import builtin_names
from drpt.view.scenes import MAX_PIXELS, Scenes

if TYPE_CHECKING:
    from pathlib import Path


def test_a_file_is_served_by_its_name_alone(tmp_path: Path) -> None:
    scene = drpt.load_scene("furnace")
    scene.save(tmp_path / "mine.toml")
    scenes = Scenes(str(tmp_path / "mine.toml"))
    assert scenes.names == ["mine.toml", *builtin_names()]
    assert scenes.load("mine.toml") == scene


@pytest.mark.parametrize("name", ["mine.toml", "../scenes/veach.toml", ""])
def test_nothing_else_is_served(name: str) -> None:
    with pytest.raises(drpt.SceneError, match="is not allowed; it must be one of veach, cornell"):
        Scenes("veach").load(name)


def test_large_pictures_are_shown_smaller(tmp_path: Path) -> None:
    drpt.load_scene("veach").resized(1920, 1080).save(tmp_path / "large.toml")
    camera = Scenes(str(tmp_path / "large.toml")).load("large.toml").camera
    assert camera.width * camera.height <= MAX_PIXELS
    assert camera.width / camera.height == pytest.approx(16 / 9, rel=0.01)


@pytest.mark.parametrize(
    ("width", "height", "size"),
    [(600, 500, (600, 500)), (99, None, (99, 99)), (None, 64, (64, 64))],
)
def test_a_size_that_is_asked_for_is_kept(
    width: int | None, height: int | None, size: tuple[int, int]
) -> None:
    camera = Scenes("cornell-box", width, height).load("furnace").camera
    assert (camera.width, camera.height) == size


@pytest.mark.parametrize(
    ("sides", "size"), [({"width": 96}, (96, 54)), ({"height": 90}, (160, 90))]
)
def test_one_side_alone_keeps_the_aspect_ratio(
    sides: dict[str, int], size: tuple[int, int], tmp_path: Path
) -> None:
    drpt.load_scene("veach").resized(1920, 1080).save(tmp_path / "large.toml")
    camera = Scenes(str(tmp_path / "large.toml"), **sides).load("large.toml").camera
    assert (camera.width, camera.height) == size
