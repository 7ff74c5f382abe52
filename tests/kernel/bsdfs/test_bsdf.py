from collections.abc import Callable
from dataclasses import dataclass
from math import acos, cos, pi, radians, sin, sqrt, tan
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad

from drpt.kernel.bsdfs import LOBES, Bsdf, SurfacePoint
from drpt.kernel.device_scene import upload
from drpt.kernel.primitives import make_primitives
from drpt.kernel.sampler import SobolSampler
from drpt.scene import Camera, Diffuse, Material, Phong, Scene, Sphere
from tests.conftest import TYPES, to_device, to_host, unit_square
from tests.kernel import polar
from tests.oracle import brdf as oracle
from tests.oracle.arrays import Bools, Floats, basis, dot, normalize, sample_uniform_sphere
from tests.oracle.closed_forms import phong_directional_albedo

POINTS = 30_000
SAMPLES = 1_000_000
SOBOL_SAMPLES = 2**20
SIGNIFICANCE = 1e-4  # of each statistical gate; seeds are fixed, so it fails always or never
BIAS = 0.02  # of a lobe's width; the chi² test detects it, and 1 % of the density
WEIGHT = 5e-7  # relative, weight × pdf against eval: a few products
ALBEDO_ERROR = 5e-6  # of a mean weight over the Sobol' points; a larger bias fails
UNIT = 6e-7  # of a direction's length, after it is turned into a frame
HORIZON = 1e-6  # cosines closer to 0 than this have either sign

COLOUR = (0.2, 0.5, 1.0)
EXPONENTS = [0.0, 1.0, 2.0, 50.0, 1e3, 1e5, 1e6]
GLOSSY = [Phong(COLOUR, exponent) for exponent in EXPONENTS]
MATERIALS: list[Material] = [Diffuse(COLOUR), *GLOSSY]
TILTS = [0.0, 30.0, 70.0, 89.0, 89.99]


def value_error(material: Material) -> float:
    """Return the error of eval and pdf, relative to their maximum.

    Rounded directions, off by 6e-8, move the lobe's flank: its slope is √α / its height.
    """
    return 1e-6 + 1.5e-7 * sqrt(material.exponent if isinstance(material, Phong) else 0)


@dataclass
class Case:
    """Surface points (n, 3) that face their viewers; `given` is what the oracle asks for."""

    material: Material
    ng: Floats
    ns: Floats
    wo: Floats
    interpolated_normals: bool = False

    @property
    def given(self) -> tuple[Material, Floats, Floats, Floats]:
        return self.material, self.ng, self.ns, self.wo

    @property
    def device(self) -> Bsdf:
        return self.among(type(self.material))

    def among(self, *kinds: type[Material]) -> Bsdf:
        """Return the BSDF in a kernel that has some kinds of materials."""
        lobes = tuple(lobe for lobe in LOBES if lobe.material in kinds)
        albedo, code = to_device([self.material.albedo]), to_device([self.material.code])
        point = SurfacePoint(code, to_device(self.ns), to_device(self.wo))
        normal = to_device(self.ng) if self.interpolated_normals else None
        return Bsdf(lobes, albedo, code, point, normal)

    def candidates(self) -> Floats:
        """Return directions: half of them samples, the others all over the sphere."""
        count = len(self.wo)
        sampled = normalize(to_host(self.device.sample(unit_square(count))[0]))
        around = sample_uniform_sphere(np.random.default_rng(5), count)
        return np.where(np.arange(count)[:, None] % 2, sampled, around)

    def clear(self, wi: Floats) -> Bools:
        """Return (n,) whether no direction is so close to a horizon that rounding decides."""
        cosines = [dot(n, w) for n in (self.ng, self.ns) for w in (self.wo, wi)]
        return np.asarray(np.all(np.abs(cosines) > HORIZON, axis=0))


def anywhere(material: Material, count: int = POINTS) -> Case:
    """Return points with any normal, seen from anywhere."""
    rng = np.random.default_rng(4)
    normal, wo = sample_uniform_sphere(rng, count), sample_uniform_sphere(rng, count)
    normal, _ = oracle.turn_to_viewer(normal, normal, wo)
    return Case(material, normal, normal, wo)


def interpolated(material: Material, count: int = POINTS) -> Case:
    """Return points whose shading normal is anywhere above the geometric one's horizon."""
    rng = np.random.default_rng(6)
    ng, ns, wo = (sample_uniform_sphere(rng, count) for _ in range(3))
    ng, ns = oracle.turn_to_viewer(ng, ns, wo)
    return Case(material, ng, ns, wo, interpolated_normals=True)


def tilted(material: Material, degrees: float) -> Case:
    """Return one point with the normal +z, seen at a tilt."""
    theta, n = radians(degrees), np.array([[0.0, 0.0, 1.0]])
    return Case(material, n, n, np.array([[sin(theta), 0.0, cos(theta)]]))


