"""Mitsuba's perspective sensors as cameras."""

from __future__ import annotations

from contextlib import suppress
from math import atan, degrees, hypot, radians, tan
from typing import TYPE_CHECKING

import numpy as np

from drpt.crosscheck.geometry import SIMILAR, uniform_scale
from drpt.scene import Camera, SceneError

if TYPE_CHECKING:
    from drpt.crosscheck.elements import Element

OPTICS = ("fov", "fov_axis", "focal_length", "to_world", "near_clip", "far_clip", "focus_distance")
SHUTTER = ("shutter_open", "shutter_close")
CENTRE = ("principal_point_offset_x", "principal_point_offset_y")
WIDTH, HEIGHT = 768, 576
"""Mitsuba's size of a film, in pixels, where none is given."""
NEGATIVE = hypot(36, 24)
"""Diagonal, in millimetres, of the film that a focal length is for."""


def camera(sensor: Element) -> Camera:
    """Return the camera of an element; raise `SceneError` if drpt has nothing like it."""
    if sensor.type != "perspective":
        raise sensor.refuse("drpt has no such camera; it must be perspective")
    sensor.allow(*OPTICS, *SHUTTER, *CENTRE)
    width, height = _size(sensor)
    with sensor.blamed():
        if any(sensor.number(name, 0) for name in CENTRE):
            raise SceneError("its principal point is moved; it must be in the middle")
        axes = sensor.matrix()[:3, :3]
        if abs((uniform_scale(axes) or 0) - 1) > SIMILAR:
            raise SceneError("its to_world scales or shears; it may only rotate and translate")
        if np.linalg.det(axes) < 0:
            raise SceneError("its to_world mirrors the picture; it may only rotate and translate")
        eye, _, up, forward = sensor.matrix()[:3, [3, 0, 1, 2]].T
        return Camera(eye, eye + forward, up, _fov(sensor, width / height), width, height)


def _size(sensor: Element) -> tuple[int, int]:
    """Return the width and the height of the film."""
    film = sensor.only("film")
    if film is None:
        return WIDTH, HEIGHT
    if film.type != "hdrfilm":
        raise film.refuse("drpt has no such film; it must be hdrfilm")
    width, height = film.whole("width", WIDTH), film.whole("height", HEIGHT)
    if min(width, height) < 1:
        raise film.refuse(f"its size is {width}x{height}; it must have pixels")
    whole = {"crop_offset_x": 0, "crop_offset_y": 0, "crop_width": width, "crop_height": height}
    for name, value in whole.items():
        if film.get(name, value) != value:
            raise film.refuse(f"its {name} is {film.get(name, value)}; drpt renders no part alone")
    return width, height


def _fov(sensor: Element, aspect: float) -> float:
    """Return the vertical field of view in degrees; `aspect` is width / height."""
    axis = sensor.text("fov_axis", "x").lower()
    if sensor.get("fov", None) is None:
        fov, axis = _fov_of_lens(sensor), "diagonal"
    elif sensor.get("focal_length", None) is None:
        fov = sensor.number("fov", 0)
    else:
        raise SceneError("it has both a fov and a focal_length; it must have one of them")
    if not 0 < fov < 180:
        raise SceneError(f"its fov is {fov:g}; it must be > 0 and < 180 degrees")
    smaller, larger = ("y", "x") if aspect > 1 else ("x", "y")
    axis = {"smaller": smaller, "larger": larger}.get(axis, axis)
    height = {"x": 1 / aspect, "y": 1.0, "diagonal": 1 / hypot(aspect, 1)}.get(axis)
    if height is None:
        raise SceneError(f"there is no fov_axis {axis!r}")
    return fov if axis == "y" else degrees(2 * atan(height * tan(radians(fov / 2))))


def _fov_of_lens(sensor: Element) -> float:
    """Return the diagonal field of view in degrees, of a focal length such as 50mm."""
    text = sensor.text("focal_length", "50mm")
    with suppress(ValueError):
        if (length := float(text.removesuffix("mm"))) > 0:
            return degrees(2 * atan(NEGATIVE / (2 * length)))
    raise SceneError(f"its focal_length is {text!r}; it must be millimetres, such as '50mm'")
