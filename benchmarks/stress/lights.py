"""Light of spheres: what arrives at a receiver, against the closed form."""

from __future__ import annotations

from math import acos, asin, cos, hypot, pi, sin, sqrt
from typing import TYPE_CHECKING, Any, TypeAlias

import drjit as dr
import numpy as np

from benchmarks.stress.harness import Case
from benchmarks.stress.pictures import camera_at, mean_in_drpt, mean_in_mitsuba
from drpt import Diffuse, Mesh, Scene, Sphere
from drpt.crosscheck.variant import load_mitsuba
from drpt.kernel.device_scene import upload
from drpt.kernel.emitters import Choice, Receiver
from drpt.kernel.primitives import make_primitives
from drpt.kernel.sampler import SobolSampler
from tests.conftest import TYPES, to_device, to_host
from tests.oracle.arrays import Floats
from tests.oracle.closed_forms import sphere_light_irradiance

if TYPE_CHECKING:
    from collections.abc import Callable

    from benchmarks.stress.harness import Measure

ERROR = 1e-4
"""Relative, of the irradiance."""
REASON = "a fortieth of a step of 8 bits, and above the noise of the samples"
SINES = (0.5, 0.2, 0.1, 0.03, 0.01, 1e-3, 1e-4, 1e-5, 1e-6)
TINY = (*SINES, 1e-7, 1e-8, 1e-9)
GAPS = (1.0, 0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
ORIGIN = np.zeros(3)
UP = np.array([0.0, 0.0, 1.0])
TILTED = np.array([0.36, 0.48, 0.8])
"""A normal whose components all take part in a cosine."""
FLOOR = Mesh([(-9, -9, -9), (9, -9, -9), (0, 9, -9)], [(0, 1, 2)], material=Diffuse(0.5))
"""Out of the way: something that reflects."""

Lit: TypeAlias = tuple[Sphere, Floats]
"""A light, and the normal of the receiver at the origin."""


def irradiance(sine: float, cosine: float) -> float:
    """Irradiance of a plane by a sphere light of radiance 1: sin σ = r/d, and cos ω."""
    return sphere_light_irradiance(1, asin(sine), acos(min(cosine, 1)))


def relative(found: float, expected: float) -> float:
    """Error relative to what is expected; of 0, the value itself."""
    return abs(found - expected) / (expected or 1)


def in_drpt(light: Sphere, normal: Floats, samples: int) -> float:
    """Irradiance at the origin, by samples of the light alone."""
    primitives = make_primitives(Scene(camera_at((0, 0, 5), ORIGIN), [FLOOR, light]).shapes)
    scene = upload(primitives, TYPES)
    at = Receiver(to_device([ORIGIN - primitives.origin]), to_device([normal]))
    choice = Choice(TYPES.UInt32([0]), TYPES.Float32(1))
    sample = scene.emitters.sample(at, choice, sobol(samples), visible=True)
    cosine = np.maximum(to_host(sample.direction) @ normal, 0)
    return float((to_host(sample.inverse_pdf) * cosine).mean())


def in_mitsuba(light: Sphere, normal: Floats, samples: int) -> float:
    """The same in Mitsuba."""
    mi = load_mitsuba()
    scene = mi.load_dict(
        {
            "type": "scene",
            "light": {
                "type": "sphere",
                "center": list(light.center),
                "radius": light.radius,
                "emitter": {"type": "area", "radiance": {"type": "rgb", "value": 1.0}},
            },
        }
    )
    receiver = dr.zeros(mi.SurfaceInteraction3f, samples)
    sample, weight = scene.sample_emitter_direction(receiver, mi.Point2f(sobol(samples)), False)
    cosine = np.maximum(np.array(sample.d).T @ normal, 0)
    return float((np.array(weight)[0] * cosine).mean(dtype=np.float64))


def sobol(samples: int) -> Any:
    """The first points of the unit square that the Sobol sampler gives."""
    index = TYPES.UInt32(np.arange(samples, dtype=np.uint32))
    return SobolSampler(TYPES.UInt32([0]), index, TYPES.UInt32([0])).next_2d(0)


def _rounded(x: float) -> float:
    return float(np.float32(x))


def at_sine(share: Callable[[float], float], normal: Floats) -> Callable[[float], Lit]:
    """Lights of a given sine r/d whose centre stands at cos ω = ``share(sine)``."""
    tangent = np.cross(normal, (0.0, 1.0, 0.0))
    tangent /= np.linalg.norm(tangent)

    def light(sine: float) -> Lit:
        cosine = share(sine)
        center = 2 * (cosine * normal + sqrt(1 - cosine**2) * tangent)
        return Sphere([_rounded(x) for x in center], _rounded(2 * sine), radiance=1), normal

    return light


def at_gap(omega: float) -> Callable[[float], Lit]:
    """Lights of radius 1 with a given gap d/r − 1 and incidence, rounded to float32."""

    def light(gap: float) -> Lit:
        center = [_rounded((1 + gap) * x) for x in (sin(omega), 0.0, cos(omega))]
        return Sphere(center, 1, radiance=1), UP

    return light


def compared(renderer: Callable[..., float], light: Callable[[float], Lit]) -> Measure:
    """Error of a renderer's irradiance by the light at each value."""

    def error(value: float, samples: int) -> float:
        sphere, normal = light(value)
        distance = hypot(*sphere.center)
        expected = irradiance(sphere.radius / distance, float(sphere.center @ normal) / distance)
        return relative(renderer(sphere, normal, samples), expected)

    return error


def sphere_light(
    name: str, parameter: str, values: tuple[float, ...], light: Callable[[float], Lit], naive: str
) -> Case:
    """A case of irradiance by samples of the light."""
    return Case(
        name=f"sphere light, {name}",
        parameter=parameter,
        values=values,
        quick=(values[0], values[len(values) // 2], values[-2]),
        error=compared(in_drpt, light),
        bound=ERROR,
        reason=REASON,
        naive=naive,
        samples=2**22,
        mitsuba=compared(in_mitsuba, light),
    )


def under_a_light(gap: float) -> tuple[Scene, float]:
    """A plane in a general place, and a light of radius 1 that is so far off its point 0.7 aside.

    The camera looks at the point from below the light's equator, so low that its picture must be
    very small.
    """
    point = np.array([0.7, -0.4, 0.0])
    low = min(0.5, sqrt(gap) / 2)
    eye = point + 3 * np.array([0.8 * sqrt(1 - low**2), 0.6 * sqrt(1 - low**2), low])
    corners = [(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)]
    scene = Scene(
        camera_at(eye, point, UP, fov=1e-6),
        [
            Mesh(corners, [(0, 1, 2), (0, 2, 3)], material=Diffuse(1)),
            Sphere(np.add(point, (0, 0, 1 + gap)), 1, radiance=1),
        ],
    )
    return scene, irradiance(1 / (1 + gap), 1)


def at_pole(side: int) -> Callable[[float], Lit]:
    """Lights so far off the pole of the basis around their direction, on either side of it."""

    def light(angle: float) -> Lit:
        center = [_rounded(2 * x) for x in (sin(angle), 0.0, side * cos(angle))]
        return Sphere(center, 0.5, radiance=1), side * UP

    return light


def floor_below(*above: Sphere) -> Scene:
    """A white floor, of which the camera sees the origin, and what stands above it."""
    corners = [(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)]
    floor = Mesh(corners, [(0, 1, 2), (0, 2, 3)], material=Diffuse(1))
    return Scene(camera_at((2, 3, 1), ORIGIN, UP), [floor, *above])


def light_within(gap: float) -> tuple[Scene, float]:
    """A light around another one that is smaller by so much, and five times as bright."""
    center = (0.5, 0.3, 2)
    outer, inner = Sphere(center, 0.7, radiance=1), Sphere(center, 0.7 * (1 - gap), radiance=5)
    distance = hypot(*center)
    return floor_below(outer, inner), irradiance(0.7 / distance, 2 / distance)


def occluder(radius: float) -> tuple[Scene, float]:
    """A black ball that touches a light of radius 1 where it is nearest to the origin."""
    ball = Sphere((0, 0, 2 - radius), radius, material=Diffuse(0))
    scene = floor_below(Sphere((0, 0, 3), 1, radiance=1), ball)
    return scene, pi * (1 / 9 - (radius / (2 - radius)) ** 2)


def weak_light(ratio: float) -> tuple[Scene, float]:
    """A red light beside a green one, whose radiance is so many times as large."""
    center, green = (1.5, 0.5, 1), (0, ratio**0.5, 0)
    scene = floor_below(
        Sphere(center, 0.4, radiance=(ratio**-0.5, 0, 0)), Sphere((-1, 1, 2), 0.4, radiance=green)
    )
    distance = hypot(*center)
    return scene, ratio**-0.5 * irradiance(0.4 / distance, 1 / distance)


def many_lights(count: float) -> tuple[Scene, float]:
    """So many lights of different radiance all over the sky; the weights of a Fibonacci lattice."""
    number = np.arange(int(count)) + 0.5
    height, turn = 0.2 + 0.8 * number / count, pi * (1 + 5**0.5) * number
    flat = np.sqrt(1 - height**2)
    centers = 5 * np.stack([flat * np.cos(turn), flat * np.sin(turn), height], axis=1)
    radiances = 1 + number % 7
    lights = [Sphere(c, 0.05, radiance=L) for c, L in zip(centers, radiances, strict=True)]
    return floor_below(*lights), float(irradiance(0.01, 1) * (radiances * height).sum())


def seen(
    scene: Callable[[float], tuple[Scene, float]], mean: Callable[[Scene, int], float]
) -> Measure:
    """Error of the irradiance that the camera sees reflected by a white floor."""

    def error(value: float, samples: int) -> float:
        lit, expected = scene(value)
        return relative(pi * mean(lit, samples), expected)

    return error


def in_picture(
    name: str,
    parameter: str,
    values: tuple[float, ...],
    scene: Callable[[float], tuple[Scene, float]],
    naive: str,
) -> Case:
    """A case of light that a floor reflects, in a picture."""
    return Case(
        name=name,
        parameter=parameter,
        values=values,
        quick=(values[0], values[-1]),
        error=seen(scene, mean_in_drpt),
        bound=1e-3,
        reason="a quarter of a step of 8 bits, and above the noise of the samples",
        naive=naive,
        mitsuba=seen(scene, mean_in_mitsuba),
    )


ANGLES = (1.0, 0.1, 1e-2, 1e-4, 1e-8, 1e-12)
POLE = "a basis from a cross product with the axis has no direction there"
CONE = "1 - √(1 - s²) cancels: wrong by 7 % at 1e-3, and the light is black below 1.7e-4"
NEAR = "d² - r² cancels: the light that remains is wrong by 0.4 % at 1e-3, by 37 % at 1e-4"

CASES = (
    sphere_light("above the horizon", "r/d", TINY, at_sine(lambda s: 0.8, UP), CONE),
    sphere_light("half below", "r/d", TINY, at_sine(lambda s: 0.0, UP), CONE),
    sphere_light("mostly below", "r/d", TINY, at_sine(lambda s: -0.5 * s, UP), CONE),
    sphere_light("half below a tilted plane", "r/d", SINES, at_sine(lambda s: 0.0, TILTED), CONE),
    sphere_light(
        "wholly below", "r/d", TINY, at_sine(lambda s: -1.5 * s, UP), "rounding lets some through"
    ),
    sphere_light("at the pole of the basis", "angle", ANGLES, at_pole(1), POLE),
    sphere_light("at the other pole", "angle", ANGLES, at_pole(-1), POLE),
    sphere_light("close above", "d/r - 1", GAPS, at_gap(0.0), NEAR),
    sphere_light("close aside", "d/r - 1", GAPS, at_gap(pi / 3), NEAR),
    sphere_light("close, mostly below", "d/r - 1", GAPS, at_gap(2.0), NEAR),
    Case(
        name="sphere light, close above, in a picture",
        parameter="d/r - 1",
        values=GAPS[:-1],
        quick=(1.0, 1e-6),
        error=seen(under_a_light, mean_in_drpt),
        bound=ERROR,
        reason=REASON,
        naive="the offset of the shadow ray leads into the light, and the point is black",
        mitsuba=seen(under_a_light, mean_in_mitsuba),
    ),
    in_picture(
        "light within a light",
        "gap / radius",
        (0.5, 0.1, 1e-2, 1e-3, 1e-4, 4e-5),
        light_within,
        "shadow rays that end short of their light see the inner one through the outer",
    ),
    in_picture(
        "ball that touches a light",
        "radius / radius of the light",
        (0.5, 0.1, 1e-2, 1e-3),
        occluder,
        "shadow rays that end at 99.9 % of their way miss what touches the light",
    ),
    in_picture(
        "weak light beside a strong one",
        "ratio of radiances",
        (1.0, 1e2, 1e4, 1e6, 1e8, 1e10, 1e12),
        weak_light,
        "a light that is chosen by power alone is never found",
    ),
    in_picture(
        "many lights",
        "lights",
        (1.0, 10.0, 64.0, 65.0, 100.0, 1000.0),
        many_lights,
        "a cumulative float32 sum of probabilities does not end at 1",
    ),
)
