"""Rays against primitives: the closest hit, what blocks the way, and the surface that is hit."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import drjit as dr

from drpt.kernel.meet import (
    across,
    dot_constant,
    meet_facet,
    meet_solid,
    meet_sphere,
    power_of_point,
    solid_blocks,
)
from drpt.kernel.scene_geometry import SurfaceRow
from drpt.kernel.vec import greater, largest, types_of, vec3

if TYPE_CHECKING:
    from collections.abc import Iterator

    from drjit.auto import Array3f, Array4f, Bool, Float, UInt32

    from drpt.kernel.camera import Ray
    from drpt.kernel.estimator import Features
    from drpt.kernel.meet import Ball
    from drpt.kernel.scene_geometry import ManySpheres, SceneGeometry


SPAWN_OFFSET = 2.0**-20
"""How far off its surface a ray starts, relative to the coordinates there: 16 half ulps.

A hit point that was projected back onto its surface, and the test against the same surface, are
together off by about ten half ulps at the most (Wächter & Binder 2019, Ray Tracing Gems, ch. 6).
For a triangle of a mesh, whose test starts from its corners, those are coordinates, too. From a
polygon it starts as far again back along the ray that has come: in a corner, a point that was
rounded to behind the other wall returns to where that ray was.
"""
COINCIDENT = 2.0**-20
"""Up to which difference surfaces are one, relative to the coordinates and the distance to them.

What shows the front of a light there shows the light: a lamp flush with a wall is seen, and not
shaded by it. The back of a light hides nothing. Of two such lights the later one counts.
"""


UNKNOWN = 2**32 - 1
"""Stands for the number of a facet where it is not known which one a ray meets."""


class Known(NamedTuple):
    """The number of the facet that a ray is known to meet first, or `UNKNOWN`, and its row."""

    facet: UInt32
    row: SurfaceRow


class Hit(NamedTuple):
    """Where a ray meets a surface.

    ``point`` lies off the surface by its rounding error, towards where the ray comes from, and both
    unit normals face that side. ``front`` tells whether it is the side that emits: outside
    of a sphere, the counter-clockwise side of a triangle. ``material`` is the row of its material,
    black on lights.
    """

    valid: Bool
    distance: Float
    primitive: UInt32
    point: Array3f
    normal: Array3f
    shading_normal: Array3f
    front: Bool
    material: Array4f


def closest_hit(
    geometry: SceneGeometry, features: Features, ray: Ray, active: Bool, known: Known | None = None
) -> Hit:
    """The first surface that a ray meets; it is looked for where it is not known."""
    if known is None:
        nearest, primitive = _nearest(geometry, ray, active)
        row = geometry.row(primitive, active & (nearest < dr.inf))
    else:
        nearest, primitive, row = _known_or_nearest(geometry, ray, active, known)
    return _surface(geometry, features, ray, nearest, primitive, row, active & (nearest < dr.inf))


def _nearest(geometry: SceneGeometry, ray: Ray, active: Bool) -> tuple[Float, UInt32]:
    """How far it is to the first primitive that a ray meets, and its number."""
    nearest, primitive = geometry.types.Float32(dr.inf), geometry.types.UInt32(0)
    for solid in geometry.solids:
        number, met, t = meet_solid(ray, solid)
        closer = met & (t < nearest)
        nearest = dr.select(closer, t, nearest)
        primitive = dr.select(closer, number, primitive)
    for number, met, t in _surfaces_and_balls(geometry, ray, active):
        closer = met & (t <= nearest)
        nearest = dr.select(closer, t, nearest)
        primitive = dr.select(closer, number, primitive)
    if geometry.many_spheres is not None:
        nearest, primitive = _or_of_many(geometry.many_spheres, ray, active, nearest, primitive)
    return _or_light_triangle(geometry, ray, active, nearest, primitive)


def _known_or_nearest(
    geometry: SceneGeometry, ray: Ray, active: Bool, known: Known
) -> tuple[Float, UInt32, SurfaceRow]:
    """The same, and the row of the primitive; lanes of which all is known jump over the search."""

    def look_up() -> tuple[Any, ...]:
        plane = known.row.shape
        normal = vec3(plane[0], plane[1], plane[2])
        height = plane[3] - dr.dot(normal, ray.origin)
        return height * dr.rcp(dr.dot(normal, ray.direction)), known.facet, *known.row

    def search() -> tuple[Any, ...]:
        nearest, primitive = _nearest(geometry, ray, active)
        return nearest, primitive, *geometry.row(primitive, active & (nearest < dr.inf))

    nearest, primitive, *row = dr.if_stmt((), known.facet != UNKNOWN, look_up, search)
    return nearest, primitive, SurfaceRow(*row)


def light_hit(geometry: SceneGeometry, features: Features, ray: Ray, active: Bool) -> Hit:
    """The first surface that a ray from a surface meets if that is a light, else nothing.

    Few lights are looked for first, and where there is one, what stands before it.
    """
    if geometry.many_spheres is not None or geometry.light_mesh is not None:
        hit = closest_hit(geometry, features, ray, active)
        return hit._replace(valid=hit.valid & (hit.primitive >= geometry.first_light))
    nearest, primitive = geometry.types.Float32(dr.inf), geometry.types.UInt32(geometry.first_light)
    for number, ball in geometry.balls:
        if number >= geometry.first_light:
            met, t = meet_sphere(ray, ball)
            closer = met & (t <= nearest)
            nearest = dr.select(closer, t, nearest)
            primitive = dr.select(closer, number, primitive)
    nearest, primitive = _or_light_triangle(geometry, ray, active, nearest, primitive)
    seen = active & (nearest < dr.inf)
    seen &= ~occluded(geometry, ray, nearest, primitive - geometry.first_light, seen)
    row = geometry.row(primitive, seen)
    return _surface(geometry, features, ray, nearest, primitive, row, seen)


def _or_light_triangle(
    geometry: SceneGeometry, ray: Ray, active: Bool, nearest: Float, primitive: UInt32
) -> tuple[Float, UInt32]:
    """The distance and number of a light's triangle that is nearer than what has been found."""
    for number, met, t, front in _light_triangles(geometry, ray, active):
        slack = _slack(ray, t)
        closer = met & (t + dr.select(front, -slack, slack) < nearest)
        nearest = dr.select(closer, t, nearest)
        primitive = dr.select(closer, number, primitive)
    return nearest, primitive


