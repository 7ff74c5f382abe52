"""Paths as a browser gets them: where they are in the picture, and what they say of themselves."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import drpt
from drpt.scene.picture_plane import picture_plane
from drpt.view.paths import describe_paths

# Of float32 points, seen as parts of a pixel.
ROUNDING = 1e-3
FLOOR = drpt.Mesh(
    [[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]],
    [[0, 1, 2], [0, 2, 3]],
    material=drpt.Diffuse(0.5),
)
LAMP = drpt.Sphere((0, 0, 30), 1, radiance=400)  # behind the camera
SCENE = drpt.Scene(
    camera=drpt.Camera((0, 0, 9), (0, 0, 0), (0, 1, 0), 60, 9, 9), shapes=[FLOOR, LAMP]
)


def paths(mode: str, column: int = 4, row: int = 2, bounces: int = 1) -> list[dict[str, Any]]:
    rendering = drpt.Rendering(SCENE, 64, bounces, mode)
    return describe_paths(SCENE, rendering.vertices(column, row, 16))


def test_the_first_vertex_is_in_its_pixel() -> None:
    for path in paths("explicit"):
        x, y = path["vertices"][0]["at"]
        assert 4 - ROUNDING <= x <= 5 + ROUNDING
        assert 2 - ROUNDING <= y <= 3 + ROUNDING
        assert path["vertices"][0]["event"] == "surface"


def test_what_is_behind_the_camera_is_nowhere_in_the_picture() -> None:
    for path in paths("explicit"):
        light = path["vertices"][0]["light"]
        assert (light["shape"], light["visible"], light["at"]) == (1, True, None)
        assert np.linalg.norm(np.subtract(light["point"], (0, 0, 30))) == pytest.approx(1, abs=1e-4)


def test_a_ray_that_leaves_ends_somewhere_along_it() -> None:
    ended = [path["vertices"] for path in paths("implicit") if len(path["vertices"]) == 2]
    gone = [vertices for vertices in ended if vertices[1]["event"] == "background"]
    assert gone
    for first, last in gone:
        assert (last["shape"], last["light"], last["contribution"]) == (None, None, [0, 0, 0])
        assert last["point"][2] > first["point"][2]
        ways = np.array([last["point"]]) - SCENE.camera.eye
        seen = picture_plane(SCENE.camera).project(ways)[0, :2]
        assert last["at"] is None or last["at"] == pytest.approx(seen.tolist())


def test_a_path_that_ends_in_a_light_says_so() -> None:
    scene = drpt.Scene(camera=SCENE.camera, shapes=[drpt.Sphere((0, 0, 0), 1, radiance=(1, 2, 3))])
    (path,) = describe_paths(scene, drpt.Rendering(scene, 1, 3).vertices(4, 4, 1))
    (vertex,) = path["vertices"]
    assert (vertex["event"], vertex["shape"]) == ("light", 0)
    assert vertex["throughput"] == [1, 1, 1]
    assert path["radiance"] == vertex["contribution"] == [1, 2, 3]
