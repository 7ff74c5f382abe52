"""Pinhole camera: rays through the pixels of a picture, row 0 at the top."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians, tan
from typing import TYPE_CHECKING, NamedTuple

import drjit as dr
import numpy as np

if TYPE_CHECKING:
    from types import ModuleType

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


class PicturePlane(NamedTuple):
    """The picture at distance 1 before the eye: its top left corner and a pixel's two edges.

    Vectors (3,) from the eye; a pixel (x, y) is seen along corner + x right + y down.
    """

    corner: NDArray[np.float64]
    right: NDArray[np.float64]
    down: NDArray[np.float64]

    def project(self, ways: NDArray[np.float64]) -> NDArray[np.float64]:
        """Where vectors (n, 3) from the eye meet the picture: (x, y) in pixels and depth, (n, 3).

        ``x`` and ``y`` count from the top left corner; they are not a number behind the eye.
        """
        depth, x, y = np.linalg.solve(np.stack(self, axis=1), ways.T)
        ahead = np.where(depth > 0, depth, np.nan)
        return np.stack([x / ahead, y / ahead, depth], axis=1)


def picture_plane(camera: Camera) -> PicturePlane:
    """Return the plane of a camera's picture, in float64."""
    right, down, forward = camera.axes()
    pixel = 2 * tan(radians(camera.fov) / 2) / camera.height
    corner = forward - pixel / 2 * (camera.width * right + camera.height * down)
    return PicturePlane(corner, pixel * right, pixel * down)


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
