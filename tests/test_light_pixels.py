"""Pixels that a light touches, against closed forms and against what camera rays see."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

import drpt
from drpt.light_pixels import light_pixels

if TYPE_CHECKING:
    from tests.oracle.arrays import Floats

WIDTH, HEIGHT = 40, 30
CAMERA = drpt.Camera((0, 0, 0), (0, 0, -1), (0, 1, 0), 90, WIDTH, HEIGHT)
SCALE = HEIGHT / 2  # pixels of a length of 1 at distance 1
FINE = 64
"""Points along a side of a pixel that look for the light."""
CIRCUMSCRIBED = 1.01 / np.cos(np.pi / 64)
"""Radius of the polygon about a sphere over that of the sphere, and what a few pixels add."""


def mask(*lights: drpt.Sphere | drpt.Mesh) -> np.ndarray:
    return light_pixels(drpt.Scene(CAMERA, lights))


def triangle(*corners: tuple[float, float, float]) -> drpt.Mesh:
    return drpt.Mesh(corners, [(0, 1, 2)], radiance=1)


def at(x: float, y: float, depth: float) -> tuple[float, float, float]:
    """The point that is seen at a place of the picture, in pixels from its top left corner."""
    across, up = (x - WIDTH / 2) / SCALE, (HEIGHT / 2 - y) / SCALE
    return across * depth, up * depth, -depth


def places() -> tuple[Floats, Floats]:
    """Directions (height, width, FINE²) x and y, z is -1, of points of all pixels."""
    offsets = (np.arange(FINE) + 0.5) / FINE
    x, y = (np.add.outer(np.arange(size), offsets) for size in (WIDTH, HEIGHT))
    across, up = (x - WIDTH / 2) / SCALE, (HEIGHT / 2 - y) / SCALE
    shape = HEIGHT, WIDTH, FINE, FINE
    across, up = across[None, :, None, :], up[:, None, :, None]
    flat = HEIGHT, WIDTH, FINE**2
    return np.broadcast_to(across, shape).reshape(flat), np.broadcast_to(up, shape).reshape(flat)


def sphere_is_seen(center: tuple[float, float, float], radius: float) -> np.ndarray:
    """Whether a point of each pixel shows a sphere: (d·c)² ≥ |d|² (c² - r²), and d·c > 0."""
    x, y = places()
    along = x * center[0] + y * center[1] - center[2]
    rest = np.square(center).sum() - radius**2
    seen: np.ndarray = (along > 0) & (along**2 >= (x**2 + y**2 + 1) * rest)
    return np.asarray(seen.any(axis=2))


SPHERES = [
    ((0.3, 0.2, -2.0), 0.5),  # an ellipse
    ((-1.9, 1.2, -2.0), 0.4),  # at the corner of the picture
    ((0.0, -1.5, -1.0), 1.6),  # half of it behind the eye: a hyperbola
    ((0.05, 0.05, -3.0), 0.01),  # within one pixel
    ((0.0, 1.0, 0.1), 1.0),  # close before the eye
]


@pytest.mark.parametrize(("center", "radius"), SPHERES)
def test_pixels_of_a_sphere_are_those_of_its_outline(
    center: tuple[float, float, float], radius: float
) -> None:
    found = mask(drpt.Sphere(center, radius, radiance=1))
    assert found[sphere_is_seen(center, radius)].all()
    distance = float(np.linalg.norm(center))
    larger = min(radius * CIRCUMSCRIBED, 0.9999 * distance)
    assert sphere_is_seen(center, larger)[found].all()


def test_the_outline_of_a_sphere_is_an_ellipse() -> None:
    """Its half axes: towards the middle of the picture, and across, in closed form.

    The cone about the direction at an angle θ from the axis, of half angle α, meets the plane at
    distance 1 from tan(θ - α) to tan(θ + α); across, the greatest angle has the tangent
    sin α / sqrt(cos² α - sin² θ).
    """
    theta, distance, radius = 0.3, 3.0, 0.6
    alpha = np.arcsin(radius / distance)
    center = distance * np.sin(theta), 0.0, -distance * np.cos(theta)
    found = mask(drpt.Sphere(center, radius, radiance=1))
    columns, rows = np.flatnonzero(found.any(axis=0)), np.flatnonzero(found.any(axis=1))
    ends = WIDTH / 2 + SCALE * np.tan([theta - alpha, theta + alpha])
    assert columns[[0, -1]].tolist() == np.floor(ends).tolist()
    half = SCALE * np.sin(alpha) / np.sqrt(np.cos(alpha) ** 2 - np.sin(theta) ** 2)
    ends = HEIGHT / 2 + np.array([-half, half])
    assert rows[[0, -1]].tolist() == np.floor(ends).tolist()


def test_pixels_of_a_triangle_are_those_that_it_touches() -> None:
    """Columns 8 to 10 in the first row, up to where the slanted edge crosses it in the second."""
    found = mask(triangle(at(8.1, 6.1, 2), at(10.9, 6.1, 5), at(8.1, 7.9, 3)))
    assert np.argwhere(found).tolist() == [[6, 8], [6, 9], [6, 10], [7, 8], [7, 9]]


def test_a_triangle_is_clipped_where_it_goes_behind_the_eye() -> None:
    """A strip of floor, one below the eye, that reaches from depth 2 to behind the eye.

    At depth d, the floor's point (x, -1, -d) is at column 20 + 15 x / d and row 15 + 15 / d. Left
    of it is x = 0, right the line from (1, -2) over (1/2, 0) to (0, 2) in (x, z).
    """
    found = mask(triangle((0, -1, -2), (1, -1, -2), (0, -1, 2)))
    rows = np.arange(HEIGHT)
    expected = np.zeros((HEIGHT, WIDTH), bool)
    for row in rows[22:]:  # depth 2 is at row 22.5
        depths = SCALE / (np.clip([row, row + 1], 22.5, HEIGHT) - HEIGHT / 2)
        right = WIDTH / 2 + SCALE * (0.5 + depths / 4) / depths
        expected[row, 19 : int(np.floor(right.max())) + 1] = True  # column 19: x = 20 is its edge
    assert (found == expected).all()


def test_a_triangle_behind_the_eye_is_nowhere() -> None:
    assert not mask(triangle((-9, -9, 1), (9, -9, 1), (0, 9, 1))).any()


def test_a_triangle_about_the_picture_is_everywhere() -> None:
    assert mask(triangle((-9, -9, -1), (9, -9, -1), (0, 9, -1))).all()


def test_a_light_around_the_eye_or_through_it_is_everywhere() -> None:
    assert mask(drpt.Sphere((0, 0, 0.5), 1, radiance=1)).all()
    assert mask(drpt.Sphere((0, 0, 0), 1, radiance=1)).all()
    assert mask(triangle((-1, 0, 1), (1, 0, 1), (0, 0, -2))).all()


def test_shapes_that_do_not_emit_are_left_out() -> None:
    dull = drpt.Sphere((0, 0, -3), 1, drpt.Diffuse(0.5))
    black = drpt.Sphere((0, 0, -3), 1, radiance=0)
    assert not mask(dull, black).any()


def test_many_triangles_are_those_of_each() -> None:
    """More than are clipped at once."""
    rng = np.random.default_rng(0)
    corners = rng.uniform((-4, -3, -4), (4, 3, 1), (3000, 3)) + rng.normal(
        scale=0.03, size=(3, 3000, 3)
    )
    corners = corners.swapaxes(0, 1)
    whole = drpt.Mesh(corners.reshape(-1, 3), np.arange(9000).reshape(-1, 3), radiance=1)
    few = [0, 1, 2, 1500, 2998, 2999]
    parts = mask(*(triangle(*map(tuple, corners[k])) for k in few))
    assert parts.any()
    assert mask(whole)[parts].all()


@pytest.mark.parametrize("name", ["cornell-box-small-light", "many-lights", "veach"])
def test_rays_find_lights_in_these_pixels_alone(name: str) -> None:
    scene = drpt.load_scene(name).resized(height=24)
    found = light_pixels(scene)
    shown = drpt.render(scene, 256, 0, error=False).image.max(axis=2) > 0
    assert found[shown].all()
    assert found.sum() <= 1.1 * shown.sum() + 2
