"""Whole pictures: scales, sums of many samples, rooms that no light may enter."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.stress.harness import Case
from benchmarks.stress.intersection import NONE
from benchmarks.stress.lights import UP, relative
from benchmarks.stress.pictures import camera_at, mean_in_drpt, mean_in_mitsuba
from benchmarks.stress.world import DULL, NEEDLES, beside, cube, icosphere, prism
from drpt import Camera, Diffuse, Mesh, Mode, Phong, Rendering, Scene, Sphere, render
from drpt.film import Film
from drpt.plan import plan_passes, run_length
from tests.oracle.closed_forms import furnace_radiance

if TYPE_CHECKING:
    from collections.abc import Callable

    from benchmarks.stress.harness import Measure
    from drpt.scene import Shape
    from tests.oracle.arrays import Floats

SIDE = 64
OFFSETS = (0.1, 1.0, 10.0, 1e2, 1e3, 1e4, 1e5)
BOUNCES = 3
"""Of paths in a closed room."""
RAYS = 1_001_000_000
"""In each closed room, in a long run: over all offsets."""


def room(scale: float, radiance: float, *, finely: bool) -> Scene:
    """A floor, a glossy ball, a body of few or of many triangles, and two kinds of light."""
    corners = scale * np.array([(-3, -3, 0), (3, -3, 0), (3, 3, 0), (-3, 3, 0)])
    lamp = scale * np.array([(-1, -1, 4), (1, 1, 4.5), (1, -1, 4)])
    body = icosphere(3 if finely else 0, scale * np.array([-1, 0.2, 0.7]), 0.8 * scale)
    shapes: list[Shape] = [
        Mesh(corners, [(0, 1, 2), (0, 2, 3)], material=Diffuse((0.3, 0.7, 0.5))),
        Mesh(body.vertices, body.faces, material=DULL),
        Sphere(scale * np.array([1, 0, 0.6]), 0.6 * scale, material=Phong(0.8, 30)),
        Mesh(lamp, [(0, 1, 2)], radiance=radiance),
        Sphere(scale * np.array([0.2, 1.4, 1.5]), 0.3 * scale, radiance=radiance / 4),
    ]
    camera = Camera(scale * np.array([1, -5, 3]), (0, 0, 0.7 * scale), (0, 0, 1), 40, SIDE, SIDE)
    return Scene(camera, shapes)


@cache
def _picture(scale: float, radiance: float, spp: int, finely: bool) -> Floats:
    return render(room(scale, radiance, finely=finely), spp, 3).image.astype(np.float64)


def scaled(finely: bool) -> Measure:
    """Share of values that differ from those of the same scene in the size 1."""
    return lambda scale, samples: _differing(
        _picture(scale, 1, samples // SIDE**2, finely), _picture(1, 1, samples // SIDE**2, finely)
    )


def brighter(radiance: float, samples: int) -> float:
    """Share of values that are not those of the radiance 1 times another one.

    What is below `VANISHING` at either radiance does not count.
    """
    spp = samples // SIDE**2
    found, plain = _picture(1, radiance, spp, False), _picture(1, 1, spp, False)
    return _differing(found, radiance * plain, VANISHING * max(radiance, 1))


def _differing(found: Floats, expected: Floats, room: float = 0) -> float:
    return float((np.abs(found - expected) > room).mean())


VANISHING = 2.0**-120
"""What a sample may lose where its factors are below 2⁻¹²⁶, the smallest of float32's numbers."""


def of_constant(samples: float, _: int) -> float:
    """Error of the mean of so many samples of a light that fills the pixel; of its rays' count."""
    camera = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), 1, 1, 1)
    scene = Scene(camera, [Sphere((0, 0, 0), 1, radiance=0.1)])
    result = render(scene, int(samples), 0)
    return max(relative(float(result.image[0, 0, 0]), 0.1), relative(result.rays, samples))


def of_passes(samples: float, _: int) -> float:
    """Error of the film's mean of so many samples of 0.1, in a thousand passes."""
    film, count = Film(1, blocks=False), int(samples / 1000)
    for start in range(0, 1000 * count, count):
        film.add(range(1), np.full((1, 1, 3), 0.1 * count), range(start, start + count), count)
    return relative(float(film.mean[0, 0]), 0.1)


