"""A scene for the tests of checks."""

from __future__ import annotations

from drpt import Camera, Diffuse, Phong, Scene, Sphere

WIDTH, HEIGHT = 24, 16


def lit(radius: float = 1.0, distance: float = 3.0, exponent: float | None = None) -> Scene:
    """A sphere under a light."""
    material = Diffuse(0.5) if exponent is None else Phong(0.5, exponent)
    light = Sphere((0, distance, 2), radius, radiance=(3, 2, 1))
    camera = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), 30, WIDTH, HEIGHT)
    return Scene(camera, [Sphere((0, 0, 0), 1, material), light])
