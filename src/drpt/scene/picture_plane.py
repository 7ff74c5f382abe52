"""The plane of a camera's picture, on the host, in float64."""

from __future__ import annotations

from math import radians, tan
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from drpt.scene.model import Camera

    Array = NDArray[np.float64]


class PicturePlane(NamedTuple):
    """The picture at distance 1 before the eye: its top left corner and a pixel's two edges.

    Vectors (3,) from the eye; a pixel (x, y) is seen along corner + x right + y down.
    """

    corner: Array
    right: Array
    down: Array

    def project(self, ways: Array) -> Array:
        """Where vectors (n, 3) from the eye meet the picture: (x, y) in pixels and depth, (n, 3).

        ``x`` and ``y`` count from the top left corner; they are not a number behind the eye.
        """
        x, y, depth = self.homogeneous(ways).T
        ahead = np.where(depth > 0, depth, np.nan)
        return np.stack([x / ahead, y / ahead, depth], axis=1)

    def homogeneous(self, ways: Array) -> Array:
        """Homogeneous coordinates (x depth, y depth, depth) of vectors from the eye, (n, 3)."""
        depth, x, y = np.linalg.solve(np.stack(self, axis=1), ways.T)
        return np.stack([x, y, depth], axis=1)


def picture_plane(camera: Camera) -> PicturePlane:
    """Return the plane of a camera's picture."""
    right, down, forward = camera.axes()
    pixel = 2 * tan(radians(camera.fov) / 2) / camera.height
    corner = forward - pixel / 2 * (camera.width * right + camera.height * down)
    return PicturePlane(corner, pixel * right, pixel * down)
