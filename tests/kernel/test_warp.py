from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from drpt.kernel import warp
from drpt.kernel.vec import sincos_2pi
from tests.conftest import to_device, to_host, unit_square
from tests.kernel import polar
from tests.oracle.arrays import Floats
from tests.oracle.statistics import chi2_of_counts

SAMPLES = 1_000_000
SIGNIFICANCE = 1e-4  # of each statistical gate; seeds are fixed, so it fails always or never
BIAS = 0.02  # of a lobe's width; the gates detect it, and 1 % of the density
QUADRATURE = 1e-6  # relative error of float32 densities summed in float64
UNIT = 2.5e-7  # of a direction's length
CONE = 2e-7  # relative, sin θ; three to four roundings of 6e-8
LOBE = 7e-7  # relative, 1 - cos θ, taken from x² + y² with rounded x and y
LIFTED = 6e-7  # of a direction in a projected cap and of its cosine, relative to sin σ
POWER = 1e-6  # relative, cos^α θ down to e^-5: the exponent's rounding counts five times
LOG = 2.5e-7  # relative, log1p and expm1

HEIGHTS = [2, 1, 0.1, 1e-3, 1e-6, 1e-9, 1e-12]
SINES = [0.98, 0.5, 0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6]
GRAZING = [0, 0.5, 0.9, 0.999]  # a in cos ω = sin^a σ: 0 overhead, at 1 the cap touches the horizon
EXPONENTS = [0, 1, 2, 50, 1e3, 1e5, 1e6]
ENDS = [0, 2.0**-24, 0.5, 1 - 2.0**-24]


@dataclass
class Warp:
    """A warp to directions, its density over (1 - cos θ, φ), and edges of cells that resolve it."""

    sample: Callable[[Any], Any]
    pdf: Callable[[Any], Any]
    edges: Floats

    def density(self, below: Floats, _: Floats) -> Floats:
        return np.broadcast_to(to_host(self.pdf(to_device(below))), below.shape)


def sphere() -> Warp:
    pdf = lambda below: warp.sphere_pdf() + 0 * below  # noqa: E731
    return Warp(warp.square_to_sphere, pdf, np.linspace(0, 2, polar.CELLS + 1))


def hemisphere() -> Warp:
    pdf = lambda below: warp.cosine_hemisphere_pdf(1 - below)  # noqa: E731
    return Warp(warp.square_to_cosine_hemisphere, pdf, np.linspace(0, 1, polar.CELLS + 1))


def cone(height: float, bias: float = 0.0) -> Warp:
    h = to_device([height])
    return Warp(
        lambda u: warp.square_to_cone(u, h * (1 + bias)),
        lambda below: warp.cone_pdf(h) + 0 * below,
        to_host(h) * np.linspace(0, 1, polar.CELLS + 1),
    )


def projected(sine: float, bias: float = 0.0) -> Warp:
    s = to_device([sine])
    h = to_device([sine**2 / (1 + np.sqrt(1 - sine**2))])
    normal = to_device([(0, 0, 1)])
    return Warp(
        lambda u: warp.square_to_projected_cap(u, s * (1 + bias), h, normal)[0],
        lambda below: (1 - below) * warp.INV_PI / (s * s),
        to_host(h) * np.linspace(0, 1, polar.CELLS + 1),
    )


def lobe(exponent: float, bias: float = 0.0) -> Warp:
    a = to_device([exponent])
    return Warp(
        lambda u: warp.square_to_phong_lobe(u, (a + 1) * (1 + bias) - 1),
        lambda below: warp.phong_lobe_pdf(below, a),
        polar.lobe_edges(exponent),
    )


WARPS = {
    "sphere": sphere(),
    "hemisphere": hemisphere(),
    **{f"cone {height:g}": cone(height) for height in HEIGHTS},
    **{f"projected cap {sine:g}": projected(sine) for sine in SINES},
    **{f"lobe {exponent:g}": lobe(exponent) for exponent in EXPONENTS},
}
BIASED = {
    **{f"cone {height:g}": cone(height, BIAS) for height in HEIGHTS[1:]},
    **{f"projected cap {sine:g}": projected(sine, BIAS) for sine in SINES},
    **{f"lobe {exponent:g}": lobe(exponent, BIAS) for exponent in EXPONENTS},
}


@pytest.mark.parametrize("name", WARPS)
def test_density_integrates_to_one(name: str) -> None:
    tested = WARPS[name]
    assert polar.integral(tested.density, tested.edges) == pytest.approx(1, rel=QUADRATURE)


@pytest.mark.parametrize("name", WARPS)
def test_samples_follow_the_density(name: str) -> None:
    tested = WARPS[name]
    w = to_host(tested.sample(unit_square(SAMPLES)))
    assert polar.p_value(w, tested.density, tested.edges) > SIGNIFICANCE


