"""Rays of the pinhole camera against its definition."""

from __future__ import annotations

from math import radians, tan
from typing import TYPE_CHECKING

import numpy as np
import pytest

import drpt
from drpt.kernel.camera import make_camera
from drpt.scene.picture_plane import picture_plane
from tests.conftest import TYPES, to_device, to_host
from tests.oracle.arrays import normalize

if TYPE_CHECKING:
    from tests.oracle.arrays import Floats

ROUNDING = 5e-7  # of float32, with some ten operations on components up to 1

TILTED = drpt.Camera((1, 2, 3), (-4, 7, 5), (0.3, 1, -0.2), 55, 7, 4)


def rays(
    camera: drpt.Camera,
    pixels: list[int],
    offset: tuple[float, float] = (0.5, 0.5),
    shift: tuple[float, float, float] = (0, 0, 0),
) -> tuple[Floats, Floats]:
    device = make_camera(camera, np.array(shift, np.float64), TYPES)
    ray = device.ray(TYPES.UInt32(pixels), to_device([offset]))
    return to_host(ray.origin), to_host(ray.direction)


def expected(camera: drpt.Camera, column: float, row: float) -> Floats:
    """Direction through a point of the picture, in pixels from its top left corner."""
    forward = normalize(np.subtract(camera.target, camera.eye))
    right = normalize(np.cross(forward, camera.up))
    up = np.cross(right, forward)
    half = tan(radians(camera.fov) / 2)
    y = half * (1 - 2 * row / camera.height)
    x = half * (2 * column - camera.width) / camera.height
    return normalize(forward + x * right + y * up)


def test_points_are_seen_where_rays_to_them_go() -> None:
    where = np.array([[0, 0], [7, 4], [3.25, 1.5], [-2, 9]])
    ways = np.array([2.5 * expected(TILTED, *at) for at in where])
    found = picture_plane(TILTED).project(ways)
    assert found[:, :2] == pytest.approx(where, abs=1e-12)
    forward = normalize(np.subtract(TILTED.target, TILTED.eye))
    assert found[:, 2] == pytest.approx(ways @ forward, rel=1e-12)


def test_points_behind_the_eye_are_seen_nowhere() -> None:
    x, y, depth = picture_plane(TILTED).project(-expected(TILTED, 3, 2)[None])[0]
    assert np.isnan([x, y]).all()
    assert depth < 0


def test_middle_of_the_picture_looks_at_the_target() -> None:
    camera = drpt.Camera((278, 273, -770), (278, 273, -769), (0, 1, 0), 39, 5, 5)
    origin, direction = rays(camera, [12])
    assert origin[0] == pytest.approx([278, 273, -770])
    assert direction[0] == pytest.approx([0, 0, 1], abs=ROUNDING)


def test_right_is_forward_cross_up_and_row_0_is_the_top() -> None:
    camera = drpt.Camera((0, 0, 0), (0, 0, -1), (0, 1, 0), 90, 3, 3)
    _, direction = rays(camera, [0, 2, 6, 8])
    assert np.sign(direction[:, :2]).tolist() == [[-1, 1], [1, 1], [-1, -1], [1, -1]]


def test_looking_along_z_right_is_minus_x() -> None:
    _, direction = rays(drpt.Camera((0, 0, 0), (0, 0, 1), (0, 1, 0), 90, 3, 1), [2])
    assert direction[0, 0] < 0


def test_fov_spans_the_height() -> None:
    camera = drpt.Camera((0, 0, 0), (0, 0, -1), (0, 1, 0), 60, 2, 2)
    _, top = rays(camera, [0], offset=(1.0, 0.0))
    _, bottom = rays(camera, [2], offset=(1.0, 1.0))
    assert np.degrees(np.arccos((top * bottom).sum())) == pytest.approx(60, abs=1e-4)


@pytest.mark.parametrize("offset", [(0.5, 0.5), (0.0, 0.0), (0.25, 0.9)])
def test_rays_of_a_tilted_oblong_picture(offset: tuple[float, float]) -> None:
    pixels = list(range(TILTED.width * TILTED.height))
    origin, direction = rays(TILTED, pixels, offset)
    rows, columns = np.divmod(pixels, TILTED.width)
    truth = [
        expected(TILTED, column + offset[0], row + offset[1])
        for row, column in zip(rows, columns, strict=True)
    ]
    assert np.abs(direction - np.array(truth)).max() < ROUNDING
    assert np.abs(np.linalg.norm(direction, axis=1) - 1).max() < ROUNDING
    assert np.abs(origin - TILTED.eye).max() < ROUNDING


@pytest.mark.parametrize("length", [1e-6, 1e6])
def test_neither_up_nor_target_need_unit_length(length: float) -> None:
    scaled = drpt.Camera(
        TILTED.eye,
        np.add(TILTED.eye, length * np.subtract(TILTED.target, TILTED.eye)),
        np.multiply(TILTED.up, length),
        TILTED.fov,
        TILTED.width,
        TILTED.height,
    )
    _, direction = rays(scaled, [5, 17])
    _, truth = rays(TILTED, [5, 17])
    assert np.abs(direction - truth).max() < ROUNDING


def test_eye_is_relative_to_the_origin() -> None:
    far = drpt.Camera((1e8 + 3, 0, 0), (1e8, 0, 0), (0, 1, 0), 40, 1, 1)
    origin, direction = rays(far, [0], shift=(1e8, 0, 0))
    assert origin[0].tolist() == [3, 0, 0]
    assert direction[0] == pytest.approx([-1, 0, 0], abs=ROUNDING)


def test_the_largest_picture_has_exact_pixels() -> None:
    side = 65536
    camera = drpt.Camera((0, 0, 0), (0, 0, -1), (0, 1, 0), 90, side, side)
    _, direction = rays(camera, [0, side - 1, side * side - 1])
    corner = np.array(expected(camera, 0.5, 0.5))
    assert np.abs(np.abs(direction) - np.abs(corner)).max() < ROUNDING
    assert np.sign(direction[:, :2]).tolist() == [[-1, 1], [1, 1], [1, -1]]
