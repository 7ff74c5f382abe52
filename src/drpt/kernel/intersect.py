"""Rays against primitives: the closest hit, what blocks the way, and the surface that is hit."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import drjit as dr

from drpt.kernel.vec import vec3

if TYPE_CHECKING:
    from collections.abc import Iterator

    from drjit.auto import Array3f, Bool, Float, UInt32

    from drpt.kernel.camera import Ray
    from drpt.kernel.device_scene import Ball, DeviceScene
    from drpt.kernel.estimator import Features
    from drpt.kernel.facets import Facet

SPAWN_OFFSET = 2.0**-20
"""How far off its surface a ray starts, relative to the coordinates there: 16 half ulps.

A hit point that was projected back onto its surface, and the test against the same surface, are
together off by about ten half ulps at the most (Wächter & Binder 2019, Ray Tracing Gems, ch. 6).
"""


class Hit(NamedTuple):
    """Where a ray meets a surface.

    ``point`` lies off the surface by its rounding error, on the side that the ray comes from, and
    both unit normals face that side. ``front`` tells whether it is the side that emits: outside
    of a sphere, the counter-clockwise side of a triangle.
    """

    valid: Bool
    distance: Float
    primitive: UInt32
    point: Array3f
    normal: Array3f
    shading_normal: Array3f
    front: Bool


def closest_hit(scene: DeviceScene, features: Features, ray: Ray, active: Bool) -> Hit:
    """The first surface that a ray meets."""
    t, primitive = _closest(scene, features, ray)
    return _surface(scene, features, ray, t, primitive, active & (t < dr.inf))


def _closest(scene: DeviceScene, features: Features, ray: Ray) -> tuple[Float, UInt32]:
    nearest, primitive = scene.types.Float32(dr.inf), scene.types.UInt32(0)
    for number, (inside, t) in _candidates(scene, ray):
        closer = inside & (t < nearest)
        nearest = dr.select(closer, t, nearest)
        primitive = dr.select(closer, number, primitive)
    return nearest, primitive


def occluded(scene: DeviceScene, ray: Ray, distance: Float, light: UInt32) -> Bool:
    """Whether anything but the light itself stands on the first ``distance`` of a ray."""
    blocked = scene.types.Bool(False)
    for number, (inside, t) in _candidates(scene, ray, shadows=True):
        between = inside & (t < distance)
        if number >= scene.first_light:
            between &= light != number - scene.first_light
        blocked |= between
    return blocked


def _candidates(
    scene: DeviceScene, ray: Ray, *, shadows: bool = False
) -> Iterator[tuple[int, tuple[Bool, Float]]]:
    """Number of each primitive, whether the ray's line meets it before it, and where."""
    for index, (facet, blocks) in enumerate(zip(scene.facets, scene.blockers, strict=True)):
        if blocks or not shadows:
            number = index if index < scene.first_sphere else index + len(scene.balls)
            yield number, _meet_facet(ray, facet)
    for index, ball in enumerate(scene.balls):
        number = scene.first_sphere + index
        if not (shadows and scene.light_count == 1 and number >= scene.first_light):
            yield number, _meet_sphere(ray, ball)


def _meet_facet(ray: Ray, facet: Facet) -> tuple[Bool, Float]:
    """Meeting point with the plane, by the constants of the facet alone, and the slabs around."""
    main = max(facet.normal, key=abs)
    normal = tuple(x / main for x in facet.normal)
    height = facet.offset / main - _dot(normal, ray.origin)
    t = height * dr.rcp(_dot(normal, ray.direction))
    point = dr.fma(ray.direction, t, ray.origin)
    inside = t > 0
    for slab in facet.slabs:
        x = _dot(slab.direction, point)
        if slab.low > -dr.inf:
            inside &= x >= slab.low
        if slab.high < dr.inf:
            inside &= x <= slab.high
    return inside, t


def _dot(constant: tuple[float, ...], v: Array3f) -> Float:
    """Inner product that leaves out the constant's zeros and spares its ones."""
    terms = sorted(zip(constant, v, strict=True), key=lambda term: abs(term[0]) != 1)
    (c, x), *others = [(c, x) for c, x in terms if c != 0]
    total = x * c
    for c, x in others:
        total = dr.fma(x, c, total)
    return total


