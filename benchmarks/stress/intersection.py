"""Rays and surfaces: outlines from afar, rays that leave a surface, gaps, and contacts."""

from __future__ import annotations

from math import hypot, log, pi, sqrt
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.stress.harness import Case
from benchmarks.stress.lights import UP, irradiance, relative
from benchmarks.stress.pictures import camera_at, mean_in_drpt, mean_in_mitsuba
from benchmarks.stress.world import (
    DULL,
    NEEDLES,
    Drpt,
    Mitsuba,
    beside,
    cube,
    grazing,
    icosphere,
    wedge,
)
from drpt import Diffuse, Mesh, Scene, Sphere
from tests.oracle.arrays import normalize, sample_uniform_sphere

if TYPE_CHECKING:
    from collections.abc import Callable

    from benchmarks.stress.harness import Measure
    from benchmarks.stress.world import World
    from tests.oracle.arrays import Floats

ULPS = 4 * 2.0**-23
"""4 ulps of float32, relative."""
NONE = "not a single ray may go wrong"
SIZES = (1e-6, 1e-4, 1e-2, 1.0, 1e2, 1e4, 1e6)
OFFSETS = (0.1, 1.0, 10.0, 1e2, 1e3, 1e4)
SPAWNED = 2**21
"""Rays that leave a shape: 1e8 over all sizes and offsets of the four shapes."""


def rays_along_outline(
    rng: np.random.Generator, far: float, count: int
) -> tuple[Floats, Floats, Floats]:
    """Rays from so far that pass the unit sphere's outline by 1e-8 to 0.1, and their clearance.

    The clearance is how far outside of the sphere the ray as float32 tells it passes, in ulps of
    its origin's distance.
    """
    origins = far * sample_uniform_sphere(rng, count)
    origins = origins.astype(np.float32).astype(np.float64)
    aside = 1 + rng.choice([-1, 1], (count, 1)) * 10 ** rng.uniform(-8, -1, (count, 1))
    distance = np.linalg.norm(origins, axis=1, keepdims=True)
    sine = np.minimum(aside / distance, 1)
    across = normalize(np.cross(sample_uniform_sphere(rng, count), origins))
    directions = sine * across - np.sqrt(1 - sine**2) * origins / distance
    directions = directions.astype(np.float32).astype(np.float64)
    impact = np.linalg.norm(np.cross(origins, normalize(directions)), axis=1)
    return origins, directions, (impact - 1) / far


def misclassified(world: World) -> Measure:
    """Share of rays that are more than 4 ulps off the outline and on its wrong side."""

    def error(far: float, samples: int) -> float:
        rng = np.random.default_rng(0)
        origins, directions, clearance = rays_along_outline(rng, far, samples)
        lamp = Sphere((0, 0, -4 * far), far, radiance=1)
        found = world(Sphere((0, 0, 0), 1, material=DULL), lamp).closest(origins, directions)
        wrong = found.reflects != (clearance < 0)
        return float((wrong & (np.abs(clearance) > ULPS)).mean())

    return error


def misses_tangents(world: World) -> Measure:
    """Share of axis-parallel rays, so many ulps inside or outside of a unit sphere, that go wrong.

    They keep a distance from an axis that is known to the last digit.
    """

    def error(ulps: float, samples: int) -> float:
        rng = np.random.default_rng(0)
        sphere = world(Sphere((0, 0, 0), 1, material=DULL), Sphere((0, 0, -99), 9, radiance=1))
        aside = 1 + ulps * rng.choice([-(2.0**-24), 2.0**-23], samples)
        axis, sign = rng.integers(0, 3, samples), rng.choice([-1.0, 1.0], (2, samples))
        rays = np.arange(samples)
        origins, directions = np.zeros((2, samples, 3))
        origins[rays, axis], directions[rays, axis] = -sign[0] * rng.uniform(2, 8, samples), sign[0]
        origins[rays, (axis + 1) % 3] = sign[1] * aside
        found = sphere.closest(origins, directions)
        finite = np.isfinite(found.point).all(axis=1)
        return float(((found.reflects != (aside < 1)) | (found.reflects & ~finite)).mean())

    return error


