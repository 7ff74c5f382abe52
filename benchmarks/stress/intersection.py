"""Rays and surfaces: outlines from afar, rays that leave a surface, gaps, and contacts."""

from __future__ import annotations

from math import hypot, pi, sqrt
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.stress.harness import Case
from benchmarks.stress.lights import irradiance, relative
from benchmarks.stress.pictures import camera_at, mean_in_drpt, mean_in_mitsuba
from benchmarks.stress.world import DULL, NEEDLES, World, beside, cube, grazing, icosphere, wedge
from drpt import Diffuse, Scene, Sphere
from drpt.crosscheck.variant import load_mitsuba
from tests.oracle.arrays import normalize, sample_uniform_sphere

if TYPE_CHECKING:
    from collections.abc import Callable

    from benchmarks.stress.harness import Measure
    from drpt.scene import Mesh
    from tests.oracle.arrays import Bools, Floats

ULPS = 4 * 2.0**-23
"""4 ulps of float32, relative."""
NONE = "not a single ray may go wrong"
SIZES = (1e-6, 1e-4, 1e-2, 1.0, 1e2, 1e4, 1e6)
OFFSETS = (0.1, 1.0, 10.0, 1e2, 1e3, 1e4)


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


def misclassified(hits: Callable[[Floats, Floats], Bools]) -> Measure:
    """Share of rays that are more than 4 ulps off the outline and on its wrong side."""

    def error(far: float, samples: int) -> float:
        rng = np.random.default_rng(0)
        origins, directions, clearance = rays_along_outline(rng, far, samples)
        wrong = hits(origins, directions) != (clearance < 0)
        return float((wrong & (np.abs(clearance) > ULPS)).mean())

    return error


def _hits_in_drpt(origins: Floats, directions: Floats) -> Bools:
    far = float(np.abs(origins).max())
    world = World(Sphere((0, 0, 0), 1, material=DULL), Sphere((0, 0, -4 * far), far, radiance=1))
    return world.reflects(world.closest(origins, directions))


def _hits_in_mitsuba(origins: Floats, directions: Floats) -> Bools:
    mi = load_mitsuba()
    scene = mi.load_dict({"type": "scene", "sphere": {"type": "sphere"}})
    ray = mi.Ray3f(mi.Point3f(origins.T.astype("f")), mi.Vector3f(directions.T.astype("f")))
    return np.asarray(scene.ray_test(ray), bool)


