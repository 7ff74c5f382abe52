from importlib import import_module
from math import cos, radians, sin, sqrt
from typing import Any

import drjit as dr
import numpy as np
import pytest

from drpt import Camera, Diffuse, Phong, Scene, Sphere
from drpt.crosscheck import to_mitsuba
from tests.oracle import brdf as oracle
from tests.oracle.arrays import Floats, sample_uniform_sphere
from tests.oracle.statistics import sidak

SIGNIFICANCE = 0.01  # of each sweep of chi² tests; Mitsuba's own level
QUADRATURE = 40  # points per axis and cell: the density is cut off at the horizon, inside cells
TAIL = 20.0  # the domain around a lobe leaves out e^-20 of it
BIAS = 0.04  # of the exponent; the chi² test detects it
DIRECTIONS = 100_000
WEIGHT = 1e-6  # relative, weight × pdf against eval: a few products

COLOUR = (0.2, 0.5, 1.0)
TILTS = [0.0, 40.0, 80.0, 89.9]
WIDE = [0.0, 1.0, 10.0, 100.0]
SHARP = [1e3, 5e4, 1e6]


def value_error(exponent: float) -> float:
    """Return the error relative to the maximum: directions off by 6e-8 move the lobe's flank."""
    return 1e-6 + 1.5e-7 * sqrt(exponent)


def plugin(exponent: float) -> dict[str, Any]:
    colour = {"type": "rgb", "value": COLOUR}
    return {"type": "drpt_phong", "reflectance": colour, "exponent": exponent}


def tilted(degrees: float) -> list[float]:
    return [sin(radians(degrees)), 0.0, cos(radians(degrees))]


class LobeDomain:
    """A cap around ω_r that holds the lobe, as (azimuth, share of the cap's height)."""

    def __init__(self, mi: Any, tilt: float, exponent: float) -> None:
        self.mi = mi
        self.frame = mi.Frame3f(mi.reflect(mi.Vector3f(tilted(tilt))))
        self.height = TAIL / (exponent + 1)

    def bounds(self) -> Any:
        return self.mi.ScalarBoundingBox2f([-dr.pi, 0], [dr.pi, 1])

    def aspect(self) -> float:
        return 2

    def map_forward(self, p: Any) -> Any:
        below_pole = self.height * p.y
        sin_theta = dr.sqrt(below_pole * (2 - below_pole))
        sin_phi, cos_phi = dr.sincos(p.x)
        local = self.mi.Vector3f(sin_theta * cos_phi, sin_theta * sin_phi, 1 - below_pole)
        return self.frame.to_world(local)

    def map_backward(self, direction: Any) -> Any:
        local = self.frame.to_local(direction)
        below_pole = dr.squared_norm(self.frame.n - direction) / 2
        return self.mi.Vector2f(dr.atan2(local.y, local.x), below_pole / self.height)


def make_test(domain: Any, tilt: float, exponent: float, sampled: float) -> Any:
    """Return Mitsuba's chi² test of samples of one exponent against the density of another."""
    chi2: Any = import_module("mitsuba.chi2")
    sample, _ = chi2.BSDFAdapter("drpt_phong", plugin(sampled), wi=tilted(tilt))
    _, pdf = chi2.BSDFAdapter("drpt_phong", plugin(exponent), wi=tilted(tilt))
    height = getattr(domain, "height", 1.0)
    density = lambda wo: height * pdf(wo)  # noqa: E731
    return chi2.ChiSquareTest(domain, sample, density, sample_dim=3, ires=QUADRATURE)


@pytest.mark.parametrize("tilt", TILTS)
@pytest.mark.parametrize("exponent", WIDE)
@pytest.mark.usefixtures("mi")
def test_samples_follow_the_density(exponent: float, tilt: float) -> None:
    sphere = import_module("mitsuba.chi2").SphericalDomain()
    test = make_test(sphere, tilt, exponent, exponent)
    assert test.run(SIGNIFICANCE, len(WIDE) * len(TILTS), quiet=True), test.messages


@pytest.mark.parametrize("tilt", TILTS)
@pytest.mark.parametrize("exponent", SHARP)
def test_samples_follow_the_density_of_sharp_lobes(mi: Any, exponent: float, tilt: float) -> None:
    test = make_test(LobeDomain(mi, tilt, exponent), tilt, exponent, exponent)
    assert test.run(SIGNIFICANCE, len(SHARP) * len(TILTS), quiet=True), test.messages


