"""Whole pictures: scales, sums of many samples, rooms that no light may enter."""

from __future__ import annotations

from functools import cache
from math import isqrt
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.stress.harness import Case
from benchmarks.stress.intersection import NONE
from benchmarks.stress.lights import relative
from benchmarks.stress.pictures import camera_at, mean_in_drpt, mean_in_mitsuba
from benchmarks.stress.world import DULL, NEEDLES, beside, cube, icosphere
from drpt import Camera, Diffuse, Mesh, Mode, Phong, Scene, Sphere, render
from drpt.crosscheck import to_mitsuba
from drpt.crosscheck.variant import load_mitsuba
from tests.oracle.closed_forms import furnace_radiance

if TYPE_CHECKING:
    from collections.abc import Callable

    from benchmarks.stress.harness import Measure
    from drpt.scene import Shape
    from tests.oracle.arrays import Floats

SIDE = 64
OFFSETS = (0.1, 1.0, 10.0, 1e2, 1e3, 1e4, 1e5)


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
    """Error of the mean of so many samples of a light of radiance 0.1 that fills the picture."""
    camera = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), 1, 1, 1)
    scene = Scene(camera, [Sphere((0, 0, 0), 1, radiance=0.1)])
    return relative(float(render(scene, int(samples), 0).image[0, 0, 0]), 0.1)


def of_constant_in_mitsuba(samples: float, _: int) -> float:
    """The same in Mitsuba."""
    camera = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), 1, 1, 1)
    scene = Scene(camera, [Sphere((0, 0, 0), 1, radiance=0.1)])
    return relative(mean_in_mitsuba(scene, int(samples) * 256, 0), 0.1)


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


def leaks(picture: Callable[[Scene], Floats], shape: Callable[[Floats, float], Mesh]) -> Measure:
    """Share of paths in a closed room that see the light outside of it, by the room's offset.

    From all vertices of a path a shadow ray leads to the light.
    """

    def error(offset: float, samples: int) -> float:
        center, light = beside(1, offset)
        side = isqrt(samples)
        camera = Camera(
            np.add(center, (0.1, 0.05, 0.02)), np.add(center, (1, 0, 0)), (0, 0, 1), 120, side, side
        )
        return float(picture(Scene(camera, [shape(center, 1), light])).any(axis=2).mean())

    return error


def _sample_in_drpt(scene: Scene) -> Floats:
    return render(scene, 1, 3, Mode.EXPLICIT).image.astype(np.float64)


def _sample_in_mitsuba(scene: Scene) -> Floats:
    mi = load_mitsuba()
    return np.asarray(mi.render(to_mitsuba(scene, 3), spp=1).numpy(), np.float64)


def closed_room(name: str, shape: Callable[[Floats, float], Mesh]) -> Case:
    """A case of light that leaks into a room."""
    return Case(
        name=f"closed room, {name}",
        parameter="offset in sizes",
        values=OFFSETS,
        quick=(0.1, 1e3),
        error=leaks(_sample_in_drpt, shape),
        mitsuba=leaks(_sample_in_mitsuba, shape),
        bound=0,
        reason=NONE,
        naive="rays pass between triangles, and offsets lead through walls in corners",
    )


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
        values=(1e2, 1e3, 1e4, 1e5, 1e6, 1e7),
        quick=(1e2, 1e6),
        error=of_constant,
        bound=1e-6,
        reason="a few roundings of float32",
        naive="a float32 sum of 1e7 samples of 0.1 is off by 9 %",
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
        name="furnace, mis, by radius of the light",
        parameter="radius of the light / of the furnace",
        values=(1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 0.5),
        quick=(1e-6, 0.5),
        error=in_furnace(
            lambda scene, samples, bounces: mean_in_drpt(scene, samples, bounces, Mode.MIS),
            lambda radius: (radius, 1.0, 3),
        ),
        bound=1e-3,
        reason=NOISE,
        naive="1 - √(1 - s²) cancels: wrong by 7 % at 1e-3, and black below 1.7e-4",
        mitsuba=in_furnace(mean_in_mitsuba, lambda radius: (radius, 1.0, 3)),
    ),
    closed_room("icosahedron", lambda center, size: icosphere(0, center, size)),
    closed_room("20480 triangles", lambda center, size: icosphere(5, center, size)),
    closed_room("cube", cube),
    closed_room("cube of needles 1e6 : 1", lambda center, size: cube(center, size, NEEDLES)),
)