def _meet_sphere(ray: Ray, ball: Ball) -> tuple[Bool, Float]:
    """First meeting with a sphere beyond the origin, the ray's direction being a unit vector.

    Source: Haines et al. 2019, "Precision Improvements for Ray/Sphere Intersection" (Ray Tracing
    Gems, ch. 7).
    """
    f = ray.origin - ball.center
    b = -dr.dot(f, ray.direction)
    closest = dr.fma(ray.direction, b, f)
    r2 = ball.radius * ball.radius
    discriminant = r2 - dr.dot(closest, closest)
    root: Any = dr.copysign(dr.sqrt(discriminant), b)
    q = b + root
    c = dr.dot(f, f) - r2
    other = c / q
    near, far = dr.minimum(q, other), dr.maximum(q, other)
    return (discriminant > 0) & (far > 0), dr.select(near > 0, near, far)


def _surface(
    scene: DeviceScene, features: Features, ray: Ray, t: Float, primitive: UInt32, valid: Bool
) -> Hit:
    point, normal, reach = _on_primitive(scene, features, ray, t, primitive, valid)
    front = dr.dot(normal, ray.direction) < 0
    facing = dr.select(front, normal, -normal)
    shading_normal = facing
    if features.interpolated_normals:
        shading_normal = _interpolated_normal(scene, point, facing, primitive, valid)
    spawn = dr.fma(facing, SPAWN_OFFSET * reach, point)
    return Hit(valid, t, primitive, spawn, facing, shading_normal, front)


def _on_primitive(
    scene: DeviceScene, features: Features, ray: Ray, t: Float, primitive: UInt32, valid: Bool
) -> tuple[Array3f, Array3f, Float]:
    """The point at ``t`` moved onto its primitive, the normal, and the largest coordinate used."""
    row = scene.geometry_row(primitive, valid)
    vector = vec3(row[0], row[1], row[2])
    p = dr.fma(ray.direction, t, ray.origin)
    on_facet = dr.fma(vector, row[3] - dr.dot(vector, p), p)
    outward = dr.normalize(p - vector)
    on_sphere = dr.fma(outward, row[3], vector)
    if not features.spheres:
        return on_facet, vector, _largest(on_facet)
    if not features.triangles:
        return on_sphere, outward, _largest(on_sphere) + row[3]
    is_sphere = (primitive >= scene.first_sphere) & (primitive < scene.first_light_triangle)
    point = dr.select(is_sphere, on_sphere, on_facet)
    reach = _largest(point) + dr.select(is_sphere, row[3], 0)
    return point, dr.select(is_sphere, outward, vector), reach


def _largest(v: Array3f) -> Float:
    return dr.maximum(dr.maximum(dr.abs(v.x), dr.abs(v.y)), dr.abs(v.z))


def _interpolated_normal(
    scene: DeviceScene, point: Array3f, facing: Array3f, primitive: UInt32, valid: Bool
) -> Array3f:
    """The corners' normals weighted by barycentric coordinates, on the side of ``facing``."""
    types = scene.types
    smooth = valid & (primitive >= scene.first_smooth) & (primitive < scene.first_sphere)
    first = 6 * (primitive - scene.first_smooth)
    a, b, c, normal_a, normal_b, normal_c = (
        dr.gather(types.Array3f, scene.smooth, first + k, smooth) for k in range(6)
    )
    edge_b, edge_c, spoke = b - a, c - a, point - a
    area = dr.cross(edge_b, edge_c)
    scale = dr.rcp(dr.squared_norm(area))
    weight_b = dr.dot(dr.cross(spoke, edge_c), area) * scale
    weight_c = dr.dot(dr.cross(edge_b, spoke), area) * scale
    mixed = (1 - weight_b - weight_c) * normal_a + weight_b * normal_b + weight_c * normal_c
    unit = dr.normalize(mixed)
    oriented = dr.select(dr.dot(unit, facing) < 0, -unit, unit)
    return dr.select(smooth, oriented, facing)
