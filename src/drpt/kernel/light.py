"""Lights as seen from a point: a sample of one, and the density with which it would be found."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import drjit as dr

from drpt.kernel.light_tree import Choice
from drpt.kernel.vec import frame, greater, vec3
from drpt.kernel.warp import (
    TWO_PI,
    square_to_cone,
    square_to_projected_cap,
    square_to_sphere,
    square_to_triangle,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from drjit.auto import Array2f, Array3f, Bool, Float, UInt32

    from drpt.kernel.camera import Ray
    from drpt.kernel.device_scene import DeviceScene
    from drpt.kernel.estimator import Features, Mode
    from drpt.kernel.intersect import Hit


class Receiver(NamedTuple):
    """A point of a surface, and the shading normal there, on the side that is to be lit."""

    point: Array3f
    normal: Array3f


class Aim(NamedTuple):
    """A direction to a light, the distance to it, and 1 / density per solid angle; 0 if unlit."""

    direction: Array3f
    distance: Float
    inverse_pdf: Float


class LightSample(NamedTuple):
    """A direction to a chosen light; ``inverse_pdf`` counts the choice, too."""

    direction: Array3f
    distance: Float
    radiance: Array3f
    inverse_pdf: Float


def choose_light(scene: DeviceScene, at: Receiver, active: Bool, u: Callable[[], Float]) -> Choice:
    """Discrete: one of the lights; ``u()`` is asked for where there are several."""
    if scene.light_tree is None:
        return Choice(scene.types.UInt32(0), scene.types.Float32(1))
    return scene.light_tree.choose(at, active, u())


def sample_light(
    scene: DeviceScene, features: Features, mode: Mode, at: Receiver, choice: Choice, u: Array2f
) -> LightSample:
    """Solid angle: a direction from a receiver to a chosen light."""
    light = choice.light
    aim = Aim(
        *_by_kind(
            scene,
            features,
            light,
            lambda: tuple(_aim_at_sphere(scene, mode, at, light, u)),
            lambda: tuple(_aim_at_triangle(scene, at.point, light, u)),
        )
    )
    radiance = scene.light_row(light).radiance
    return LightSample(aim.direction, aim.distance, radiance, aim.inverse_pdf / choice.pmf)


def inverse_pdf(
    scene: DeviceScene, features: Features, at: Receiver, light: UInt32, ray: Ray, hit: Hit
) -> Float:
    """1 / density with which :func:`sample_light`, sampling caps, finds a receiver's ray."""
    inverse = _by_kind(
        scene,
        features,
        light,
        lambda: _cap(scene, at, light).inverse_pdf(dr.dot(at.normal, ray.direction)),
        lambda: _area(scene, light) * -dr.dot(hit.normal, ray.direction) / dr.square(hit.distance),
    )
    tree = scene.light_tree
    return inverse if tree is None else inverse / tree.pmf(at, hit.valid, light)


def _by_kind(
    scene: DeviceScene,
    features: Features,
    light: UInt32,
    sphere: Callable[[], Any],
    triangle: Callable[[], Any],
) -> Any:
    """What the light's kind asks for; the kernel has no code for a kind that is missing."""
    if not features.triangle_light_samples:
        return sphere()
    if not features.sphere_light_samples:
        return triangle()
    return dr.select(light < scene.sphere_lights, sphere(), triangle())


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


def _cap(scene: DeviceScene, at: Receiver, light: UInt32) -> _Cap:
    """The power of the point, d² − r², is summed up without the rounding of d.

    Close to the light it decides how much of its horizon is seen. A point that is not a number
    has a cap that is none, so that its samples are counted.
    """
    row = scene.light_row(light).geometry
    to_center = vec3(row[0], row[1], row[2]) - at.point
    radius = row[3]
    distance = dr.norm(to_center)
    scale = dr.rcp(distance)
    power = dr.fma(to_center.x, to_center.x, -radius * radius)
    power = dr.fma(to_center.z, to_center.z, dr.fma(to_center.y, to_center.y, power))
    sine = dr.select(power <= 0, 0, radius * scale)
    height = dr.select(power <= 0, 0, sine * sine / (1 + dr.sqrt(power) * scale))
    axis = to_center * scale
    return _Cap(axis, distance, radius, sine, height, dr.dot(axis, at.normal))


def _aim_at_sphere(scene: DeviceScene, mode: Mode, at: Receiver, light: UInt32, u: Array2f) -> Aim:
    if mode.samples_cones:
        return _aim_at_cap(_cap(scene, at, light), at.normal, u)
    row = scene.light_row(light).geometry
    normal = square_to_sphere(u)
    radius = row[3]
    target = dr.fma(normal, radius, vec3(row[0], row[1], row[2]))
    return _aim_at_point(at.point, target, normal, _area(scene, light))


def _aim_at_cap(cap: _Cap, normal: Array3f, u: Array2f) -> Aim:
    basis = frame(cap.axis)
    local_normal = basis.to_local(normal)
    lifted, cosine = square_to_projected_cap(u, cap.sine, cap.height, local_normal)
    local = dr.select(cap.above, lifted, square_to_cone(u, cap.height))
    side = dr.square(cap.distance) * (dr.square(local.x) + dr.square(local.y))
    depth = dr.sqrt(greater(dr.square(cap.radius) - side, 0))
    distance = cap.distance * local.z - depth
    return Aim(basis.to_world(local), distance, cap.inverse_pdf(cosine))


def _aim_at_triangle(scene: DeviceScene, point: Array3f, light: UInt32, u: Array2f) -> Aim:
    index = dr.maximum(light, scene.sphere_lights) - scene.sphere_lights
    a, b, c = (dr.gather(scene.types.Array3f, scene.light_corners, 3 * index + k) for k in range(3))
    weights = square_to_triangle(u)
    target = a + weights.x * (b - a) + weights.y * (c - a)
    row = scene.light_row(light).geometry
    return _aim_at_point(point, target, vec3(row[0], row[1], row[2]), _area(scene, light))


def _aim_at_point(point: Array3f, target: Array3f, normal: Array3f, area: Float) -> Aim:
    """Aim at a point that is uniform on an area; only its front, where its normal is, emits."""
    way = target - point
    distance = dr.norm(way)
    direction = way / distance
    cosine = greater(-dr.dot(direction, normal), 0)
    return Aim(direction, distance, area * cosine / dr.square(distance))


def _area(scene: DeviceScene, light: UInt32) -> Float:
    return scene.light_row(light).area


def power_heuristic(ratio: Float) -> Float:
    """Weight of a sample whose density is 1 / ``ratio`` times that of the other technique.

    Source: Veach & Guibas 1995, exponent 2, in the form that holds for ratios of 0 and infinity.
    """
    return dr.rcp(1 + dr.square(ratio))