def occluded(
    geometry: SceneGeometry, ray: Ray, distance: Float, light: UInt32, active: Bool
) -> Bool:
    """Whether a ray meets anything before the light at this ``distance``, or on top of it."""
    target = geometry.first_light + light
    slack = _slack(ray, distance)
    before, beyond = distance - slack, distance + slack
    blocked = geometry.types.Bool(False)
    if geometry.mesh is not None:
        blocked = geometry.mesh.blocks(ray, before, active)
    for solid in geometry.solids:
        if solid.shading:
            blocked |= solid_blocks(ray, solid, before)
    for number, met, t in _surfaces_and_balls(geometry, ray, active, target):
        reflects = isinstance(number, int) and number < geometry.first_light
        reach = before if reflects else dr.select(number > target, beyond, before)
        blocked |= met & (t < reach)
    for number, met, t, front in _light_triangles(geometry, ray, active, target):
        blocked |= met & (t < dr.select(front & (number > target), beyond, before))
    if geometry.many_spheres is not None:
        open_ = active & ~blocked
        blocked |= _many_block(geometry.many_spheres, ray, open_, target, before, beyond)
    return blocked


def _slack(ray: Ray, t: Float) -> Float:
    return COINCIDENT * (t + largest(ray.origin))


def _surfaces_and_balls(
    geometry: SceneGeometry, ray: Ray, active: Bool, target: UInt32 | None = None
) -> Iterator[tuple[Any, Bool, Float]]:
    """What a ray may meet first: a primitive's number, whether it is met beyond 0, and where.

    For shadow rays, ``target`` is the number of the light that they lead to, which casts none; a
    mesh is asked about those as a whole.
    """
    if geometry.mesh is not None and target is None:
        yield geometry.mesh.closest(ray, active)
    for number, facet, blocks in geometry.loose_facets:
        if blocks or target is None:
            yield number, *meet_facet(ray, facet)
    for number, ball in geometry.balls:
        met, t = meet_sphere(ray, ball)
        is_light = number >= geometry.first_light
        yield number, met & (target != number) if is_light and target is not None else met, t