def test_chi2_detects_a_bias(mi: Any) -> None:
    test = make_test(LobeDomain(mi, 40.0, 1e3), 40.0, 1e3, 1e3 * (1 + BIAS))
    test.run(quiet=True)
    assert test.p_value < sidak(SIGNIFICANCE, len(SHARP) * len(TILTS))


def surface(material: Diffuse | Phong) -> Any:
    """Return Mitsuba's surface for a material, as scenes get it."""
    camera = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), 30, 1, 1)
    return to_mitsuba(Scene(camera, [Sphere((0, 0, 0), 1, material)])).shapes()[0].bsdf()


def interaction(mi: Any, wo: Floats) -> Any:
    """Return points of the plane z = 0, seen from `wo` (n, 3)."""
    si = dr.zeros(mi.SurfaceInteraction3f, len(wo))
    si.n = mi.Normal3f(0, 0, 1)
    si.sh_frame = mi.Frame3f(si.n)
    si.wi = mi.Vector3f(wo.T)
    return si


def directions(exponent: float) -> tuple[Floats, Floats]:
    """Return ω_o, and ω_i near the lobe's flank and anywhere."""
    rng = np.random.default_rng(0)
    wo = sample_uniform_sphere(rng, DIRECTIONS)
    mirrored = wo * [-1, -1, 1]
    width = 1 / sqrt(exponent + 1)
    wi = mirrored + width * rng.choice([0.5, 1.0, 30.0], (DIRECTIONS, 1)) * rng.normal(
        size=wo.shape
    )
    wi /= np.linalg.norm(wi, axis=1, keepdims=True)
    return wo, wi


@pytest.mark.parametrize(
    "material", [Diffuse(COLOUR), *(Phong(COLOUR, exponent) for exponent in (*WIDE, *SHARP))]
)
def test_values_are_the_oracles_on_both_sides(mi: Any, material: Diffuse | Phong) -> None:
    exponent = material.exponent if isinstance(material, Phong) else 0.0
    wo, wi = directions(exponent)
    up = np.tile([0.0, 0.0, 1.0], (DIRECTIONS, 1))
    value, pdf = surface(material).eval_pdf(
        mi.BSDFContext(), interaction(mi, wo), mi.Vector3f(wi.T)
    )
    for actual, expected in (
        (np.array(value).T, oracle.evaluate(material, up, up, wo, wi)),
        (np.array(pdf), oracle.density(material, up, up, wo, wi)),
    ):
        np.testing.assert_allclose(actual, expected, 0, value_error(exponent) * expected.max())


@pytest.mark.parametrize("exponent", [*WIDE, *SHARP])
def test_weight_is_value_over_density(mi: Any, exponent: float) -> None:
    wo, _ = directions(exponent)
    si, context = interaction(mi, wo), mi.BSDFContext()
    bsdf = surface(Phong(COLOUR, exponent))
    u = mi.Point2f(np.random.default_rng(1).random((2, DIRECTIONS)))
    bs, weight = bsdf.sample(context, si, mi.Float(0), u)
    value, pdf = bsdf.eval_pdf(context, si, bs.wo)
    valid = np.array(bs.pdf) > 0
    assert not np.array(weight)[:, ~valid].any()
    np.testing.assert_array_equal(np.array(bs.pdf), np.array(pdf))
    np.testing.assert_allclose(
        np.array(weight * pdf)[:, valid], np.array(value)[:, valid], rtol=WEIGHT
    )


@pytest.mark.parametrize("u", [0.0, 1 - 2.0**-24])
@pytest.mark.parametrize("exponent", [0.0, 1e8])
def test_ends_of_the_unit_square(mi: Any, exponent: float, u: float) -> None:
    si = interaction(mi, np.array([tilted(40.0)]))
    sample = mi.Point2f(u, u)
    bs, weight = surface(Phong(COLOUR, exponent)).sample(mi.BSDFContext(), si, 0.0, sample)
    assert np.isfinite(np.array(weight)).all()
    assert np.linalg.norm(np.array(bs.wo)) == pytest.approx(1, abs=1e-6)


def test_parameters_can_be_traversed(mi: Any) -> None:
    parameters = mi.traverse(mi.load_dict(plugin(7.0)))
    assert set(parameters.keys()) == {"reflectance", "exponent"}
    assert "exponent=[7]" in str(mi.load_dict(plugin(7.0)))
