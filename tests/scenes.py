"""Small scenes that render in no time."""

from __future__ import annotations

from dataclasses import replace

import drpt

LAMP = drpt.Sphere((0, 2, 1), 0.5, radiance=(3, 2, 1))
BALL = drpt.Sphere((0, 0, 0), 1, material=drpt.Diffuse((0.9, 0.5, 0.2)))


def scene_of(*shapes: drpt.Sphere | drpt.Mesh, width: int = 12, height: int = 8) -> drpt.Scene:
    camera = drpt.Camera((0, 1, 5), (0, 0.6, 0), (0, 1, 0), 50, width, height)
    return drpt.Scene(camera=camera, shapes=shapes)


def seen_by(scene: drpt.Scene, width: int, height: int) -> drpt.Scene:
    """The same scene in another resolution."""
    return drpt.Scene(replace(scene.camera, width=width, height=height), scene.shapes)


LAMP_AND_BALL = scene_of(BALL, LAMP)