def sobol(count: int) -> Any:
    index = TYPES.UInt32(np.arange(count, dtype=np.uint32))
    return SobolSampler(TYPES.UInt32([0]), index, TYPES.UInt32([0])).next_2d(0)


@pytest.mark.parametrize("material", MATERIALS)
@pytest.mark.parametrize("make_case", [anywhere, interpolated])
class TestValues:
    def test_eval_is_that_of_the_definition(
        self, make_case: Callable[[Material], Case], material: Material
    ) -> None:
        case = make_case(material)
        wi = case.candidates()
        value, expected = to_host(case.device.eval(to_device(wi))), oracle.evaluate(*case.given, wi)
        clear = case.clear(wi)
        error = value_error(material) * expected.max()
        np.testing.assert_allclose(value[clear], expected[clear], rtol=0, atol=error)
        np.testing.assert_array_equal(value[clear & (expected[:, 1] == 0)], 0)
        assert (expected[clear].max(axis=1) > 0).mean() > 0.1

    def test_pdf_is_that_of_the_definition(
        self, make_case: Callable[[Material], Case], material: Material
    ) -> None:
        case = make_case(material)
        wi = case.candidates()
        pdf, expected = to_host(case.device.pdf(to_device(wi))), oracle.density(*case.given, wi)
        counts = case.clear(wi) & (expected > 0)
        error = value_error(material) * expected.max()
        np.testing.assert_allclose(pdf[counts], expected[counts], rtol=0, atol=error)
        assert (pdf >= 0).all()

    def test_weight_is_eval_over_pdf(
        self, make_case: Callable[[Material], Case], material: Material
    ) -> None:
        case = make_case(material)
        wi, weight, _ = case.device.sample(unit_square(len(case.wo)))
        product = to_host(weight) * to_host(case.device.pdf(wi))[:, None]
        value = to_host(case.device.eval(wi))
        np.testing.assert_allclose(product, value, rtol=WEIGHT, atol=1e-30)

    def test_density_of_a_sample_is_that_of_its_direction(
        self, make_case: Callable[[Material], Case], material: Material
    ) -> None:
        case = make_case(material)
        wi, _, pdf = case.device.sample(unit_square(len(case.wo)))
        expected = to_host(case.device.pdf(wi))
        error = value_error(material) * expected.max()
        np.testing.assert_allclose(to_host(pdf), expected, rtol=0, atol=error)

    def test_weight_is_zero_where_a_direction_does_not_count(
        self, make_case: Callable[[Material], Case], material: Material
    ) -> None:
        case = make_case(material)
        wi, weight, _ = (to_host(v) for v in case.device.sample(unit_square(len(case.wo))))
        wi = normalize(wi)
        sides = [dot(n, w) > 0 for n in (case.ng, case.ns) for w in (case.wo, wi)]
        clear = case.clear(wi)
        np.testing.assert_array_equal((weight > 0)[clear, 0], np.all(sides, axis=0)[clear])

    def test_mixed_kinds_give_the_same_as_each_alone(
        self, make_case: Callable[[Material], Case], material: Material
    ) -> None:
        case = make_case(material)
        mixed, alone = case.among(Diffuse, Phong), case.device
        u, wi = unit_square(len(case.wo)), to_device(case.candidates())
        for a, b in (
            *zip(mixed.sample(u), alone.sample(u), strict=True),
            (mixed.eval(wi), alone.eval(wi)),
            (mixed.pdf(wi), alone.pdf(wi)),
        ):
            np.testing.assert_allclose(to_host(a), to_host(b), rtol=WEIGHT, atol=WEIGHT)


@pytest.mark.parametrize("material", MATERIALS)
def test_reciprocity(material: Material) -> None:
    case = anywhere(material)
    wi = case.candidates()
    above = (dot(case.ng, wi) > HORIZON) & (dot(case.ng, case.wo) > HORIZON)
    n, wo, wi = case.ng[above], case.wo[above], wi[above]
    forth, back = Case(material, n, n, wo).device, Case(material, n, n, wi).device
    there = to_host(forth.eval(to_device(wi))) * dot(n, wo)[:, None]
    again = to_host(back.eval(to_device(wo))) * dot(n, wi)[:, None]
    np.testing.assert_allclose(there, again, rtol=0, atol=value_error(material) * there.max())


@pytest.mark.parametrize("degrees", TILTS)
@pytest.mark.parametrize("material", MATERIALS)
def test_directional_albedo(material: Material, degrees: float) -> None:
    _, weight, _ = tilted(material, degrees).device.sample(sobol(SOBOL_SAMPLES))
    share = 1.0
    if isinstance(material, Phong):
        share = phong_directional_albedo(1, material.exponent, radians(degrees))
    assert to_host(weight.z).mean() == pytest.approx(share * COLOUR[2], abs=ALBEDO_ERROR)