def _or_of_many(
    many: ManySpheres, ray: Ray, active: Bool, nearest: Float, primitive: UInt32
) -> tuple[Float, UInt32]:
    """The distance and number of a sphere that is nearer than what has been found, if any.

    Of coincident ones, the last.
    """

    def visit(
        number: UInt32, met: Bool, t: Float, end: Float, found: UInt32
    ) -> tuple[Float, UInt32]:
        closer = met & ((t < end) | ((t == end) & (number > found)))
        return dr.select(closer, t, end), dr.select(closer, number, found)

    return many.walk(ray, active, nearest, primitive, visit)


def _many_block(
    many: ManySpheres, ray: Ray, active: Bool, target: UInt32, before: Float, beyond: Float
) -> Bool:
    """Whether any of many spheres does; the walk ends at the first one."""

    def visit(
        number: UInt32, met: Bool, t: Float, end: Float, found: UInt32
    ) -> tuple[Float, UInt32]:
        reach = dr.select(number > target, beyond, before)
        return dr.select(met & (t < reach), -1, end), found

    return many.walk(ray, active, beyond, types_of(target).UInt32(0), visit, but=target)[0] < 0


def _light_triangles(
    geometry: SceneGeometry, ray: Ray, active: Bool, target: UInt32 | None = None
) -> Iterator[tuple[Any, Bool, Float, Bool]]:
    """The same of the triangles that emit, and whether a ray meets their front."""
    first = geometry.first_light_triangle
    for number, facet in enumerate(geometry.light_facets, start=first):
        met, t = meet_facet(ray, facet)
        front = dot_constant(facet.normal, ray.direction) < 0
        yield number, met if target is None else met & (target != number), t, front
    if geometry.light_mesh is not None:
        index, met, t = geometry.light_mesh.closest(ray, active)
        found = first + index
        plane = geometry.row(found, met).shape
        front = dr.dot(vec3(plane[0], plane[1], plane[2]), ray.direction) < 0
        yield found, met if target is None else met & (target != found), t, front


def _surface(
    geometry: SceneGeometry,
    features: Features,
    ray: Ray,
    t: Float,
    primitive: UInt32,
    row: SurfaceRow,
    valid: Bool,
) -> Hit:
    p = dr.fma(ray.direction, t, ray.origin)
    point, normal, reach = _on_primitive(geometry, features, row.shape, p, ray, primitive)
    front = dr.dot(normal, ray.direction) < 0
    facing = dr.select(front, normal, -normal)
    shading_normal = facing
    if features.interpolated_normals:
        shading_normal = _interpolated_normal(geometry, point, facing, primitive, valid)
    if geometry.reach is not None:
        in_mesh = valid & (primitive < geometry.first_sphere)
        reach = greater(reach, dr.gather(type(t), geometry.reach, primitive, in_mesh))
    away = _away(geometry, features, facing, ray.direction, primitive)
    spawn = dr.fma(away, SPAWN_OFFSET * reach, point)
    return Hit(valid, t, primitive, spawn, facing, shading_normal, front, row.material)


_Place: TypeAlias = "tuple[Array3f, Array3f, Float]"
"""A point moved onto its primitive, the normal there, and the largest coordinate in use."""


def _away(
    geometry: SceneGeometry,
    features: Features,
    facing: Array3f,
    direction: Array3f,
    primitive: UInt32,
) -> Array3f:
    """Where to step off what a ray in a direction has hit: see `SPAWN_OFFSET`."""
    if not features.triangles:
        return facing
    if not _some_spheres_reflect(geometry, features):
        return facing - direction
    return dr.select(_is_sphere(geometry, primitive), facing, facing - direction)


def _some_spheres_reflect(geometry: SceneGeometry, features: Features) -> bool:
    return features.spheres and geometry.first_light > geometry.first_sphere


def _is_sphere(geometry: SceneGeometry, primitive: UInt32) -> Bool:
    end = geometry.first_sphere + geometry.sphere_count
    return (primitive >= geometry.first_sphere) & (primitive < end)