def repeated(samples: float, _: int) -> float:
    """Share of the passes of one pixel that repeat the sums of another one.

    Of a red, a green and a blue light, which stand in a part of the pixel each, independent samples
    find the same three numbers twice in 2⁻³⁸ of pairs of passes.
    """
    places = {(1, 0, 0): (-0.4, -0.4, 0), (0, 1, 0): (0.4, -0.4, 0), (0, 0, 1): (0, 0.4, 0)}
    lights = [Sphere(center, 0.4, radiance=colour) for colour, center in places.items()]
    scene = Scene(Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), 20, 1, 1), lights)
    launcher = Rendering(scene, int(samples), 0, sampler="independent").launcher
    passes = [
        launcher.launch(range(1), part, run_length(1, part, 1), 0).radiance.sum(axis=0)[0]
        for part in plan_passes(1, int(samples))
    ]
    return 1 - len(np.unique(passes, axis=0)) / len(passes)


def near_a_light(height: float, samples: int) -> float:
    """Error of a light of radius 1 that fills the picture of a camera so far above it."""
    eye = np.array([0.3, -0.5, 0.2]) + (1 + height) * np.array([0.6, 0.48, 0.64])
    camera = camera_at(eye, (0.3, -0.5, 0.2), fov=60)
    light = Sphere((0.3, -0.5, 0.2), 1, radiance=0.1)
    return relative(mean_in_drpt(Scene(camera, [light]), samples, 0), 0.1)


def furnace(light_radius: float, radiance: float) -> Scene:
    """A light in the middle of a closed diffuse sphere of radius 1."""
    camera = camera_at((0.1, 0, 0.8), (0.3, 0.2, 2), fov=60)
    wall = Sphere((0, 0, 0), 1, material=Diffuse(0.8))
    return Scene(camera, [wall, Sphere((0, 0, 0), light_radius, radiance=radiance)])


def in_furnace(
    mean: Callable[[Scene, int, int], float],
    parameters: Callable[[float], tuple[float, float, int]],
) -> Measure:
    """Error of the wall's radiance, by (light's radius, radiance, bounces) at each value."""

    def error(value: float, samples: int) -> float:
        light_radius, radiance, bounces = parameters(value)
        expected = furnace_radiance(0.8, radiance, light_radius, 1, bounces)
        return relative(mean(furnace(light_radius, radiance), samples, bounces), expected)

    return error


