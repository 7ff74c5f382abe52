"""Distant spheres: the picture of one of them, alone or among many."""

from __future__ import annotations

from math import atan, cos, degrees, pi, sin
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from benchmarks.stress.harness import Case
from benchmarks.stress.lights import relative
from benchmarks.stress.pictures import SIDE, mean_in_drpt, mean_in_mitsuba
from benchmarks.stress.world import cube
from drpt import Camera, Diffuse, Mesh, Mode, Scene, Sphere, explain

if TYPE_CHECKING:
    from collections.abc import Callable

    from benchmarks.stress.harness import Measure
    from tests.oracle.arrays import Floats

    Place: TypeAlias = Callable[[float], Floats]
    """Centres of other spheres, so far away."""

RADIUS = 1e-3
"""Radius of the sphere at the origin; 1e9 radii are within the coordinates of a scene."""
ALONG = np.array([0.0, 0.0, 1.0])
"""Direction near which float32 resolves directions to 1e-45."""
ASKEW = np.array([0.36, 0.48, 0.8])
"""Direction near which it resolves them to 6e-8."""
PHASE = 1.0
"""The angle between the camera and the light as a ball sees them, in radians."""
AWAY = (1e2, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9)
PARALLEL = AWAY[1:]
"""Distances at which light and view rays of a ball are parallel within 1e-4."""
NAIVE = "the point that is hit is rounded to the other side, which is black"


def alone(far: float) -> Floats:
    """No other spheres."""
    return np.empty((0, 3))


def scattered(far: float) -> Floats:
    """Enough spheres for a grid, far outside the picture."""
    turns = 2 * pi * np.arange(1, 101) / 100
    aside = far * np.linspace(0.3, 0.9, 100)[:, None]
    ring = np.stack([np.cos(turns), np.sin(turns), 0.3 * np.sin(7 * turns)], axis=1)
    return np.asarray(aside * ring)


def crowded(far: float) -> Floats:
    """Enough spheres in one place for a tree."""
    aside = np.array([0.5 * far, 0.3 * far, 0])
    return aside + RADIUS * np.random.default_rng(0).uniform(-1, 1, (300, 3))


LAYOUTS: dict[str, Place] = {"alone": alone, "in a grid": scattered, "in a tree": crowded}


def camera(away: float, along: Floats, half: float) -> Camera:
    """A camera at a distance in radii, which sees ``half`` radii to each side of the origin."""
    eye = away * RADIUS * along
    return Camera(eye, (0, 0, 0), (0, 1, 0), degrees(2 * atan(half / away)), SIDE, SIDE)


def others(place: Place, away: float) -> list[Sphere]:
    """Black spheres besides the one at the origin."""
    return [Sphere(p, RADIUS, material=Diffuse(0)) for p in place(away * RADIUS)]


def light(away: float, along: Floats, place: Place) -> tuple[Scene, float]:
    """A light in the middle of the picture, and the mean of the picture."""
    lamp = Sphere((0, 0, 0), RADIUS, radiance=1)
    return Scene(camera(away, along, 2), [lamp, *others(place, away)]), pi / 16


def lit_aside(away: float, along: Floats, place: Place) -> tuple[Scene, float]:
    """A white ball that is lit from aside of the camera, by parallel light.

    Source: Lambert 1760; with irradiance E the mean radiance of the disc that is seen at the phase
    α is (2/3) E/π times (sin α + (π − α) cos α) / π.
    """
    across = np.cross(along, (0, 1, 0)) / np.linalg.norm(np.cross(along, (0, 1, 0)))
    distance = 2 * away * RADIUS
    sun = distance * (cos(PHASE) * along + sin(PHASE) * across)
    shapes = [
        Sphere((0, 0, 0), RADIUS, material=Diffuse(1)),
        Sphere(sun, 0.001 * distance, radiance=1e6),
        *others(place, away),
    ]
    phase = (sin(PHASE) + (pi - PHASE) * cos(PHASE)) / pi
    return Scene(camera(away, along, 2), shapes), pi / 16 * 2 / 3 * phase


def furnace(away: float, along: Floats, place: Place) -> tuple[Scene, float]:
    """A white ball that fills the picture, in a room whose walls shine."""
    walls = cube(np.zeros(3), 3 * away * RADIUS)
    shapes: list[Sphere | Mesh] = [
        Sphere((0, 0, 0), RADIUS, material=Diffuse(1)),
        Mesh(walls.vertices, walls.faces[:, ::-1], radiance=1),
    ]
    return Scene(camera(away, along, 1e-3), shapes), 1.0


Maker: TypeAlias = "Callable[[float, Floats, Place], tuple[Scene, float]]"


def seen(make: Maker, along: Floats, layout: str, mean: Callable[[Scene, int], float]) -> Measure:
    """Error of a picture's mean."""

    def error(away: float, samples: int) -> float:
        scene, expected = make(away, along, LAYOUTS[layout])
        has = explain(scene, 1).features
        if (has["sphere_grid"], has["sphere_tree"]) != ("grid" in layout, "tree" in layout):
            raise ValueError(f"layout: the spheres do not stand {layout}")
        return relative(mean(scene, samples), expected)

    return error


def by_brdf(scene: Scene, samples: int) -> float:
    """Mean radiance where every direction brings the same."""
    return mean_in_drpt(scene, samples, mode=Mode.IMPLICIT)


def along_an_axis(name: str, make: Maker, layout: str, away: tuple[float, ...] = AWAY) -> Case:
    """A case of a sphere in a direction that float32 can tell."""
    return Case(
        name=f"{name} from afar, {layout}",
        parameter="distance / radius",
        values=away,
        quick=(away[0], away[-1]),
        error=seen(make, ALONG, layout, mean_in_drpt),
        bound=1e-3,
        reason="a quarter of a step of 8 bits, and above the noise of the samples",
        naive=NAIVE,
        mitsuba=seen(make, ALONG, layout, mean_in_mitsuba),
    )


CASES = (
    *(along_an_axis("sphere light", light, layout) for layout in LAYOUTS),
    *(along_an_axis("ball lit from aside", lit_aside, layout, PARALLEL) for layout in LAYOUTS),
    Case(
        name="white furnace of a ball from afar",
        parameter="distance / radius",
        values=AWAY,
        quick=(AWAY[0], AWAY[-1]),
        error=seen(furnace, ASKEW, "alone", by_brdf),
        bound=1e-6,
        reason="rounding: every path brings the same",
        naive=NAIVE,
    ),
    Case(
        name="sphere light from afar, askew",
        parameter="distance / radius",
        values=AWAY[:4],
        quick=(1e2, 1e6),
        error=seen(light, ASKEW, "alone", mean_in_drpt),
        bound=5e-3,
        reason="directions are 6e-8 apart, so that the outline is told in steps of 0.06 radii",
        naive=NAIVE,
        mitsuba=seen(light, ASKEW, "alone", mean_in_mitsuba),
    ),
)
