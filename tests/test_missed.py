"""Light that is seen directly, but that a picture has missed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

import drpt
from drpt.missed import FACTOR, before_lights, missed
from drpt.scene.picture_plane import picture_plane

if TYPE_CHECKING:
    from tests.oracle.arrays import Floats

SIDE = 16
CAMERA = drpt.Camera((0, 0, 10), (0, 0, 0), (0, 1, 0), 20, SIDE, SIDE)
PIXEL = 2 * np.tan(np.radians(10)) / SIDE * 10  # width of a pixel 10 away
LAMP = drpt.Sphere((PIXEL / 2, PIXEL / 2, 0), 0.1 * PIXEL, radiance=100)
LAMP_PIXEL = SIDE // 2 - 1, SIDE // 2


def project(points: Floats) -> Floats:
    return picture_plane(CAMERA).project(points - np.asarray(CAMERA.eye))


def test_a_lamp_is_found_in_its_pixel() -> None:
    mask = before_lights(drpt.Scene(CAMERA, [LAMP]), project)
    assert np.argwhere(mask).tolist() == [list(LAMP_PIXEL)]


def test_a_triangle_is_found_where_it_is() -> None:
    corners = np.array([[0.1, 0.1, 0], [2.9, 0.1, 0], [0.1, 1.9, 0]]) * PIXEL
    light = drpt.Mesh(corners, [[0, 1, 2]], radiance=1)
    mask = before_lights(drpt.Scene(CAMERA, [light]), project)
    assert np.argwhere(mask).tolist() == [[y, x] for y in (6, 7) for x in (8, 9, 10)]


def test_a_light_around_the_eye_may_be_anywhere() -> None:
    light = drpt.Sphere((0, 0, 10), 1, radiance=1)
    assert before_lights(drpt.Scene(CAMERA, [light]), project).all()


def test_a_light_out_of_view_is_nowhere() -> None:
    light = drpt.Sphere((-50, 50, 0), 1, radiance=1)
    assert not before_lights(drpt.Scene(CAMERA, [light]), project).any()


@pytest.mark.parametrize(("value", "lacking"), [(0.0, 3.0), (1.5, 1.5), (3.0, 0.0), (9.0, 0.0)])
@pytest.mark.parametrize("elsewhere", [0.0, 2.0])
@pytest.mark.parametrize("share", [0.0, 0.25, 1.0])
def test_what_is_lacking_counts_relative_to_what_there_is(
    value: float, lacking: float, elsewhere: float, share: float
) -> None:
    """Emission is 3, of which a picture has found less, or more, and light from elsewhere.

    Its estimated error tells a share of it.
    """
    asked = []

    def seen(pixels: range, rays: int) -> Floats:
        asked.append((pixels, rays))
        return np.full((len(pixels), 3), 3.0)

    image = np.zeros((SIDE, SIDE, 3))
    image[LAMP_PIXEL] = value + elsewhere
    scene = drpt.Scene(CAMERA, [LAMP])
    truth = value + elsewhere + lacking
    expected = lacking**2 / (truth**2 + 0.01)
    told = np.full_like(image, expected * share)
    relative = missed(scene, image, told, 4096, project, seen, lambda _: np.full((1, 3), value))
    assert relative == pytest.approx((1 - share) * expected / SIDE**2)
    pixel = LAMP_PIXEL[0] * SIDE + LAMP_PIXEL[1]
    assert asked == [(range(pixel, pixel + 1), FACTOR * 4096)]


def test_a_render_does_not_stop_before_it_has_seen_the_lamp() -> None:
    """It covers a thousandth of one pixel; all else is black, without noise."""
    lamp = drpt.Sphere(LAMP.center, 0.018 * PIXEL, radiance=1000)
    result = drpt.render(drpt.Scene(CAMERA, [lamp]), 512, 0, seed=1, target_error=1e-4)
    assert result.spp == 512
    assert result.error_uncertain
    assert "error uncertain" in str(result)
    assert result.metadata["error_uncertain"] is True