def self_hits(
    world: World, shape: Callable[[Floats, float], Sphere | Mesh]
) -> Callable[[float, float, int], float]:
    """Share of rays that leave a convex shape, most of them at grazing angles, and meet it again.

    And of those inside that leave it without meeting it.
    """

    def error(size: float, offset: float, samples: int) -> float:
        rng = np.random.default_rng(0)
        center, light = beside(size, offset)
        body = world(shape(center, size), light)
        origins = center + 3 * size * sample_uniform_sphere(rng, samples // 2)
        towards = center + 0.8 * size * sample_uniform_sphere(rng, samples // 2)
        outer = body.closest(origins, normalize(towards - origins))
        inner = body.closest(
            np.broadcast_to(center, origins.shape), sample_uniform_sphere(rng, len(origins))
        )
        outward, inward = (
            body.closest(found.point[found.reflects], grazing(rng, found.normal[found.reflects]))
            for found in (outer, inner)
        )
        wrong = outward.reflects.sum() + (~inner.reflects).sum() + (~inward.reflects).sum()
        return float(wrong) / samples

    return error


def lost_at_seams(world: World, shape: Callable[[Floats, float], Mesh]) -> Measure:
    """Share of rays out of a closed mesh through its corners and edges, by its offset."""

    def error(offset: float, samples: int) -> float:
        rng = np.random.default_rng(0)
        center, light = beside(1, offset)
        mesh = shape(center, 1)
        corners = mesh.vertices[mesh.faces[rng.integers(0, len(mesh.faces), samples)]]
        share = np.where(rng.random((samples, 1)) < 0.5, 0, rng.random((samples, 1)))
        targets = corners[:, 0] + share * (corners[:, 1] - corners[:, 0])
        origins = center + 0.3 * sample_uniform_sphere(rng, samples)
        found = world(mesh, light).closest(origins, normalize(targets - origins))
        return float((~found.reflects).mean())

    return error


def lost_in_fine_mesh(world: World, *, at_corners: bool) -> Measure:
    """Share of rays that slip out of a closed mesh, aimed at its corners or at random."""

    def error(triangles: float, samples: int) -> float:
        rng = np.random.default_rng(0)
        center, light = beside(1, 0.1)
        mesh = icosphere(round(log(triangles / 20, 4)), center, 1)
        origins = center + 0.3 * sample_uniform_sphere(rng, samples)
        if at_corners:
            corners = mesh.vertices[rng.integers(0, len(mesh.vertices), samples)]
            directions = normalize(corners - origins)
        else:
            directions = sample_uniform_sphere(rng, samples)
        found = world(mesh, light).closest(origins, directions)
        return float((~found.reflects).mean())

    return error


def _sphere(center: Floats, size: float) -> Sphere:
    return Sphere(center, size, material=DULL)


def _icosahedron(center: Floats, size: float) -> Mesh:
    return icosphere(0, center, size)


def _fine(center: Floats, size: float) -> Mesh:
    return icosphere(3, center, size)


def _needles(center: Floats, size: float) -> Mesh:
    return cube(center, size, NEEDLES)


def lost_in_gap(world: World) -> Measure:
    """Share of rays in the gap between two concentric spheres that do not meet the other one.

    They start halfway, meet the inner one, and from there the outer one, again and again.
    """

    def error(gap: float, samples: int) -> float:
        rng = np.random.default_rng(0)
        center = np.array([0.5, -0.3, 0.2])
        inner, outer = (Sphere(center, r, material=DULL) for r in (1 - gap, 1))
        nested = world(inner, outer, Sphere((0, 0, -9), 1, radiance=1))
        normal = sample_uniform_sphere(rng, samples)
        point, direction, lost = center + (1 - gap / 2) * normal, -normal, np.zeros(samples, bool)
        for expected in (0, 1, 0, 1):
            found = nested.closest(point, direction)
            lost |= ~found.reflects | (found.sphere != expected)
            point, direction = found.point, found.normal
        return float(lost.mean())

    return error


def lost_in_wedge(world: World) -> Measure:
    """Height of a thin wedge up to which rays up from its floor may miss its ceiling.

    They start where rays from the wedge's open half met the floor, down to 1e-7 below the ceiling.
    """

    def error(angle: float, samples: int) -> float:
        rng = np.random.default_rng(0)
        room = world(wedge(angle), Sphere((0, 0, 5), 1, radiance=1))
        height = 10 ** rng.uniform(-7, np.log10(np.tan(angle)), samples)
        x, y = height / np.tan(angle) - 1, rng.uniform(-0.9, 0.9, samples)
        target = np.stack([x, y, 0 * x], axis=1)
        origin = target + np.stack([0.5 * (1 - x), 0 * x, 0.25 * (1 - x) * np.tan(angle)], axis=1)
        point = room.closest(origin, normalize(target - origin)).point
        up = np.broadcast_to([0.0, 0, 1], point.shape)
        lost = ~room.closest(point, up).reflects
        return float(height[lost].max(initial=0))

    return error


def contact(radius: float) -> tuple[Scene, float]:
    """A ball of radius 1 that shines on the ground sphere it touches; what the camera sees.

    The camera looks at a point of the ground 2 balls from the contact.
    """
    point = 2 * np.array([0.6, 0.8, 0])
    point[2] = -4 / (radius + sqrt((radius - 2) * (radius + 2)))
    normal = normalize(np.add(point, (0, 0, radius)))
    to_light = np.array([0, 0, 1]) - point
    distance = hypot(*to_light)
    scene = Scene(
        camera_at(np.add(point, (3, 2, 4)), point, (0, 0, 1)),
        [Sphere((0, 0, -radius), radius, material=Diffuse(1)), Sphere((0, 0, 1), 1, radiance=1)],
    )
    return scene, irradiance(1 / distance, float(normal @ to_light) / distance) / pi


def beside_contact(distance: float) -> tuple[Scene, float]:
    """A ball of radius 1 that shines on the floor it stands on; what the camera sees.

    The camera looks at a point of the floor so far from the contact, whose horizon the ball
    touches; from that side the camera sees it at half the height of the ball's rim.
    """
    point = distance * np.array([0.6, 0.8, 0])
    eye = 11 * point + 10 * distance**2 * UP
    corners = [(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)]
    scene = Scene(
        camera_at(eye, point, UP),
        [
            Mesh(corners, [(0, 1, 2), (0, 2, 3)], material=Diffuse(1)),
            Sphere((0, 0, 1), 1, radiance=1),
        ],
    )
    sine = 1 / hypot(1, distance)
    return scene, irradiance(sine, sine) / pi


def at_contact(
    contact: Callable[[float], tuple[Scene, float]], mean: Callable[[Scene, int], float]
) -> Measure:
    """Error of the light on the ground that a ball touches."""

    def error(value: float, samples: int) -> float:
        scene, expected = contact(value)
        return relative(mean(scene, samples), expected)

    return error


EPSILON = (
    "an offset of 1e-4 is 100 sizes of the smallest shape, and below the rounding of the largest"
)


CORNERS = "what Embree lets through within 1e-7 of a corner: no ray that is not aimed there"


def leaving(name: str, shape: Callable[[Floats, float], Sphere | Mesh]) -> tuple[Case, Case]:
    """Cases of rays that leave a shape, by its size and by its offset."""
    drpt, mitsuba = self_hits(Drpt, shape), self_hits(Mitsuba, shape)
    return (
        Case(
            name=f"rays that leave {name}",
            parameter="size, 30 sizes from the origin",
            values=SIZES,
            quick=(1e-6, 1e6),
            error=lambda size, samples: drpt(size, 30, samples),
            bound=0,
            reason=NONE,
            naive=EPSILON,
            samples=SPAWNED,
            mitsuba=lambda size, samples: mitsuba(size, 30, samples),
        ),
        Case(
            name=f"rays that leave {name} far away",
            parameter="offset in sizes",
            values=OFFSETS,
            quick=(0.1, 10.0),
            error=lambda offset, samples: drpt(1, offset, samples),
            bound=0,
            reason=NONE,
            naive=EPSILON,
            samples=SPAWNED,
            mitsuba=lambda offset, samples: mitsuba(1, offset, samples),
        ),
    )


def at_seams(
    name: str, shape: Callable[[Floats, float], Mesh], bound: float = 0, reason: str = NONE
) -> Case:
    """A case of rays at the corners and edges of a closed mesh."""
    return Case(
        name=f"rays at the seams of {name}",
        parameter="offset in sizes",
        values=OFFSETS,
        quick=(0.1, 1e3),
        error=lost_at_seams(Drpt, shape),
        bound=bound,
        reason=reason,
        naive="each triangle rounds its edge in its own way, and rays pass between two of them",
        mitsuba=lost_at_seams(Mitsuba, shape),
    )


def fine_mesh(name: str, rays: int, bound: float, reason: str, *, at_corners: bool) -> Case:
    """A case of rays out of ever finer meshes."""
    return Case(
        name=name,
        parameter="triangles",
        values=(1280.0, 5120.0, 20480.0, 81920.0),
        quick=(1280.0, 20480.0),
        error=lost_in_fine_mesh(Drpt, at_corners=at_corners),
        bound=bound,
        reason=reason,
        naive="each triangle rounds its edge in its own way, and rays pass between two of them",
        samples=rays,
        mitsuba=lost_in_fine_mesh(Mitsuba, at_corners=at_corners),
    )


CASES = (
    Case(
        name="outline of a sphere from afar",
        parameter="distance / radius",
        values=(1.001, 1.1, 2.0, 10.0, 1e2, 1e3, 1e4, 1e5),
        quick=(1.1, 1e3, 1e5),
        error=misclassified(Drpt),
        bound=0,
        reason="no ray more than 4 ulps of its origin off the outline may be on its wrong side",
        naive="b² - c cancels: 7.8 % of the rays go wrong at 1e3 radii, 95 % at 4.1e3",
        mitsuba=misclassified(Mitsuba),
    ),
    Case(
        name="tangent rays along the axes",
        parameter="ulps off the outline",
        values=(1.0, 2.0, 4.0, 8.0, 16.0),
        quick=(1.0,),
        error=misses_tangents(Drpt),
        bound=0,
        reason=NONE,
        naive="b² - c loses the ulps that decide, and its root may be one of a negative number",
        mitsuba=misses_tangents(Mitsuba),
    ),
    *leaving("a sphere", _sphere),
    *leaving("an icosahedron", _icosahedron),
    *leaving("a mesh of 1280 triangles", _fine),
    *leaving("a cube of needles 1e6 : 1", _needles),
    at_seams("an icosahedron", _icosahedron),
    at_seams("a mesh of 1280 triangles", _fine, 1e-3, CORNERS),
    at_seams("a cube of needles 1e6 : 1", _needles, 1e-3, CORNERS),
    fine_mesh("rays aimed at the corners of a mesh", 2**18, 0.01, CORNERS, at_corners=True),
    fine_mesh("rays at random in a mesh", 2**20, 0, NONE, at_corners=False),
    Case(
        name="gap between concentric spheres",
        parameter="gap / radius",
        values=(0.1, 1e-2, 1e-3, 1e-4, 4e-5, 1e-5, 4e-6),
        quick=(0.1, 4e-5),
        error=lost_in_gap(Drpt),
        bound=0,
        reason=NONE,
        naive="a scene-wide offset of 1e-4 jumps over the gap",
        mitsuba=lost_in_gap(Mitsuba),
    ),
    Case(
        name="thin wedge",
        parameter="angle",
        values=(1.0, 0.3, 0.1, 1e-2, 1e-3),
        quick=(1.0, 1e-2),
        error=lost_in_wedge(Drpt),
        bound=2.0**-19,
        reason="the offset of 2^-20 of the coordinates, and their rounding",
        naive="near the edge the offset leads through the ceiling, which is 1e-4 above the floor",
        mitsuba=lost_in_wedge(Mitsuba),
    ),
    Case(
        name="ball of radius 1 on a ground sphere",
        parameter="radius of the ground",
        values=(1e1, 1e2, 1e3, 1e4, 1e5, 1e6),
        quick=(1e1, 1e6),
        error=at_contact(contact, mean_in_drpt),
        bound=1e-3,
        reason="a quarter of a step of 8 bits",
        naive="the ground is rough by its float32 rounding, 6e-8 of its radius, and shades itself",
        mitsuba=at_contact(contact, mean_in_mitsuba),
    ),
    Case(
        name="floor close to a ball that stands on it",
        parameter="distance from the contact / radius",
        values=(1.0, 0.1, 1e-2, 1e-3),
        quick=(1.0, 1e-3),
        error=at_contact(beside_contact, mean_in_drpt),
        bound=1e-3,
        reason="a quarter of a step of 8 bits",
        naive="the gap there is half of the square of the distance, and an offset jumps over it",
        mitsuba=at_contact(beside_contact, mean_in_mitsuba),
    ),
)
