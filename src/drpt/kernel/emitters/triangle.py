"""Triangle lights, sampled uniformly by area."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import drjit as dr

from drpt.kernel.emitters.base import DirectionSample, direction_to
from drpt.kernel.vec import vec3
from drpt.kernel.warp import square_to_triangle

if TYPE_CHECKING:
    from drjit.auto import Array2f, Float, UInt32

    from drpt.kernel.camera import Ray
    from drpt.kernel.emitters.base import LightRows, Receiver
    from drpt.kernel.intersect import Hit


@dataclass
class TriangleLights:
    """Lights that are triangles, with the numbers from ``first`` on.

    ``corners`` are rows of 9 on the device.
    """

    rows: LightRows
    first: int
    count: int
    corners: Float

    def sample(self, at: Receiver, light: UInt32, u: Array2f, *, visible: bool) -> DirectionSample:
        """Solid angle: a direction to a uniform point of the triangle."""
        array3 = self.rows.types.Array3f
        index = dr.maximum(light, self.first) - self.first
        a, b, c = (dr.gather(array3, self.corners, 3 * index + k) for k in range(3))
        weights = square_to_triangle(u)
        target = a + weights.x * (b - a) + weights.y * (c - a)
        row = self.rows.of(light)
        normal = vec3(row.shape[0], row.shape[1], row.shape[2])
        return direction_to(at.point, target, normal, row.area)

    def inverse_pdf(self, at: Receiver, light: UInt32, ray: Ray, hit: Hit) -> Float:
        """1 / density with which samples find a ray that hits the light."""
        cosine = -dr.dot(hit.normal, ray.direction)
        return self.rows.of(light).area * cosine / dr.square(hit.distance)