def lost_share(exponent: float, theta: float) -> float:
    """Return the share of a Phong lobe below the horizon, its axis tilted by θ.

    At the angle γ from the axis, directions with |φ| < t0, cos t0 = -cot γ cot θ, are above it;
    u = cos^{α+1} γ is uniform in the lobe, and all above where γ < 90° - θ.
    """

    def below(u: float) -> float:
        gamma = acos(u ** (1 / (exponent + 1)))
        return 1 - acos(max(-1.0, -1 / (tan(gamma) * tan(theta)))) / pi

    return float(quad(below, 0, sin(theta) ** (exponent + 1), epsabs=1e-9, limit=200)[0])


@pytest.mark.parametrize("degrees", [30.0, 70.0, 89.0])
@pytest.mark.parametrize("exponent", EXPONENTS)
def test_share_lost_below_the_horizon(exponent: float, degrees: float) -> None:
    _, weight, _ = tilted(Phong(COLOUR, exponent), degrees).device.sample(sobol(SOBOL_SAMPLES))
    lost = (to_host(weight.x) == 0).mean()
    assert lost == pytest.approx(lost_share(exponent, radians(degrees)), abs=1e-4)


def p_value(material: Material, degrees: float, drawn: Material) -> float:
    """Return the least p-value of directions drawn from one material, against another's pdf."""
    case = tilted(material, degrees)
    axis = case.wo * [[-1, -1, 1]] if isinstance(material, Phong) else case.ns
    turned = basis(axis)[0]
    wi = to_host(tilted(drawn, degrees).device.sample(unit_square(SAMPLES))[0])

    def pdf(below: Floats, phi: Floats) -> Floats:
        world = np.einsum("nk,kc->nc", polar.directions(below, phi), turned)
        return to_host(case.device.pdf(to_device(world)))

    exponent = material.exponent if isinstance(material, Phong) else 1
    return polar.p_value(np.einsum("nc,kc->nk", wi, turned), pdf, polar.lobe_edges(exponent))


@pytest.mark.parametrize("degrees", [0.0, 70.0])
@pytest.mark.parametrize("material", MATERIALS)
def test_samples_follow_the_pdf(material: Material, degrees: float) -> None:
    assert p_value(material, degrees, material) > SIGNIFICANCE


@pytest.mark.parametrize("material", GLOSSY)
def test_chi2_detects_a_biased_width(material: Phong) -> None:
    biased = Phong(COLOUR, (material.exponent + 1) * (1 + BIAS) - 1)
    assert p_value(material, 70, biased) < SIGNIFICANCE


@pytest.mark.parametrize("degrees", TILTS)
@pytest.mark.parametrize("material", MATERIALS)
def test_ends_of_the_unit_interval(material: Material, degrees: float) -> None:
    ends = 0, 2.0**-24, 0.5, 1 - 2.0**-24
    u = to_device([(x, y) for x in ends for y in ends])
    wi, weight, _ = (to_host(v) for v in tilted(material, degrees).device.sample(u))
    np.testing.assert_allclose(np.linalg.norm(wi, axis=1), 1, rtol=0, atol=UNIT)
    assert ((weight >= 0) & (weight <= np.array(COLOUR) * (1 + UNIT))).all()
    assert (weight[wi[:, 2] < 0] == 0).all()


@pytest.mark.parametrize("material", [Diffuse(0), Phong(0, 10)])
def test_black_reflects_nothing(material: Material) -> None:
    case = tilted(material, 30)
    wi, weight, _ = case.device.sample(unit_square(100))
    assert (to_host(weight) == 0).all()
    assert (to_host(case.device.eval(wi)) == 0).all()


def test_a_row_has_the_material_of_its_primitive() -> None:
    camera = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), fov=40, width=4, height=4)
    materials: list[Material] = [Diffuse((0.1, 0.2, 0.3)), Phong((0.4, 0.5, 0.6), 7)]
    shapes = [Sphere((x, 0, 0), 0.4, material=m) for x, m in enumerate(materials)]
    lamp = Sphere((0, 9, 0), 1, radiance=1)
    scene = upload(make_primitives(Scene(camera, [*shapes, lamp]).shapes), TYPES)
    active = TYPES.Bool([True, True, True, False])
    row = scene.geometry.row(TYPES.UInt32([0, 1, 2, 0]), active)
    albedo = np.array([materials[0].albedo, materials[1].albedo, (0, 0, 0), (0, 0, 0)])
    np.testing.assert_allclose(to_host(row.material.xyz), albedo, rtol=1e-7)
    np.testing.assert_array_equal(to_host(row.material.w)[:2], [m.code for m in materials])
    np.testing.assert_array_equal(np.array(row.shape).T[2:], [(0, 9, 0, 1), (0, 0, 0, 0)])