@pytest.mark.slow
@pytest.mark.parametrize("name", BIASED)
def test_chi2_detects_a_biased_width(name: str) -> None:
    tested = BIASED[name]
    w = to_host(tested.sample(unit_square(SAMPLES)))
    assert polar.p_value(w, tested.density, tested.edges) < SIGNIFICANCE


@pytest.mark.slow
@pytest.mark.parametrize("name", WARPS)
def test_chi2_detects_samples_that_prefer_one_side(name: str) -> None:
    tested = WARPS[name]
    u = unit_square(SAMPLES)
    u.y = u.y + BIAS / 8 * sincos_2pi(u.y)[0]  # density of φ: a ripple of π/4 BIAS
    w = to_host(tested.sample(u))
    assert polar.p_value(w, tested.density, tested.edges) < SIGNIFICANCE


@pytest.mark.parametrize("name", WARPS)
def test_ends_of_the_unit_interval_give_unit_directions(name: str) -> None:
    u = np.array([(x, y) for x in ENDS for y in ENDS])
    w = to_host(WARPS[name].sample(to_device(u)))
    np.testing.assert_allclose(np.linalg.norm(w, axis=1), 1, rtol=0, atol=UNIT)
    if name not in ("sphere", "cone 2"):
        assert (w[:, 2] >= 0).all()
    np.testing.assert_array_equal(w[u[:, 0] == 0], np.tile([0.0, 0.0, 1.0], (len(ENDS), 1)))


@pytest.mark.parametrize("height", HEIGHTS)
def test_cone_is_as_wide_as_in_float64(height: float) -> None:
    u = unit_square(100_000)
    w = to_host(warp.square_to_cone(u, to_device([height])))
    below = float(np.float32(height)) * to_host(u)[:, 0]
    sin_theta = np.hypot(w[:, 0], w[:, 1])
    np.testing.assert_allclose(sin_theta, np.sqrt(below * (2 - below)), rtol=CONE, atol=0)
    np.testing.assert_allclose(w[:, 2], 1 - below, rtol=0, atol=UNIT)


def projected_cap(u: Any, sine: float, normal: Floats) -> tuple[Floats, Floats]:
    """Sample a cap by the warp: directions (n, 3) and their cosines (n,) at the normal."""
    height = sine**2 / (1 + np.sqrt(1 - sine**2))
    cap = to_device([sine]), to_device([height]), to_device([normal])
    w, cosine = warp.square_to_projected_cap(u, *cap)
    return to_host(w), to_host(cosine)


def lifted_ellipse(u: Floats, sine: float, normal: Floats) -> tuple[Floats, Floats]:
    """Return directions (n, 3) of a cap around z, and their cosines (n,) at the normal.

    In the receiver's plane let ``back`` point away from the cap's centre, ``across`` be at right
    angles to it. The cap's rim projects to an ellipse with its centre at -cos σ sin ω along
    ``back`` and the semi-axes sin σ cos ω along it, sin σ across. A point -x back + y across of
    the ellipse is lifted to the sphere by √((1 - x)(1 + x) - y²). With the elevation κ = π/2 - ω,
    1 - cos σ sin ω = sin²((κ - σ)/2) + sin²((κ + σ)/2): nothing cancels at the horizon.
    """
    sigma, elevation = np.arcsin(sine), np.arcsin(normal[2])
    azimuth = np.arctan2(normal[1], normal[0])
    across = np.array([-np.sin(azimuth), np.cos(azimuth), 0])
    back = np.cross(across, normal)
    turn = 2 * np.pi * u[:, 1] - azimuth
    toward = sine * np.sqrt(u[:, 0]) * np.sin(elevation) * np.cos(turn)
    y = sine * np.sqrt(u[:, 0]) * np.sin(turn)
    x = np.cos(sigma) * np.cos(elevation) - toward
    rim = np.sin((elevation - sigma) / 2) ** 2 + np.sin((elevation + sigma) / 2) ** 2
    cosine = np.sqrt((rim + toward) * (1 + x) - y**2)
    return np.outer(-x, back) + np.outer(y, across) + np.outer(cosine, normal), cosine


@pytest.mark.parametrize("sine", SINES)
@pytest.mark.parametrize("grazing", GRAZING)
@pytest.mark.parametrize("azimuth", [0.0, 2.5])
def test_projected_cap_is_a_lifted_ellipse(sine: float, grazing: float, azimuth: float) -> None:
    sine, cosine = (float(np.float32(value)) for value in (sine, sine**grazing))
    tilt = np.sqrt(1 - cosine**2)
    normal = np.array([tilt * np.cos(azimuth), tilt * np.sin(azimuth), cosine])
    u = np.concatenate([to_host(unit_square(100_000)), [(x, y) for x in ENDS for y in ENDS]])
    w, cosines = projected_cap(to_device(u), sine, normal)
    expected, expected_cosines = lifted_ellipse(u, sine, normal)
    np.testing.assert_allclose(w[:, :2], expected[:, :2], rtol=0, atol=LIFTED * sine)
    np.testing.assert_allclose(np.linalg.norm(w, axis=1), 1, rtol=0, atol=2 * UNIT)
    np.testing.assert_allclose(cosines, expected_cosines, rtol=LIFTED, atol=LIFTED * sine)
    assert (cosines > 0).all()


