"""One number of a whole picture, in drpt and in Mitsuba: what a camera reads of one point."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from drpt import Camera, Mode, render
from drpt.crosscheck import to_mitsuba_dict
from drpt.crosscheck.variant import load_mitsuba

if TYPE_CHECKING:
    from drpt import Scene
    from drpt.scene.checks import Vector

SIDE = 16
"""Pixels of a picture; their samples are one mean."""
FOV = 1e-4
"""Of a camera that sees one point, in degrees."""


def camera_at(eye: Vector, target: Vector, up: Vector = (0, 1, 0), fov: float = FOV) -> Camera:
    """A camera that sees a point alone."""
    return Camera(eye, target, up, fov, SIDE, SIDE)


def mean_in_drpt(scene: Scene, samples: int, bounces: int = 1, mode: Mode = Mode.EXPLICIT) -> float:
    """Mean radiance of a picture."""
    image = render(scene, max(1, samples // SIDE**2), bounces, mode).image
    return float(image[..., 0].mean(dtype=np.float64))


def mean_in_mitsuba(scene: Scene, samples: int, bounces: int = 1) -> float:
    """Mean radiance of the same picture in Mitsuba, with its sampler of least noise."""
    mi = load_mitsuba()
    description = to_mitsuba_dict(scene, bounces)
    description["sensor"]["sampler"]["type"] = "ldsampler"
    image = mi.render(mi.load_dict(description), spp=max(1, samples // SIDE**2)).numpy()
    return float(image[..., 0].mean(dtype=np.float64))
