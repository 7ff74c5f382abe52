"""Every mode against radiances that are known in closed form."""

from __future__ import annotations

from math import cos, pi, sin
from typing import Any

import numpy as np
import pytest

import drpt
from tests.measuring import Measured, assert_agree, measure_to, with_radiance
from tests.oracle import closed_forms

# A bias of half a percent is seen in every case.
DETECTABLE = 0.005
# A picture shows one point of a plane: so small a field of view that nothing varies within it.
POINT_FOV = 1e-3

MODES = tuple(drpt.Mode)
LIGHT_SAMPLING = ("explicit-uniform", "explicit", "mis")
BRDF_SAMPLING = ("implicit", "mis")
SIDE = 64

PLANE = [[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]]
QUAD = [[0, 1, 2], [0, 2, 3]]


def slow(*cases: Any) -> list[Any]:
    marked = (case if isinstance(case, tuple) else (case,) for case in cases)
    return [pytest.param(*case, marks=pytest.mark.slow) for case in marked]


def looking_at_origin(theta: float) -> drpt.Camera:
    """Camera that sees the origin alone, at the angle θ from z, from −x."""
    eye = (-3 * sin(theta), 0, 3 * cos(theta))
    return drpt.Camera(eye, (0, 0, 0), (0, 1, 0), POINT_FOV, SIDE, SIDE)


def sphere_light(sigma: float, omega: float) -> drpt.Sphere:
    """Light of radiance 1 that fills the half-angle σ at the angle ω from z, towards x."""
    return drpt.Sphere((2 * sin(omega), 0, 2 * cos(omega)), 2 * sin(sigma), radiance=1)


def furnace(light_radius: float) -> drpt.Scene:
    return drpt.Scene(
        camera=drpt.Camera((0.1, 0, 0.8), (0.3, 0.2, 2), (0, 1, 0), 60, SIDE, SIDE),
        shapes=[
            drpt.Sphere((0, 0, 0), 1, material=drpt.Diffuse((0.8, 0.5, 1))),
            drpt.Sphere((0, 0, 0), light_radius, radiance=2),
        ],
    )


def furnace_truth(light_radius: float, bounces: int) -> list[float]:
    return [
        closed_forms.furnace_radiance(albedo, 2, light_radius, 1, bounces)
        for albedo in (0.8, 0.5, 1)
    ]


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("bounces", [1, 2, *slow(3, 4, 8)])
def test_furnace(bounces: int, mode: str) -> None:
    found = measure_to(DETECTABLE, furnace(0.5), bounces, mode)
    assert_agree(found, furnace_truth(0.5, bounces), DETECTABLE)


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["implicit", "explicit", "mis"])
def test_furnace_of_32_bounces(mode: str) -> None:
    found = measure_to(DETECTABLE, furnace(0.2), 32, mode)
    assert_agree(found, furnace_truth(0.2, 32), DETECTABLE)


@pytest.mark.parametrize("mode", MODES)
def test_furnace_without_bounces_is_black(mode: str) -> None:
    assert not drpt.render(furnace(0.5), 4, 0, mode).image.any()


PLANE_CASES = {
    "above": (0.5, 0.4),
    "touching the horizon": (0.5, pi / 2 - 0.5),
    "half below": (0.6, pi / 2),
    "mostly above": (0.5, 1.3),
    "mostly below": (0.7, 1.9),
}
SMALL_CASES = {"small": (0.01, 0.8), "tiny": (1e-4, 0.3), "low": (0.02, 1.5)}


def lit_plane(sigma: float, omega: float) -> drpt.Scene:
    plane = drpt.Mesh(PLANE, QUAD, material=drpt.Diffuse(0.8))
    return drpt.Scene(camera=looking_at_origin(0.7), shapes=[plane, sphere_light(sigma, omega)])


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize(
    "case", ["above", "half below", *slow("mostly above", "mostly below", "touching the horizon")]
)
def test_plane_under_a_sphere_light(case: str, mode: str) -> None:
    found = measure_to(DETECTABLE, lit_plane(*PLANE_CASES[case]), 1, mode)
    irradiance = closed_forms.sphere_light_irradiance(1, *PLANE_CASES[case])
    assert_agree(found, 0.8 / pi * irradiance, DETECTABLE)


