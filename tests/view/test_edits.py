"""Changed scenes: power is kept, cameras go around, and what is wrong is named."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import drpt
from drpt.scene.bounds import bounds
from drpt.view.edits import edited, moved
from drpt.view.state import Orbit

ROUNDING = 1e-12  # of float64
BOX = drpt.load_scene("cornell-box")
LAMP, WALL = 0, 1
HOME = Orbit()


def power(shape: object) -> float:
    assert isinstance(shape, drpt.Sphere)
    assert shape.radiance is not None
    return float(sum(shape.radiance) * shape.radius**2)


@pytest.mark.parametrize("radius", [10, 60, 100])
def test_a_light_keeps_its_power(radius: float) -> None:
    lamp = edited(BOX, {LAMP: {"radius": radius}}, HOME).shapes[LAMP]
    assert isinstance(lamp, drpt.Sphere)
    assert lamp.radius == radius
    assert power(lamp) == pytest.approx(power(BOX.shapes[LAMP]), rel=ROUNDING)


def test_what_is_not_edited_stays_the_same() -> None:
    scene = edited(BOX, {LAMP: {"center": [278, 300, 280]}}, HOME)
    assert scene.shapes[1:] == BOX.shapes[1:]
    assert scene.camera == BOX.camera
    assert edited(BOX, {}, HOME) == BOX


@pytest.mark.parametrize(
    ("edit", "material"),
    [
        ({"albedo": [0.1, 0.2, 0.3]}, drpt.Diffuse((0.1, 0.2, 0.3))),
        ({"exponent": 50, "albedo": 0.5}, drpt.Phong(0.5, 50)),
        ({"exponent": None, "albedo": 0.5}, drpt.Diffuse(0.5)),
    ],
)
def test_surfaces_change(edit: dict[str, Any], material: object) -> None:
    assert edited(BOX, {WALL: edit}, HOME).shapes[WALL].material == material


def test_an_exponent_alone_keeps_the_colour() -> None:
    before = BOX.shapes[WALL].material
    assert before is not None
    after = edited(BOX, {WALL: {"exponent": 9}}, HOME).shapes[WALL].material
    assert after == drpt.Phong(before.albedo, 9)


@pytest.mark.parametrize(
    ("number", "edit", "words"),
    [
        (6, {}, "edits[6]: there are 6 shapes, counted from 0"),
        (LAMP, {"albedo": 1}, "edits[0]: 'albedo' is not allowed; it must be one of center, rad"),
        (WALL, {"radius": 1}, "edits[1]: 'radius' is not allowed; it must be one of albedo, exp"),
        (LAMP, {"radius": -3}, "edits[0].radius: -3 is not allowed; it must be a number > 0"),
        (LAMP, {"center": [0, 0]}, "edits[0].center: [0, 0] is not allowed"),
        (WALL, {"albedo": 2}, "edits[1].albedo: 2 is not allowed"),
        (WALL, {"exponent": "x"}, "edits[1].exponent: 'x' is not allowed"),
    ],
)
def test_what_is_wrong_is_named(number: int, edit: dict[str, Any], words: str) -> None:
    with pytest.raises(drpt.SceneError) as caught:
        edited(BOX, {number: edit}, HOME)
    assert words in str(caught.value)


def pivot() -> Any:
    """The middle of the room, on the camera's axis."""
    low, high = bounds(BOX.shapes)
    return np.array([*BOX.camera.eye[:2], (low[2] + high[2]) / 2])


@pytest.mark.parametrize("orbit", [Orbit(90, 0, 0), Orbit(30, 80, 1), Orbit(-250, -90, -2)])
def test_the_camera_looks_at_what_it_goes_around(orbit: Orbit) -> None:
    camera = moved(BOX, orbit)
    assert camera.target == pytest.approx(pivot())
    before, after = (
        np.linalg.norm(np.subtract(eye, pivot())) for eye in (BOX.camera.eye, camera.eye)
    )
    assert after == pytest.approx(before * 2**-orbit.zoom)


def test_the_camera_goes_right_and_up() -> None:
    """Looking along z with y up, right is −x."""
    right, up = moved(BOX, Orbit(azimuth=10)), moved(BOX, Orbit(elevation=10))
    assert right.eye[0] < BOX.camera.eye[0]
    assert up.eye[1] > BOX.camera.eye[1]


def test_right_above_is_a_place_like_any_other() -> None:
    camera = moved(BOX, Orbit(elevation=90))
    assert camera.eye[1] - pivot()[1] == pytest.approx(pivot()[2] - BOX.camera.eye[2])
    assert camera.up == pytest.approx((0, 0, 1))
