"""Phong reflection: a light around the mirror direction, and the albedo of ever sharper lobes."""

from __future__ import annotations

from math import acos, cos, radians, sin
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.stress.harness import Case
from benchmarks.stress.lights import relative, sobol
from benchmarks.stress.pictures import camera_at, mean_in_drpt, mean_in_mitsuba
from drpt import Mesh, Mode, Phong, Scene, Sphere
from drpt.kernel.bsdfs import Bsdf, PhongLobe, SurfacePoint
from tests.conftest import to_device, to_host
from tests.oracle.closed_forms import phong_directional_albedo, phong_mirrored_light

if TYPE_CHECKING:
    from collections.abc import Callable

    from benchmarks.stress.harness import Measure

ERROR = 1e-3
"""Relative, of what is reflected."""
REASON = "a quarter of a step of 8 bits, and above the noise of the samples"
EXPONENTS = (1.0, 10.0, 100.0, 1e3, 1e4, 1e5, 1e6)
TILTS = (60.0, 30.0, 10.0, 3.0, 1.0, 0.3, 0.1, 0.01)
"""Degrees of a view above the horizon."""
ALBEDO = 0.9
VIEW = 0.6
"""Angle of the view in pictures, in radians: less than that of any light to the horizon."""


def mirrored_light(exponent: float) -> tuple[Scene, float]:
    """A plane under a light that fills half of the lobe, or as much as fits; and what it shows."""
    sigma = min(acos(0.5 ** (1 / (exponent + 2))), 0.8)
    direction = np.array([sin(VIEW), 0, cos(VIEW)])
    corners = [(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)]
    plane = Mesh(corners, [(0, 1, 2), (0, 2, 3)], material=Phong(ALBEDO, exponent))
    light = Sphere(2 * direction, 2 * sin(sigma), radiance=1)
    eye = 3 * direction * (-1, 1, 1)
    scene = Scene(camera_at(eye, (0, 0, 0)), [plane, light])
    return scene, phong_mirrored_light(ALBEDO, exponent, 1, sigma, VIEW)


def of_mirrored_light(mean: Callable[[Scene, int], float]) -> Measure:
    """Error of the light that a plane mirrors, by its exponent."""

    def error(exponent: float, samples: int) -> float:
        scene, expected = mirrored_light(exponent)
        return relative(mean(scene, samples), expected)

    return error


def _in_mode(mode: Mode) -> Callable[[Scene, int], float]:
    return lambda scene, samples: mean_in_drpt(scene, samples, mode=mode)


def _bsdf(exponent: float, theta: float) -> Bsdf:
    """One point with the normal +z, seen at the angle θ from it."""
    normal, view = to_device([[0, 0, 1]]), to_device([[sin(theta), 0, cos(theta)]])
    albedo, code = to_device([[ALBEDO] * 3]), to_device([exponent])
    point = SurfacePoint(code, normal, view)
    return Bsdf((PhongLobe(),), albedo, code, point, None)


def of_albedo(exponent: float) -> Measure:
    """Error of the mean weight of samples, by the view's height above the horizon."""

    def error(height: float, samples: int) -> float:
        theta = radians(90 - height)
        weight = _bsdf(exponent, theta).sample(sobol(samples)).weight
        expected = phong_directional_albedo(ALBEDO, exponent, theta)
        return relative(float(to_host(weight.x).mean()), expected)

    return error


def of_integral(exponent: float) -> Measure:
    """The same of the integral of `eval`, by directions drawn from the exact density in float64."""

    def error(height: float, samples: int) -> float:
        theta = radians(90 - height)
        log_cos = np.log1p(-(np.arange(samples) + 0.5) / samples) / (exponent + 1)
        cosine, sine = np.exp(log_cos), np.sqrt(-np.expm1(2 * log_cos))
        phi = 2 * np.pi * ((np.arange(samples) * GOLDEN) % 1)
        density = (exponent + 1) / (2 * np.pi) * np.exp(exponent * log_cos)
        axis = np.array([-sin(theta), 0, cos(theta)])
        side, across = np.array([cos(theta), 0, sin(theta)]), np.array([0, 1, 0])
        local = np.outer(sine * np.cos(phi), side) + np.outer(sine * np.sin(phi), across)
        value = to_host(_bsdf(exponent, theta).eval(to_device(local + np.outer(cosine, axis))).x)
        expected = phong_directional_albedo(ALBEDO, exponent, theta)
        return relative(float((value / density).mean()), expected)

    return error


GOLDEN = (5**0.5 - 1) / 2
"""Its multiples, modulo 1, fill the unit interval most evenly."""
POWER = "1 - cos of the lobe's angle from a plain power is off by 4 % at 1e4 and 187 % at 1e6"
CANCELS = "the power of a rounded cosine is off by 6e-8 of the exponent: 6 % at 1e6"


def mirrored(name: str, mode: Mode, naive: str) -> Case:
    """A case of a light around the mirror direction, in a picture."""
    return Case(
        name=f"Phong, mirrored light, {name}",
        parameter="exponent",
        values=EXPONENTS,
        quick=(EXPONENTS[0], EXPONENTS[-1]),
        error=of_mirrored_light(_in_mode(mode)),
        bound=ERROR,
        reason=REASON,
        naive=naive,
        mitsuba=of_mirrored_light(mean_in_mitsuba),
    )


def albedo(name: str, exponent: float, measure: Callable[[float], Measure], naive: str) -> Case:
    """A case of directional albedo."""
    return Case(
        name=f"Phong, albedo by {name}, exponent {exponent:g}",
        parameter="degrees above the horizon",
        values=TILTS,
        quick=(TILTS[0], TILTS[-1]),
        error=measure(exponent),
        bound=ERROR,
        reason=REASON,
        naive=naive,
    )


CASES = (
    mirrored("explicit", Mode.EXPLICIT, CANCELS),
    mirrored("implicit", Mode.IMPLICIT, POWER),
    mirrored("mis", Mode.MIS, CANCELS),
    *(albedo("samples", exponent, of_albedo, POWER) for exponent in (1.0, 50.0, 1e3, 1e6)),
    *(albedo("quadrature", exponent, of_integral, CANCELS) for exponent in (1.0, 1e3, 1e6)),
)