@pytest.mark.parametrize("sine", SINES)
def test_the_oracle_of_a_projected_cap_keeps_to_the_cap(sine: float) -> None:
    normal = np.array([np.sqrt(1 - sine), 0, np.sqrt(sine)])
    w, cosine = lifted_ellipse(to_host(unit_square(10_000)), sine, normal)
    np.testing.assert_allclose(np.linalg.norm(w, axis=1), 1, rtol=1e-12)
    np.testing.assert_allclose(w @ normal, cosine, rtol=1e-12)
    away = np.hypot(w[:, 0], w[:, 1])
    assert 0.98 * sine < away.max() < sine


@pytest.mark.parametrize("exponent", [*EXPONENTS, 1e8])
def test_phong_lobe_is_as_wide_as_in_float64(exponent: float) -> None:
    u = unit_square(100_000)
    below = polar.below_pole(to_host(warp.square_to_phong_lobe(u, to_device([exponent]))))
    expected = -np.expm1(np.log1p(-to_host(u)[:, 0]) / (exponent + 1))
    np.testing.assert_allclose(below, expected, rtol=LOBE, atol=0)


@pytest.mark.parametrize("exponent", [*EXPONENTS, 1e8])
def test_power_near_the_pole(exponent: float) -> None:
    below = np.geomspace(1e-4, 5, 10_000) / (exponent + 1)
    below = below[below < 1].astype(np.float32).astype(np.float64)
    power = to_host(warp.power_near_pole(to_device(below), to_device([exponent])))
    np.testing.assert_allclose(power, np.exp(exponent * np.log1p(-below)), rtol=POWER)


@pytest.mark.parametrize("exponent", EXPONENTS)
def test_power_at_the_pole_and_from_the_plane_on(exponent: float) -> None:
    power = to_host(warp.power_near_pole(to_device([0, 1, 1.5, 2]), to_device([exponent])))
    np.testing.assert_array_equal(power, [1, 0, 0, 0])


def test_cosine_hemisphere_pdf_is_zero_below_the_horizon() -> None:
    pdf = to_host(warp.cosine_hemisphere_pdf(to_device([-1, -1e-7, 0, 1])))
    np.testing.assert_allclose(pdf, [0, 0, 0, 1 / np.pi], rtol=1e-7)


def test_expm1() -> None:
    x = -np.geomspace(1e-30, 100, 100_000, dtype=np.float32).astype(np.float64)
    np.testing.assert_allclose(to_host(warp.expm1(to_device(x))), np.expm1(x), rtol=LOG)
    assert to_host(warp.expm1(to_device([0])))[0] == 0


def test_log1p() -> None:
    x = -np.geomspace(1e-30, 1 - 2.0**-24, 100_000).astype(np.float32).astype(np.float64)
    np.testing.assert_allclose(to_host(warp.log1p(to_device(x))), np.log1p(x), rtol=LOG)
    assert to_host(warp.log1p(to_device([0])))[0] == 0


def triangle_p_value(weights: Floats, cells: int = 64) -> float:
    """Return the p-value of a chi² test of barycentric coordinates (n, 2) on a square grid."""
    edges = np.linspace(0, 1, cells + 1)
    counts = np.histogram2d(weights[:, 0], weights[:, 1], (edges, edges))[0]
    row, column = np.indices(counts.shape)
    share = np.select([row + column < cells - 1, row + column == cells - 1], [1, 0.5], 0)
    inside = share > 0
    assert counts[inside].sum() == len(weights)
    return chi2_of_counts(counts[inside], len(weights) * 2 * share[inside] / cells**2).p_value


def test_triangle_is_uniform() -> None:
    weights = to_host(warp.square_to_triangle(unit_square(SAMPLES)))
    assert (weights >= 0).all()
    assert (weights.sum(axis=1) <= 1).all()
    assert triangle_p_value(weights) > SIGNIFICANCE


def test_chi2_detects_a_triangle_that_is_not_uniform() -> None:
    u = to_host(unit_square(SAMPLES))
    first = 1 - np.sqrt(1 - u[:, 0] ** (1 + BIAS))
    assert triangle_p_value(np.stack([first, u[:, 1] * (1 - first)], axis=1)) < SIGNIFICANCE


def test_triangle_at_the_ends_of_the_unit_interval() -> None:
    u = to_device([(x, y) for x in ENDS for y in ENDS])
    weights = to_host(warp.square_to_triangle(u))
    assert (weights >= 0).all()
    assert (weights.sum(axis=1) <= 1).all()
