"""Pinhole camera: rays through the pixels of a picture, row 0 at the top."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import drjit as dr

from drpt.scene.picture_plane import picture_plane

if TYPE_CHECKING:
    from types import ModuleType

    import numpy as np
    from drjit.auto import Array2f, Array3f, UInt32
    from numpy.typing import NDArray

    from drpt.scene import Camera


class Ray(NamedTuple):
    """Points origin + t direction, t > 0; the direction is a unit vector."""

    origin: Array3f
    direction: Array3f


@dataclass
class DeviceCamera:
    """Eye, and the picture at distance 1 before it: its top left corner and a pixel's two edges."""

    eye: Array3f
    corner: Array3f
    right: Array3f
    down: Array3f
    width: UInt32

    def ray(self, pixel: UInt32, offset: Array2f) -> Ray:
        """Ray through the point ``offset`` in [0, 1)² of a pixel, numbered row by row."""
        row = pixel // self.width
        x = type(offset.x)(pixel - row * self.width) + offset.x
        y = type(offset.x)(row) + offset.y
        through = dr.fma(self.right, x, dr.fma(self.down, y, self.corner))
        return Ray(self.eye, dr.normalize(through))


def make_camera(camera: Camera, origin: NDArray[np.float64], types: ModuleType) -> DeviceCamera:
    """Put a camera on the device, relative to ``origin``; all of it are inputs of the kernel."""
    plane = picture_plane(camera)

    def vector(v: NDArray[np.float64]) -> Array3f:
        return types.Array3f(*(dr.opaque(types.Float32, float(x)) for x in v))

    return DeviceCamera(
        eye=vector(camera.eye - origin),
        corner=vector(plane.corner),
        right=vector(plane.right),
        down=vector(plane.down),
        width=dr.opaque(types.UInt32, camera.width),
    )
