"""Sphere lights, sampled by the cap that a receiver sees, or on their whole surface."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import drjit as dr

from drpt.kernel.emitters.base import DirectionSample, direction_to
from drpt.kernel.vec import frame, greater, vec3
from drpt.kernel.warp import (
    TWO_PI,
    square_to_cone,
    square_to_projected_cap,
    square_to_sphere,
)

if TYPE_CHECKING:
    from drjit.auto import Array2f, Array3f, Bool, Float, UInt32

    from drpt.kernel.camera import Ray
    from drpt.kernel.emitters.base import LightRows, Receiver
    from drpt.kernel.intersect import Hit


@dataclass
class SphereLights:
    """Lights that are spheres, with the numbers from 0 on."""

    rows: LightRows
    count: int

    def sample(self, at: Receiver, light: UInt32, u: Array2f, *, visible: bool) -> DirectionSample:
        """Solid angle: a direction to the visible cap, or to a uniform point of the sphere."""
        if visible:
            return _sample_cap(self._cap(at, light), at.normal, u)
        row = self.rows.of(light)
        normal = square_to_sphere(u)
        target = dr.fma(normal, row.shape[3], vec3(row.shape[0], row.shape[1], row.shape[2]))
        return direction_to(at.point, target, normal, row.area)

    def inverse_pdf(self, at: Receiver, light: UInt32, ray: Ray, hit: Hit) -> Float:
        """1 / density with which samples of the visible cap find a ray."""
        return self._cap(at, light).inverse_pdf(dr.dot(at.normal, ray.direction))

    def _cap(self, at: Receiver, light: UInt32) -> _Cap:
        """The power of the point, d² − r², is summed up without the rounding of d.

        Close to the light it decides how much of its horizon is seen. A point that is not a number
        has a cap that is none, so that its samples are counted.
        """
        sphere = self.rows.of(light).shape
        to_center = vec3(sphere[0], sphere[1], sphere[2]) - at.point
        radius = sphere[3]
        distance = dr.norm(to_center)
        scale = dr.rcp(distance)
        power = dr.fma(to_center.x, to_center.x, -radius * radius)
        power = dr.fma(to_center.z, to_center.z, dr.fma(to_center.y, to_center.y, power))
        sine = dr.select(power <= 0, 0, radius * scale)
        height = dr.select(power <= 0, 0, sine * sine / (1 + dr.sqrt(power) * scale))
        axis = to_center * scale
        return _Cap(axis, distance, radius, sine, height, dr.dot(axis, at.normal))


class _Cap(NamedTuple):
    """The part of a sphere light that a receiver sees, on the unit sphere of directions.

    The half-angle σ of its cone is given by ``sine`` and ``height``, 1 − cos σ; both are 0 from
    inside the light, where it is dark. ``cosine`` is that of the incidence ω of its centre.

    Where the whole cap is above the receiver's horizon, its projection to the receiver's plane is
    an ellipse of the area π sin²σ cos ω. Directions are uniform there, so that a diffuse surface
    gets the same light from each of them (Nusselt's analogue; Ureña & Georgiev 2018). Elsewhere
    directions are uniform in the cone.
    """

    axis: Array3f
    distance: Float
    radius: Float
    sine: Float
    height: Float
    cosine: Float

    @property
    def above(self) -> Bool:
        """Whether no part of it is below the horizon."""
        return (self.cosine >= self.sine) & (self.cosine > 0)

    def inverse_pdf(self, cosine: Float) -> Float:
        """1 / density of a direction, given the cosine of its incidence."""
        projected = dr.pi * self.sine * self.sine * self.cosine
        return dr.select(self.above, projected / cosine, TWO_PI * self.height)


def _sample_cap(cap: _Cap, normal: Array3f, u: Array2f) -> DirectionSample:
    basis = frame(cap.axis)
    local_normal = basis.to_local(normal)
    lifted, cosine = square_to_projected_cap(u, cap.sine, cap.height, local_normal)
    local = dr.select(cap.above, lifted, square_to_cone(u, cap.height))
    side = dr.square(cap.distance) * (dr.square(local.x) + dr.square(local.y))
    depth = dr.sqrt(greater(dr.square(cap.radius) - side, 0))
    distance = cap.distance * local.z - depth
    return DirectionSample(basis.to_world(local), distance, cap.inverse_pdf(cosine))
