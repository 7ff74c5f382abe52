"""Where a ray meets a single thing: a box, a convex body, a facet, a sphere."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import drjit as dr

from drpt.kernel.vec import greater, largest, lesser, types_of

if TYPE_CHECKING:
    from drjit.auto import Array3f, Bool, Float, UInt32

    from drpt.kernel.camera import Ray
    from drpt.kernel.facets import Facet
    from drpt.kernel.solids import Face, Solid, Span

SKIN = 2.0**-21
"""How far outside a convex body an origin counts as inside, relative to its coordinates.

Rounding may put a point in a corner of a room beyond the other wall; what has been stepped off the
outside of a face, by `SPAWN_OFFSET`, is twice as far away.
"""


@dataclass
class Ball:
    """A sphere: its centre and radius.

    One that is large against its distance from the origin, such as the ground, also has the
    ``power`` of the origin, |c|² − r²: there the difference would lose all of its digits.

    With ``afar``, rays may start so far away that distances are rounded by more than its radius.
    """

    center: Array3f
    radius: Float
    power: Float | None = None
    afar: bool = False


def meet_box(
    origin: Array3f, inverse: Array3f, low: Array3f, high: Array3f, end: Any
) -> tuple[Float, Float]:
    """Where rays, by their reciprocal directions, are in a box on their way to an ``end``.

    They enter after they leave if they miss it; from inside they enter at 0.
    """
    enters: Any = types_of(inverse.x).Float32(0)
    leaves: Any = end
    for axis in range(3):
        upward = inverse[axis] > 0
        first, last = ((side[axis] - origin[axis]) * inverse[axis] for side in (low, high))
        enters = greater(dr.select(upward, first, last), enters)
        leaves = lesser(dr.select(upward, last, first), leaves)
    return enters, leaves


def meet_solid(ray: Ray, solid: Solid) -> tuple[UInt32, Bool, Float]:
    """Number of the facet by which a ray enters a convex body, or else leaves it, and where."""
    passage = _pass(ray, solid.spans)
    met, t = _surface_of(passage)
    number = types_of(t).UInt32(0)
    for face, at in passage.faces:
        if face.facet is not None:
            number = dr.select(at == t, face.facet, number)
    return number, met, greater(t, 0)


def solid_blocks(ray: Ray, solid: Solid, distance: Float) -> Bool:
    """Whether a convex body stands on the first ``distance`` of a ray between two surfaces."""
    met, t = _surface_of(_pass(ray, solid.shading))
    return met & (t < distance)


class _Passage(NamedTuple):
    """Where a ray enters and leaves a convex body, and where it meets the plane of each face.

    ``inside`` tells whether its origin is within, or no more than `SKIN` outside.
    """

    enters: Any
    leaves: Any
    inside: Any
    faces: list[tuple[Face, Float]]


def _pass(ray: Ray, spans: tuple[Span, ...]) -> _Passage:
    """The part of a ray that is on the inner side of all planes.

    A distance is not a number where a ray runs in a plane; comparisons pass over that.
    """
    enters: Any = -dr.inf
    leaves: Any = dr.inf
    inside: Any = True
    faces: list[tuple[Face, Float]] = []
    skin = SKIN * largest(ray.origin)
    for span in spans:
        rate = dr.rcp(dot_constant(span.direction, ray.direction))
        position = dot_constant(span.direction, ray.origin)
        upward = rate > 0
        for face, enters_here in ((span.low, upward), (span.high, ~upward)):
            if face is None:
                continue
            height = face.offset - position
            at = height * rate
            enters = dr.select(enters_here, greater(at, enters), enters)
            leaves = dr.select(enters_here, leaves, lesser(at, leaves))
            inside = inside & (height <= skin if face is span.low else height >= -skin)
            faces.append((face, at))
    return _Passage(enters, leaves, inside, faces)


def _surface_of(passage: _Passage) -> tuple[Bool, Float]:
    """Whether and where a ray enters a convex body by its surface, or else leaves it by that.

    From the skin of a face to its outside a ray leaves at once, at a distance not above 0.
    """
    enters, leaves, inside, faces = passage
    openings = [at for face, at in faces if face.facet is None]
    by_surface = _all((enters > 0) & ~inside, [at != enters for at in openings])
    t = dr.select(by_surface, enters, leaves)
    met = inside | (enters <= leaves) & (leaves > 0)
    return _all(met, [at != t for at in openings]), t


def _all(first: Bool, others: list[Bool]) -> Bool:
    for condition in others:
        first = first & condition
    return first


def meet_facet(ray: Ray, facet: Facet) -> tuple[Bool, Float]:
    """Meeting point with the plane, by the constants of the facet alone, and the slabs around."""
    main = max(facet.normal, key=abs)
    normal = tuple(x / main for x in facet.normal)
    height = facet.offset / main - dot_constant(normal, ray.origin)
    t = height * dr.rcp(dot_constant(normal, ray.direction))
    point = dr.fma(ray.direction, t, ray.origin)
    inside = t > 0
    for slab in facet.slabs:
        x = dot_constant(slab.direction, point)
        if slab.low > -dr.inf:
            inside &= x >= slab.low
        if slab.high < dr.inf:
            inside &= x <= slab.high
    return inside, t


def dot_constant(constant: tuple[float, ...], v: Array3f) -> Float:
    """Inner product that leaves out the constant's zeros and spares its ones."""
    terms = sorted(zip(constant, v, strict=True), key=lambda term: abs(term[0]) != 1)
    (c, x), *others = [(c, x) for c, x in terms if c != 0]
    total = x * c
    for c, x in others:
        total = dr.fma(x, c, total)
    return total


def meet_sphere(ray: Ray, ball: Ball) -> tuple[Bool, Float]:
    """First meeting with a sphere beyond the origin, the ray's direction being a unit vector.

    Source: Haines et al. 2019, "Precision Improvements for Ray/Sphere Intersection" (Ray Tracing
    Gems, ch. 7). Rays that start near a large sphere use the power of their origin instead.
    From ``afar``, b is rounded, and the direction's length is not exactly 1, so the closest point
    keeps a component along the ray. It is removed.
    """
    f = ray.origin - ball.center
    b = -dr.dot(f, ray.direction)
    if ball.power is None:
        closest = dr.fma(ray.direction, b, f)
        if ball.afar:
            closest = across(closest, ray.direction)
        r2 = ball.radius * ball.radius
        c, discriminant = dr.dot(f, f) - r2, r2 - dr.dot(closest, closest)
    else:
        c = power_of_point(ball, ball.power, ray.origin)
        discriminant = dr.fma(b, b, -c)
    root: Any = dr.copysign(dr.sqrt(discriminant), b)
    q = b + root
    other = c / q
    near, far = lesser(q, other), greater(q, other)
    return (discriminant > 0) & (far > 0), dr.select(near > 0, near, far)


def across(v: Array3f, direction: Array3f) -> Array3f:
    """The component of a vector perpendicular to a unit direction."""
    return dr.fma(direction, -dr.dot(v, direction), v)


def power_of_point(ball: Ball, of_origin: Float, p: Array3f) -> Float:
    """The power |p − c|² − r² of a point, from that of the origin."""
    return dr.dot(p, p) - 2 * dr.dot(p, ball.center) + of_origin