def _on_primitive(
    geometry: SceneGeometry,
    features: Features,
    row: Array4f,
    p: Array3f,
    ray: Ray,
    primitive: UInt32,
) -> _Place:
    if not features.spheres:
        return _on_facet(row, p)
    if geometry.afar:
        on_sphere = _on_sphere_afar(row, ray)
    elif _some_spheres_reflect(geometry, features):
        on_sphere = _on_sphere(row, p, ray)
    else:
        on_sphere = _on_sphere_light(row, p)
    for number, ball in geometry.balls:
        if ball.power is not None:
            on_ball = _on_large_sphere(ball, ball.power, p)
            on_sphere = dr.select(primitive == number, on_ball, on_sphere)
    if not features.triangles:
        return on_sphere
    return dr.select(_is_sphere(geometry, primitive), on_sphere, _on_facet(row, p))


def _on_facet(row: Array4f, p: Array3f) -> _Place:
    normal = vec3(row[0], row[1], row[2])
    point = dr.fma(normal, row[3] - dr.dot(normal, p), p)
    return point, normal, largest(point)


def _on_sphere(row: Array4f, p: Array3f, ray: Ray) -> _Place:
    """A sphere so small that p rounds to its centre faces the ray."""
    center, radius = vec3(row[0], row[1], row[2]), row[3]
    spoke = p - center
    length = dr.norm(spoke)
    normal = dr.select(length > 0, spoke * dr.rcp(length), -ray.direction)
    point = dr.fma(normal, radius, center)
    return point, normal, largest(point) + radius


def _on_sphere_afar(row: Array4f, ray: Ray) -> _Place:
    """As on a sphere, but computed from the ray's origin and direction alone.

    A point of the ray may be rounded by more than the radius. The distance at which the ray passes
    the centre is exact enough. From outside, the ray hits the near half of the sphere; from inside,
    the far half.
    """
    center, radius = vec3(row[0], row[1], row[2]), row[3]
    from_center = ray.origin - center
    aside = across(across(from_center, ray.direction), ray.direction)
    height = dr.sqrt(greater(dr.square(radius) - dr.squared_norm(aside), 0))
    outside = dr.squared_norm(from_center) > dr.square(radius)
    spoke = dr.fma(ray.direction, dr.select(outside, -height, height), aside)
    normal = dr.normalize(spoke)
    point = dr.fma(normal, radius, center)
    return point, normal, largest(point) + radius


def _on_large_sphere(ball: Ball, power: Float, p: Array3f) -> _Place:
    """As on a sphere, but with an error relative to p instead of the radius."""
    normal = dr.normalize(p - ball.center)
    point = dr.fma(normal, -power_of_point(ball, power, p) / (2 * ball.radius), p)
    return point, normal, largest(point)


def _on_sphere_light(row: Array4f, p: Array3f) -> _Place:
    """What ends all paths: no more of it is asked for than its side, so any normal will do."""
    return p, p - vec3(row[0], row[1], row[2]), largest(p)


def _interpolated_normal(
    geometry: SceneGeometry, point: Array3f, facing: Array3f, primitive: UInt32, valid: Bool
) -> Array3f:
    """The corners' normals weighted by barycentric coordinates, on the side of ``facing``.

    That is ``facing`` itself where the corners round to a line, and where the normals cancel.
    """
    types = geometry.types
    smooth = valid & (primitive >= geometry.first_smooth) & (primitive < geometry.first_sphere)
    first = 6 * (primitive - geometry.first_smooth)
    a, b, c, normal_a, normal_b, normal_c = (
        dr.gather(types.Array3f, geometry.smooth, first + k, smooth) for k in range(6)
    )
    edge_b, edge_c, spoke = b - a, c - a, point - a
    area = dr.cross(edge_b, edge_c)
    scale = dr.rcp(dr.squared_norm(area))
    weight_b = dr.dot(dr.cross(spoke, edge_c), area) * scale
    weight_c = dr.dot(dr.cross(edge_b, spoke), area) * scale
    mixed = (1 - weight_b - weight_c) * normal_a + weight_b * normal_b + weight_c * normal_c
    unit = dr.normalize(mixed)
    oriented = dr.select(dr.dot(unit, facing) < 0, -unit, unit)
    return dr.select(smooth & (dr.squared_norm(mixed) > 0), oriented, facing)