def leaks(
    mean: Callable[[Scene, int, int], float], shape: Callable[[Floats, float], Mesh]
) -> Measure:
    """Radiance in a closed room, in units of that of a lamp around it, by the room's offset.

    All rays that pass a wall see the lamp, and from every vertex a shadow ray leads to it. Each
    path has `BOUNCES` + 1 rays, and shadow rays.
    """

    def error(offset: float, samples: int) -> float:
        center, _ = beside(1, offset)
        camera = camera_at(np.add(center, (0.1, 0.05, 0.02)), np.add(center, (1, 0, 0)), UP, 120)
        lamp = cube(np.zeros(3), 1.1 * offset + 4)
        around = Mesh(lamp.vertices, lamp.faces[:, ::-1], radiance=1)
        scene = Scene(camera, [shape(center, 1), around])
        return mean(scene, samples // (BOUNCES + 1), BOUNCES)

    return error


def _with_mis(scene: Scene, samples: int, bounces: int) -> float:
    return mean_in_drpt(scene, samples, bounces, Mode.MIS)


def closed_room(name: str, shape: Callable[[Floats, float], Mesh]) -> Case:
    """A case of light that leaks into a room."""
    return Case(
        name=f"closed room, {name}",
        parameter="offset in sizes",
        values=OFFSETS,
        quick=(0.1, 1e3),
        error=leaks(_with_mis, shape),
        mitsuba=leaks(mean_in_mitsuba, shape),
        bound=0,
        reason=NONE,
        naive="rays pass between triangles, and offsets lead through walls in corners",
        samples=2**22,
        long=RAYS // len(OFFSETS),
    )


def cornered_room(
    name: str, shape: Callable[[Floats, float], Mesh], bound: float = 1e-5, farthest: float = 1e5
) -> tuple[Case, Case]:
    """The same of a room whose corners are known to leak from far away on, but within a bound."""
    near = replace(closed_room(name, shape), values=OFFSETS[:3], quick=(0.1, 10.0))
    far = replace(
        near,
        name=f"{near.name}, far away",
        values=tuple(offset for offset in OFFSETS[3:] if offset <= farthest),
        quick=(1e3,),
        bound=bound,
        reason="the limit: rounding may put a vertex in a corner behind the other wall",
    )
    return near, far


POWERS = tuple(2.0**n for n in (-20, -10, -3, 3, 10, 20))
BITS = "a power of two changes no digit"
SCALE = "scene-wide epsilons do not scale along"
NOISE = "ten times the noise of the samples"

CASES = (
    Case(
        name="scene of other size",
        parameter="scale",
        values=POWERS,
        quick=(2.0**-20, 2.0**20),
        error=scaled(False),
        bound=0,
        reason=BITS,
        naive=SCALE,
        samples=2**18,
    ),
    Case(
        name="scene of many triangles of other size",
        parameter="scale",
        values=POWERS,
        quick=(2.0**-20, 2.0**20),
        error=scaled(True),
        bound=0,
        reason=BITS,
        naive=SCALE,
        samples=2**18,
    ),
    Case(
        name="scene of other radiance",
        parameter="radiance",
        values=tuple(2.0**n for n in (-60, -30, -10, 10, 30, 60)),
        quick=(2.0**-60, 2.0**60),
        error=brighter,
        bound=0,
        reason=BITS,
        naive="thresholds of what is too dark to trace cut off light",
        samples=2**18,
    ),
    Case(
        name="mean of equal samples",
        parameter="samples",
        values=(1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 2.0**33),
        quick=(1e2, 1e6),
        error=of_constant,
        bound=1e-6,
        reason="a few roundings of float32",
        naive="a float32 sum of 1e7 samples of 0.1 is off by 9 %, a count of 32 bits ends at 2³²",
        samples=0,
    ),
    Case(
        name="mean of equal passes",
        parameter="samples",
        values=tuple(2.0**n for n in (20, 24, 32, 33, 40, 48)),
        quick=(2.0**33, 2.0**48),
        error=of_passes,
        bound=1e-13,
        reason="a rounding of float64 for each pass",
        naive="float32 forgets whatever is 2²⁴ times less than the sum",
        samples=0,
    ),
    Case(
        name="passes that repeat others",
        parameter="samples of one pixel",
        values=tuple(2.0**n for n in (26, 30, 32, 33)),
        quick=(2.0**28,),
        error=repeated,
        bound=0,
        reason="all of them are to differ",
        naive="a sample's number of 32 bits begins anew at 2³², and so do the samples",
        samples=0,
    ),
    Case(
        name="camera close to a light",
        parameter="distance / radius",
        values=(0.3, 0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6),
        quick=(1e-6,),
        error=near_a_light,
        bound=1e-6,
        reason="a few roundings of float32: all samples are equal",
        naive="b² - c cancels, and the light is seen from inside",
    ),
    Case(
        name="furnace, explicit, by radiance",
        parameter="radiance",
        values=(1e-30, 1e-20, 1e-10, 1.0, 1e10, 1e20, 1e30),
        quick=(1e-30, 1e30),
        error=in_furnace(mean_in_drpt, lambda radiance: (0.5, radiance, 3)),
        bound=1e-3,
        reason=NOISE,
        naive="squares of radiances overflow or vanish",
    ),
    Case(
        name="furnace, mis, by bounces",
        parameter="bounces",
        values=(0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 8.0, 16.0, 32.0),
        quick=(0.0, 2.0),
        error=in_furnace(_with_mis, lambda bounces: (0.5, 1.0, int(bounces))),
        bound=1e-3,
        reason=NOISE,
        naive="one bounce more or less than asked for: off by a third at 2 bounces",
    ),
    Case(
        name="furnace, mis, by radius of the light",
        parameter="radius of the light / of the furnace",
        values=(1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 0.5),
        quick=(1e-6, 0.5),
        error=in_furnace(_with_mis, lambda radius: (radius, 1.0, 3)),
        bound=1e-3,
        reason=NOISE,
        naive="1 - √(1 - s²) cancels: wrong by 7 % at 1e-3, and black below 1.7e-4",
        mitsuba=in_furnace(mean_in_mitsuba, lambda radius: (radius, 1.0, 3)),
    ),
    closed_room("icosahedron", lambda center, size: icosphere(0, center, size)),
    closed_room("20480 triangles", lambda center, size: icosphere(5, center, size)),
    *cornered_room("cube", cube),
    *cornered_room("cube of needles 1e6 : 1", lambda c, size: cube(c, size, NEEDLES)),
    *cornered_room(
        "prism with an edge of 0.3 radians", lambda c, size: prism(c, size, 0.3), 1e-4, 1e4
    ),
)