def self_hits(
    shape: Callable[[Floats, float], Sphere | Mesh],
) -> Callable[[float, float, int], float]:
    """Share of rays that leave a convex shape, most of them at grazing angles, and meet it again.

    And of those inside that leave it without meeting it.
    """

    def error(size: float, offset: float, samples: int) -> float:
        rng = np.random.default_rng(0)
        center, light = beside(size, offset)
        world = World(shape(center, size), light)
        origins = center + 3 * size * sample_uniform_sphere(rng, samples // 2)
        towards = center + 0.8 * size * sample_uniform_sphere(rng, samples // 2)
        found = world.closest(origins, normalize(towards - origins))
        start = world.reflects(found)
        again = world.closest(found.point[start], grazing(rng, found.normal[start]))
        within = world.closest(
            np.broadcast_to(center, origins.shape), sample_uniform_sphere(rng, len(origins))
        )
        inner = world.closest(within.point, grazing(rng, within.normal))
        wrong = world.reflects(again).sum() + (~world.reflects(inner)).sum()
        return float(wrong + (~world.reflects(within)).sum()) / samples

    return error


def _sphere(center: Floats, size: float) -> Sphere:
    return Sphere(center, size, material=DULL)


def lost_in_gap(gap: float, samples: int) -> float:
    """Share of rays in the gap between two concentric spheres that do not meet the other one.

    They start halfway, meet the inner one, and from there the outer one, again and again.
    """
    rng = np.random.default_rng(0)
    center = np.array([0.5, -0.3, 0.2])
    inner, outer = (Sphere(center, r, material=DULL) for r in (1 - gap, 1))
    world = World(inner, outer, Sphere((0, 0, -9), 1, radiance=1))
    normal = sample_uniform_sphere(rng, samples)
    point, direction, lost = center + (1 - gap / 2) * normal, -normal, np.zeros(samples, bool)
    for expected in (0, 1, 0, 1):
        found = world.closest(point, direction)
        lost |= found.primitive != expected
        point, direction = found.point, found.normal
    return float(lost.mean())


def lost_in_wedge(angle: float, samples: int) -> float:
    """Height of a thin wedge up to which rays up from its floor may miss its ceiling.

    They start where rays from the wedge's open half met the floor, down to 1e-7 below the ceiling.
    """
    rng = np.random.default_rng(0)
    world = World(wedge(angle), Sphere((0, 0, 5), 1, radiance=1))
    height = 10 ** rng.uniform(-7, np.log10(np.tan(angle)), samples)
    x, y = height / np.tan(angle) - 1, rng.uniform(-0.9, 0.9, samples)
    target = np.stack([x, y, 0 * x], axis=1)
    origin = target + np.stack([0.5 * (1 - x), 0 * x, 0.25 * (1 - x) * np.tan(angle)], axis=1)
    point = world.closest(origin, normalize(target - origin)).point
    up = np.broadcast_to([0.0, 0, 1], point.shape)
    lost = ~world.reflects(world.closest(point, up))
    return float(height[lost].max(initial=0))


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


def at_contact(mean: Callable[[Scene, int], float]) -> Measure:
    """Error of the light on the ground beside the ball, by the ground's radius."""

    def error(radius: float, samples: int) -> float:
        scene, expected = contact(radius)
        return relative(mean(scene, samples), expected)

    return error


EPSILON = (
    "an offset of 1e-4 is 100 sizes of the smallest shape, and below the rounding of the largest"
)


def leaving(name: str, shape: Callable[[Floats, float], Sphere | Mesh]) -> tuple[Case, Case]:
    """Cases of rays that leave a shape, by its size and by its offset."""
    error = self_hits(shape)
    return (
        Case(
            name=f"rays that leave {name}",
            parameter="size, 30 sizes from the origin",
            values=SIZES,
            quick=(1e-6, 1e6),
            error=lambda size, samples: error(size, 30, samples),
            bound=0,
            reason=NONE,
            naive=EPSILON,
        ),
        Case(
            name=f"rays that leave {name} far away",
            parameter="offset in sizes",
            values=OFFSETS,
            quick=(0.1, 10.0),
            error=lambda offset, samples: error(1, offset, samples),
            bound=0,
            reason=NONE,
            naive=EPSILON,
        ),
    )


CASES = (
    Case(
        name="outline of a sphere from afar",
        parameter="distance / radius",
        values=(1.001, 1.1, 2.0, 10.0, 1e2, 1e3, 1e4, 1e5),
        quick=(1.1, 1e3, 1e5),
        error=misclassified(_hits_in_drpt),
        bound=0,
        reason="no ray more than 4 ulps of its origin off the outline may be on its wrong side",
        naive="b² - c cancels: 7.8 % of the rays go wrong at 1e3 radii, 95 % at 4.1e3",
        mitsuba=misclassified(_hits_in_mitsuba),
    ),
    *leaving("a sphere", _sphere),
    *leaving("an icosahedron", lambda center, size: icosphere(0, center, size)),
    *leaving("a mesh of 1280 triangles", lambda center, size: icosphere(3, center, size)),
    *leaving("a cube of needles 1e6 : 1", lambda center, size: cube(center, size, NEEDLES)),
    Case(
        name="gap between concentric spheres",
        parameter="gap / radius",
        values=(0.1, 1e-2, 1e-3, 1e-4, 4e-5, 1e-5, 4e-6),
        quick=(0.1, 4e-5),
        error=lost_in_gap,
        bound=0,
        reason=NONE,
        naive="a scene-wide offset of 1e-4 jumps over the gap",
    ),
    Case(
        name="thin wedge",
        parameter="angle",
        values=(1.0, 0.3, 0.1, 1e-2, 1e-3),
        quick=(1.0, 1e-2),
        error=lost_in_wedge,
        bound=2.0**-19,
        reason="the offset of 2^-20 of the coordinates, and their rounding",
        naive="near the edge the offset leads through the ceiling, which is 1e-4 above the floor",
    ),
    Case(
        name="ball of radius 1 on a ground sphere",
        parameter="radius of the ground",
        values=(1e1, 1e2, 1e3, 1e4, 1e5, 1e6),
        quick=(1e1, 1e6),
        error=at_contact(mean_in_drpt),
        bound=1e-3,
        reason="a quarter of a step of 8 bits",
        naive="the ground is rough by its float32 rounding, 6e-8 of its radius, and shades itself",
        mitsuba=at_contact(mean_in_mitsuba),
    ),
)