@pytest.mark.parametrize("mode", LIGHT_SAMPLING)
@pytest.mark.parametrize("case", SMALL_CASES)
def test_plane_under_a_small_light(case: str, mode: str) -> None:
    found = measure_to(DETECTABLE, lit_plane(*SMALL_CASES[case]), 1, mode)
    irradiance = closed_forms.sphere_light_irradiance(1, *SMALL_CASES[case])
    assert_agree(found, 0.8 / pi * irradiance, DETECTABLE)


@pytest.mark.parametrize("mode", MODES)
def test_light_below_the_horizon_lights_nothing(mode: str) -> None:
    assert not drpt.render(lit_plane(0.3, 2.2), 64, 1, mode).image.any()


@pytest.mark.parametrize("mode", MODES)
def test_flux_through_a_rectangle(mode: str) -> None:
    """Seen at a right angle, the picture's mean is the rectangle's mean; the light is behind."""
    half_a, half_b, height, radius = 1.5, 1.0, 1.2, 0.5
    eye_height = 0.6
    fov = 2 * np.degrees(np.arctan(half_b / eye_height))
    scene = drpt.Scene(
        camera=drpt.Camera((0, 0, eye_height), (0, 0, 0), (0, 1, 0), fov, 96, 64),
        shapes=[
            drpt.Mesh(PLANE, QUAD, material=drpt.Diffuse(0.8)),
            drpt.Sphere((0, 0, height), radius, radiance=3),
        ],
    )
    flux = closed_forms.sphere_light_flux_through_rectangle(3, radius, height, half_a, half_b)
    truth = 0.8 / pi * flux / (4 * half_a * half_b)
    assert_agree(measure_to(DETECTABLE, scene, 1, mode), truth, DETECTABLE)


def mirrored_light(exponent: float, sigma: float, theta: float) -> drpt.Scene:
    plane = drpt.Mesh(PLANE, QUAD, material=drpt.Phong(0.9, exponent))
    return drpt.Scene(camera=looking_at_origin(theta), shapes=[plane, sphere_light(sigma, theta)])


@pytest.mark.parametrize(
    ("exponent", "mode"),
    [
        *((5, mode) for mode in MODES),
        *((exponent, mode) for exponent in (1e3, 1e7) for mode in BRDF_SAMPLING),
        *slow(*((exponent, mode) for exponent in (0, 1, 30) for mode in MODES)),
        *slow((1e3, "explicit"), (1e5, "implicit"), (1e5, "mis")),
    ],
)
def test_phong_mirrors_a_light(exponent: float, mode: str) -> None:
    scene = mirrored_light(exponent, 0.45, 0.6)
    truth = closed_forms.phong_mirrored_light(0.9, exponent, 1, 0.45, 0.6)
    assert_agree(measure_to(DETECTABLE, scene, 1, mode), truth, DETECTABLE)


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize(("exponent", "theta"), [(20, 1.2), *slow((0, 1.2), (1, 0.3), (20, 0.0))])
def test_phong_in_a_uniform_environment_shows_its_albedo(
    exponent: float, theta: float, mode: str
) -> None:
    corners = 9 * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    inward = [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ]  # fmt: skip
    scene = drpt.Scene(
        camera=looking_at_origin(theta),
        shapes=[
            drpt.Mesh(np.divide(PLANE, 9), QUAD, material=drpt.Phong(0.9, exponent)),
            drpt.Mesh(corners, np.fliplr(inward), radiance=2),
        ],
    )
    truth = 2 * closed_forms.phong_directional_albedo(0.9, exponent, theta)
    assert_agree(measure_to(DETECTABLE, scene, 1, mode), truth, DETECTABLE)


def test_the_gate_sees_half_a_percent() -> None:
    scene = furnace(0.5)
    truth = furnace_truth(0.5, 2)
    for factor in (1 - DETECTABLE, 1 + DETECTABLE):
        found = measure_to(DETECTABLE, with_radiance(scene, factor), 2, "explicit")
        with pytest.raises(AssertionError, match="means differ"):
            assert_agree(found, truth, DETECTABLE)


def test_the_gate_refuses_what_is_too_noisy() -> None:
    noisy = Measured(np.ones(3), np.full(3, 0.01))
    with pytest.raises(AssertionError, match="detects"):
        assert_agree(noisy, 1.0, DETECTABLE)
