from collections.abc import Callable
from dataclasses import dataclass
from math import acos, asin, atan2, cos, hypot, pi, sin, sqrt
from typing import Any

import numpy as np
import pytest

from drpt.kernel.camera import Ray
from drpt.kernel.device_scene import DeviceScene, upload
from drpt.kernel.emitters import Choice, LightSample, Receiver, power_heuristic
from drpt.kernel.estimator import Features, Mode
from drpt.kernel.intersect import closest_hit
from drpt.kernel.primitives import make_primitives
from drpt.kernel.sampler import SobolSampler
from drpt.kernel.warp import square_to_sphere
from drpt.scene import Camera, Diffuse, Mesh, Scene, Shape, Sphere
from tests.conftest import TYPES, to_device, to_host, unit_square
from tests.kernel import polar
from tests.oracle.arrays import Floats, basis, normalize
from tests.oracle.closed_forms import sphere_light_irradiance

SAMPLES = 1_000_000
SOBOL_SAMPLES = 2**20
SIGNIFICANCE = 1e-4  # of each statistical gate; seeds are fixed, so it fails always or never
BIAS = 0.005  # what the means must detect; and a light's probability, where it is large
IRRADIANCE = 1e-6  # relative, of a mean over the Sobol' points
ROUNDED = 6e-8  # of a direction in float32, which a tilted horizon passes or not; relative to 1
SOLID_ANGLE = 3e-7  # relative, of a cone; a few roundings of 6e-8
MEAN_SOLID_ANGLE = 5e-6  # relative, of a mean over points that are uniform on a light
AGREE = 2e-6  # relative, of the density of a sample and that of the hit it leads to
CONSTANT = 1e-6  # relative, of π sin²σ cos ω: three times the error of 1 / d, some roundings
COSINE = 2.5e-7  # of the cosine at a tilted normal, whose terms cancel; relative to 1
PLACE = 4e-7  # of a point on a light, relative to its distance
UNIT = 4e-7  # of a direction's length

RATIOS = [0.98, 0.5, 0.1, 1e-2, 1e-3, 1e-4, 1e-6]  # radius by distance
WIDE = RATIOS[:-2]  # of the other cones, rounded directions show the lattice that they are on
GAPS = [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7]  # distance / radius - 1
GRAZING = [0.0, 0.5, 0.9, 0.99]  # a in cos ω = sin^a σ: 0 overhead, from 1 on part is below
ENDS = [0, 2.0**-24, 0.5, 1 - 2.0**-24]

CAMERA = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), fov=40, width=4, height=4)
FLOOR = Mesh([(-9, -9, -9), (9, -9, -9), (0, 9, -9)], [(0, 1, 2)], material=Diffuse(0.5))
TRIANGLE = Mesh([(-1, -0.5, 2), (0.2, 1.5, 3), (1, -1, 2.5)], [(0, 1, 2)], radiance=(2, 1, 0.5))
SPHERE = Sphere((0.5, -0.3, 2), 0.7, radiance=(4, 6, 8))
ORIGIN = (0.0, 0.0, 0.0)
UP = np.array([0.0, 0.0, 1.0])
AWAY = -UP  # of the lights above the origin: no cap is above its horizon
TILTED = np.array([0.36, 0.48, 0.8], np.float32).astype(np.float64)
NORMALS = {"up": UP, "tilted": TILTED}


@dataclass
class Lights:
    """Lights on the device; spheres come first, as the kernel numbers them."""

    scene: DeviceScene
    features: Features
    mode: Mode

    @classmethod
    def of(cls, *lights: Shape, mode: Mode = Mode.MIS) -> "Lights":
        primitives = make_primitives(Scene(CAMERA, [FLOOR, *lights]).shapes)
        return cls(upload(primitives, TYPES), Features.of(primitives, 1, mode), mode)

    def sample(
        self, u: Any, *, light: int = 0, point: Any = ORIGIN, normal: Any = UP
    ) -> LightSample:
        """Sample a light from a point of a surface."""
        at, number = Receiver(to_device([point]), to_device([normal])), TYPES.UInt32([light])
        choice = Choice(number, self.pmf(at, number))
        return self.scene.emitters.sample(at, choice, u, visible=self.mode.samples_cones)

    def pmf(self, at: Receiver, light: Any) -> Any:
        """Return the probability of a light."""
        if self.scene.emitters.tree is None:
            return TYPES.Float32(1)
        return self.scene.emitters.tree.pmf(at, TYPES.Bool(True), light)

    def inverse_pdf_of_hits(
        self, direction: Any, light: int = 0, normal: Any = UP
    ) -> tuple[Floats, Any]:
        """Return 1 / density of rays from a surface at the origin, and where they hit a light."""
        at = Receiver(to_device([ORIGIN]), to_device([normal]))
        ray = Ray(at.point, direction)
        hit = closest_hit(self.scene.geometry, self.features, ray, TYPES.Bool([True]))
        number = TYPES.UInt32([light])
        found = np.array(hit.valid & (hit.primitive == self.scene.geometry.first_light + number))
        return to_host(self.scene.emitters.inverse_pdf(at, number, ray, hit)), found


def sobol() -> Any:
    index = TYPES.UInt32(np.arange(SOBOL_SAMPLES, dtype=np.uint32))
    return SobolSampler(TYPES.UInt32([0]), index, TYPES.UInt32([0])).next_2d(0)


def rounded(values: Any) -> Any:
    """Return values as float32 has them."""
    return np.asarray(values, np.float32).astype(np.float64)


def sphere_at(omega: float, ratio: float) -> tuple[Sphere, float]:
    """Return a sphere light with its centre at the angle ω from +z, and its half-angle σ."""
    center = rounded([2 * sin(omega), 0, 2 * cos(omega)])
    radius = float(rounded(2 * ratio))
    return Sphere(center, radius, radiance=1), asin(radius / hypot(*center))


def cone_solid_angle(sigma: float) -> float:
    return 4 * pi * sin(sigma / 2) ** 2


def triangle_solid_angle(corners: Floats) -> float:
    """Return the solid angle of a triangle (3, 3) from 0 (Van Oosterom & Strackee 1983)."""
    a, b, c = corners
    la, lb, lc = np.linalg.norm(corners, axis=1)
    determinant = abs(float(a @ np.cross(b, c)))
    return 2 * atan2(determinant, la * lb * lc + a @ b * lc + a @ c * lb + b @ c * la)


class TestCone:
    """A receiver that does not see the whole cap above its horizon."""

    @pytest.mark.parametrize("ratio", RATIOS)
    def test_directions_end_on_the_light(self, ratio: float) -> None:
        light, sigma = sphere_at(0.3, ratio)
        sample = Lights.of(light).sample(unit_square(100_000), normal=AWAY)
        direction, distance = to_host(sample.direction), to_host(sample.distance)
        np.testing.assert_allclose(np.linalg.norm(direction, axis=1), 1, rtol=0, atol=UNIT)
        to_center = direction * distance[:, None] - light.center
        off = np.linalg.norm(to_center, axis=1) - light.radius
        np.testing.assert_allclose(off, 0, rtol=0, atol=2 * PLACE)
        away = np.linalg.norm(np.cross(direction, normalize(np.array([light.center]))), axis=1)
        assert away.max() < sin(sigma) + UNIT
        assert (distance <= sqrt(4 - light.radius**2) * (1 + PLACE)).all()

    @pytest.mark.parametrize("ratio", RATIOS)
    def test_inverse_pdf_is_the_solid_angle(self, ratio: float) -> None:
        light, sigma = sphere_at(0.3, ratio)
        sample = Lights.of(light).sample(unit_square(1000), normal=AWAY)
        solid_angle = to_host(sample.inverse_pdf)
        np.testing.assert_allclose(solid_angle, cone_solid_angle(sigma), rtol=SOLID_ANGLE)

    @pytest.mark.parametrize("gap", GAPS)
    def test_receiver_close_to_the_light(self, gap: float) -> None:
        distance = float(rounded(1 + gap))
        lights = Lights.of(Sphere((0, 0, distance), 1, radiance=1))
        sample = lights.sample(unit_square(1000), normal=AWAY)
        cosine = sqrt((distance - 1) * (distance + 1)) / distance
        solid_angle = 2 * pi * (1 - cosine)
        np.testing.assert_allclose(to_host(sample.inverse_pdf), solid_angle, rtol=SOLID_ANGLE)
        end = to_host(sample.direction) * to_host(sample.distance)[:, None] - (0, 0, distance)
        np.testing.assert_allclose(np.linalg.norm(end, axis=1), 1, rtol=0, atol=PLACE)

    @pytest.mark.parametrize("ratio", RATIOS)
    @pytest.mark.parametrize("omega", [0.0, 0.3, pi / 2])
    def test_irradiance(self, ratio: float, omega: float) -> None:
        """At ω = 90° a light is half below the horizon; at 0.3 the widest one is, in part."""
        light, sigma = sphere_at(omega, ratio)
        x, _, z = light.center
        expected = sphere_light_irradiance(1, sigma, atan2(x, z))
        sample = Lights.of(light).sample(sobol(), normal=AWAY)
        cosine = np.maximum(to_host(sample.direction)[:, 2], 0)
        irradiance = (to_host(sample.inverse_pdf) * cosine).mean()
        assert irradiance == pytest.approx(expected, rel=IRRADIANCE, abs=0)

    def test_irradiance_detects_a_bias(self) -> None:
        light, sigma = sphere_at(0.3, 0.1)
        sample = Lights.of(light).sample(sobol(), normal=AWAY)
        cosine = to_host(sample.direction)[:, 2]
        irradiance = (to_host(sample.inverse_pdf) * cosine).mean()
        biased = (1 + BIAS) * sphere_light_irradiance(1, sigma, 0.3)
        assert irradiance != pytest.approx(biased, rel=IRRADIANCE)

    @pytest.mark.parametrize("ratio", WIDE)
    def test_directions_are_uniform_in_the_cone(self, ratio: float) -> None:
        assert self._p_value(ratio, ratio) > SIGNIFICANCE

    @pytest.mark.slow
    @pytest.mark.parametrize("ratio", WIDE)
    def test_chi2_detects_a_cone_that_is_too_wide(self, ratio: float) -> None:
        assert self._p_value(ratio, ratio * (1 + BIAS)) < SIGNIFICANCE

    @staticmethod
    def _p_value(ratio: float, drawn: float) -> float:
        light, sigma = sphere_at(0.3, ratio)
        turned = basis(normalize(np.array([light.center])))[0]
        sample = Lights.of(sphere_at(0.3, drawn)[0]).sample(unit_square(SAMPLES), normal=AWAY)
        inverse = to_host(Lights.of(light).sample(unit_square(1), normal=AWAY).inverse_pdf)
        edges = 2 * sin(sigma / 2) ** 2 * np.linspace(0, 1, polar.CELLS + 1)
        uniform = lambda below, _: np.broadcast_to(1 / inverse, below.shape)  # noqa: E731
        local = np.einsum("nc,kc->nk", to_host(sample.direction), turned)
        return polar.p_value(local, uniform, edges)

    @pytest.mark.parametrize("ratio", RATIOS)
    @pytest.mark.parametrize("axis", [(0, 0, 1), (0, 0, -1), (0, 1, 0)])
    def test_ends_of_the_unit_interval(self, ratio: float, axis: tuple[int, int, int]) -> None:
        light = Sphere(2 * np.array(axis), 2 * ratio, radiance=1)
        u = to_device([(x, y) for x in ENDS for y in ENDS])
        sample = Lights.of(light).sample(u, normal=-np.array(axis))
        direction, distance = to_host(sample.direction), to_host(sample.distance)
        np.testing.assert_allclose(np.linalg.norm(direction, axis=1), 1, rtol=0, atol=UNIT)
        assert (direction @ axis > 0).all()
        assert ((distance > 0) & (distance <= 2)).all()


@dataclass
class Lit:
    """A sphere light, rounded to float32, and the normal of a receiver at the origin."""

    light: Sphere
    normal: Floats

    @classmethod
    def at(cls, ratio: float, cosine: float, normal: Floats = UP) -> "Lit":
        """Place a light of that radius by distance, its centre at that cosine to the normal."""
        aside = normalize(np.cross(normal, (0.6, 0.8, 0)))
        center = rounded(2 * (cosine * normal + sqrt(1 - cosine**2) * aside))
        return cls(Sphere(center, float(rounded(2 * ratio)), radiance=1), normal)

    @property
    def axis(self) -> Floats:
        return normalize(np.array(self.light.center))

    @property
    def sine(self) -> float:
        """Return sin σ = r / d."""
        return self.light.radius / hypot(*self.light.center)

    @property
    def cosine(self) -> float:
        """Return cos ω."""
        return min(float(self.axis @ normalize(self.normal)), 1)

    @property
    def irradiance(self) -> float:
        return sphere_light_irradiance(1, asin(self.sine), acos(self.cosine))

    @property
    def projected(self) -> float:
        """Return the projected solid angle of a whole cap, an ellipse: π sin²σ cos ω."""
        return pi * self.sine**2 * self.cosine

    def sample(self, u: Any) -> LightSample:
        return Lights.of(self.light).sample(u, normal=self.normal)


def with_ends(count: int) -> Any:
    """Return points of the unit square at random, and those at the ends of the unit interval."""
    ends = [(x, y) for x in ENDS for y in ENDS]
    return to_device(np.concatenate([to_host(unit_square(count)), ends]))


def above(ratios: list[float], normals: dict[str, Floats]) -> pytest.MarkDecorator:
    """Parametrize with caps from overhead to those that almost touch the horizon."""
    return pytest.mark.parametrize(
        "lit",
        [
            pytest.param(Lit.at(ratio, ratio**grazing, normal), id=f"{name}-{ratio:g}-{grazing:g}")
            for name, normal in normals.items()
            for ratio in ratios
            for grazing in GRAZING
        ],
    )


class TestProjectedCap:
    """A receiver that sees the whole cap above its horizon."""

    @above(RATIOS, NORMALS)
    def test_directions_end_on_the_light(self, lit: Lit) -> None:
        sample = lit.sample(with_ends(100_000))
        direction, distance = to_host(sample.direction), to_host(sample.distance)
        np.testing.assert_allclose(np.linalg.norm(direction, axis=1), 1, rtol=0, atol=UNIT)
        off = np.linalg.norm(direction * distance[:, None] - lit.light.center, axis=1)
        np.testing.assert_allclose(off, lit.light.radius, rtol=0, atol=2 * PLACE)
        assert np.linalg.norm(np.cross(direction, lit.axis), axis=1).max() < lit.sine + UNIT
        assert (direction @ lit.axis > 0).all()
        assert (distance > 0).all()

    @above(RATIOS, {"up": UP})
    def test_every_direction_gives_the_same_light(self, lit: Lit) -> None:
        """The cosine's rounding is relative to sin σ: it is a sum of terms of that size."""
        sample = lit.sample(with_ends(100_000))
        inverse, cosine = to_host(sample.inverse_pdf), to_host(sample.direction) @ lit.normal
        error = np.abs(inverse * cosine / lit.projected - 1)
        assert (error < CONSTANT + COSINE * lit.sine / cosine).all()

    @above(RATIOS, {"tilted": TILTED})
    def test_every_direction_gives_a_tilted_receiver_the_same_light(self, lit: Lit) -> None:
        """The cosine's rounding is relative to 1, of directions and of the light's centre."""
        sample = lit.sample(with_ends(100_000))
        inverse, cosine = to_host(sample.inverse_pdf), to_host(sample.direction) @ lit.normal
        error = np.abs(inverse * cosine / lit.projected - 1)
        sampled = lit.projected / inverse  # the cosine that the sample was made with
        assert (error < CONSTANT + COSINE / sampled + COSINE / lit.cosine).all()

    @pytest.mark.slow
    @above(WIDE, {"tilted": TILTED})
    def test_projected_directions_are_uniform(self, lit: Lit) -> None:
        assert self._p_value(lit, lit.sample(unit_square(SAMPLES))) > SIGNIFICANCE

    @pytest.mark.parametrize("ratio", WIDE)
    def test_chi2_detects_directions_that_are_uniform_in_the_cone(self, ratio: float) -> None:
        lit = Lit.at(ratio, ratio ** GRAZING[-1], TILTED)
        sample = Lights.of(lit.light).sample(unit_square(SAMPLES), normal=-TILTED)
        assert self._p_value(lit, sample) < SIGNIFICANCE

    @pytest.mark.parametrize("ratio", WIDE)
    def test_chi2_detects_a_cap_that_is_too_wide(self, ratio: float) -> None:
        lit, wide = (Lit.at(r, sqrt(ratio), TILTED) for r in (ratio, ratio * (1 + BIAS)))
        assert self._p_value(lit, wide.sample(unit_square(SAMPLES))) < SIGNIFICANCE

    @staticmethod
    def _p_value(lit: Lit, sample: LightSample) -> float:
        """Test for the density cos θ / (π sin²σ cos ω), in polar coordinates around the axis."""
        turned = basis(lit.axis[None])[0]
        height = lit.sine**2 / (1 + sqrt(1 - lit.sine**2))
        edges = height * np.linspace(0, 1, polar.CELLS + 1)
        normal = turned @ lit.normal
        density = lambda below, phi: polar.directions(below, phi) @ normal / lit.projected  # noqa: E731
        return polar.p_value(to_host(sample.direction) @ turned.T, density, edges)


CROSSINGS: dict[str, Callable[[float], float]] = {
    "above": lambda sine: (1 + sine) / 2,
    "just above": lambda sine: sine * (1 + 1e-3),
    "just crossing": lambda sine: sine * (1 - 1e-3),
    "half below": lambda sine: 0,
    "mostly below": lambda sine: -sine / 2,
}


class TestHorizon:
    """Receivers with a cap above their horizon, across and below it."""

    @pytest.mark.slow
    @pytest.mark.parametrize("ratio", RATIOS)
    @pytest.mark.parametrize("place", CROSSINGS)
    @pytest.mark.parametrize("normal", NORMALS)
    def test_irradiance(self, ratio: float, place: str, normal: str) -> None:
        lit = Lit.at(ratio, CROSSINGS[place](ratio), NORMALS[normal])
        by_the_horizon = normal == "tilted" and place != "above"
        bound = IRRADIANCE + (ROUNDED / ratio if by_the_horizon else 0)
        assert self._irradiance(lit) == pytest.approx(lit.irradiance, rel=bound, abs=0)

    @pytest.mark.parametrize("ratio", RATIOS)
    @pytest.mark.parametrize("normal", NORMALS)
    def test_no_light_from_below(self, ratio: float, normal: str) -> None:
        assert self._irradiance(Lit.at(ratio, max(-1.5 * ratio, -1), NORMALS[normal])) == 0

    @pytest.mark.parametrize("place", CROSSINGS)
    def test_irradiance_detects_a_bias(self, place: str) -> None:
        lit = Lit.at(0.1, CROSSINGS[place](0.1))
        biased = (1 + BIAS) * lit.irradiance
        assert self._irradiance(lit) != pytest.approx(biased, rel=IRRADIANCE)

    @pytest.mark.parametrize("ratio", RATIOS)
    def test_only_a_cap_that_is_wholly_above_is_projected(self, ratio: float) -> None:
        for place, cosine in CROSSINGS.items():
            inverse = to_host(Lit.at(ratio, cosine(ratio)).sample(unit_square(1000)).inverse_pdf)
            assert (np.ptp(inverse) > 0) == ("above" in place)

    @staticmethod
    def _irradiance(lit: Lit) -> float:
        sample = lit.sample(sobol())
        cosine = np.maximum(to_host(sample.direction) @ lit.normal, 0)
        return float((to_host(sample.inverse_pdf) * cosine).mean())


@pytest.mark.parametrize("normal", [UP, -UP, TILTED, (1, 0, 0)])
@pytest.mark.parametrize("point", [(0, 0, 1), (0, 0, 1.9), (0.5, 0, 1), (0, 0, 2)])
def test_a_sphere_light_is_dark_from_inside(point: Any, normal: Any) -> None:
    lights = Lights.of(Sphere((0, 0, 1), 1, radiance=1))
    sample = lights.sample(unit_square(1000), point=point, normal=normal)
    np.testing.assert_array_equal(to_host(sample.inverse_pdf), 0)


@pytest.mark.parametrize("lights", [[SPHERE], [TRIANGLE], [SPHERE, TRIANGLE], 20 * [SPHERE]])
def test_a_receiver_that_is_not_a_number_is_not_dark(lights: list[Shape]) -> None:
    """Its samples are to be counted, not lost in a comparison that is false."""
    sample = Lights.of(*lights).sample(unit_square(10), point=(np.nan, 0, 0))
    assert np.isnan(to_host(sample.inverse_pdf)).all()


class TestArea:
    """Points uniform on a light: the mean of 1 / density is the solid angle."""

    @pytest.mark.parametrize("ratio", [0.9, 0.5, 0.1, 1e-2, 1e-3])
    def test_sphere(self, ratio: float) -> None:
        light, sigma = sphere_at(0.3, ratio)
        sample = Lights.of(light, mode=Mode.EXPLICIT_UNIFORM).sample(sobol())
        mean = to_host(sample.inverse_pdf).mean()
        expected = cone_solid_angle(sigma)
        assert mean == pytest.approx(expected, rel=MEAN_SOLID_ANGLE)
        assert mean != pytest.approx(expected * (1 + BIAS), rel=MEAN_SOLID_ANGLE)

    def test_irradiance_of_a_sphere_half_below_the_horizon(self) -> None:
        light, sigma = sphere_at(pi / 2, 0.5)
        sample = Lights.of(light, mode=Mode.EXPLICIT_UNIFORM).sample(sobol())
        cosine = np.maximum(to_host(sample.direction)[:, 2], 0)
        irradiance = (to_host(sample.inverse_pdf) * cosine).mean()
        expected = sphere_light_irradiance(1, sigma, pi / 2)
        assert irradiance == pytest.approx(expected, rel=MEAN_SOLID_ANGLE)

    @pytest.mark.parametrize("scale", [1.0, 100.0])
    def test_triangle(self, scale: float) -> None:
        corners = rounded(TRIANGLE.vertices * (1, 1, scale))
        light = Mesh(corners, [(0, 1, 2)], radiance=1)
        sample = Lights.of(light).sample(sobol())
        mean = to_host(sample.inverse_pdf).mean()
        expected = triangle_solid_angle(corners)
        assert mean == pytest.approx(expected, rel=MEAN_SOLID_ANGLE)
        assert mean != pytest.approx(expected * (1 + BIAS), rel=MEAN_SOLID_ANGLE)

    def test_triangle_is_dark_from_behind(self) -> None:
        sample = Lights.of(TRIANGLE).sample(unit_square(1000), point=(0, 0, 5))
        assert (to_host(sample.inverse_pdf) == 0).all()

    def test_directions_end_on_the_triangle(self) -> None:
        sample = Lights.of(TRIANGLE).sample(unit_square(100_000))
        direction, distance = to_host(sample.direction), to_host(sample.distance)
        np.testing.assert_allclose(np.linalg.norm(direction, axis=1), 1, rtol=0, atol=UNIT)
        weights = (direction * distance[:, None]) @ np.linalg.inv(TRIANGLE.vertices)
        np.testing.assert_allclose(weights.sum(axis=1), 1, rtol=0, atol=5 * PLACE)
        assert weights.min() > -5 * PLACE

    @pytest.mark.parametrize("light", [SPHERE, TRIANGLE])
    def test_ends_of_the_unit_interval(self, light: Shape) -> None:
        lights = Lights.of(light, mode=Mode.EXPLICIT_UNIFORM)
        sample = lights.sample(to_device([(x, y) for x in ENDS for y in ENDS]))
        direction = to_host(sample.direction)
        np.testing.assert_allclose(np.linalg.norm(direction, axis=1), 1, rtol=0, atol=UNIT)
        assert np.isfinite(to_host(sample.inverse_pdf)).all()


MANY: list[Shape] = [
    *(Sphere((x, 0, 3), 0.1 + 0.02 * x, radiance=(1 + x, 2, 1 / (1 + x))) for x in np.arange(20.0)),
    Sphere((0, 5, 3), 0.01, radiance=1e4),
    Sphere((0, 8, 3), 1, radiance=1e-6),
    TRIANGLE,
    Mesh(TRIANGLE.vertices[[0, 2, 1]] + 9, [(0, 1, 2)], radiance=7),
]


def test_of_a_single_light_asks_for_no_number() -> None:
    at = Receiver(to_device([ORIGIN]), to_device([UP]))

    def refuse() -> Any:
        raise AssertionError

    choice = Lights.of(SPHERE).scene.emitters.choose(at, TYPES.Bool(True), refuse)
    assert (np.array(choice.light).tolist(), np.array(choice.pmf).tolist()) == ([0], [1])


class TestSampleOfMany:
    @pytest.mark.parametrize("number", [0, 7, 20, 22, 23])
    def test_is_that_of_the_light_alone_by_its_probability(self, number: int) -> None:
        u, lights = unit_square(1000), Lights.of(*MANY)
        many = lights.sample(u, light=number)
        at = Receiver(to_device([ORIGIN]), to_device([UP]))
        pmf = to_host(lights.pmf(at, TYPES.UInt32([number])))
        alone = Lights.of(MANY[number]).sample(u)
        for a, b in (
            (many.direction, alone.direction),
            (many.distance, alone.distance),
            (to_device(pmf) * many.inverse_pdf, alone.inverse_pdf),
        ):
            many_values, expected = np.broadcast_arrays(to_host(a), to_host(b))
            np.testing.assert_allclose(many_values, expected, rtol=2 * AGREE, atol=UNIT)
        np.testing.assert_allclose(to_host(many.radiance)[0], MANY[number].radiance or 0, rtol=1e-7)


class TestInversePdf:
    @pytest.mark.parametrize("number", [0, 1])
    def test_at_a_hit_is_that_of_the_sample(self, number: int) -> None:
        away = Mesh(TRIANGLE.vertices + np.array([5, 0, 0]), [(0, 1, 2)], radiance=(2, 1, 0.5))
        lights = Lights.of(SPHERE, away)
        sample = lights.sample(unit_square(100_000), light=number)
        inverse, found = lights.inverse_pdf_of_hits(sample.direction, number)
        assert found.mean() > 0.999  # rounding lets a few miss the rim
        expected = np.broadcast_to(to_host(sample.inverse_pdf), inverse.shape)
        np.testing.assert_allclose(inverse[found], expected[found], rtol=AGREE)

    @pytest.mark.parametrize("ratio", WIDE)
    @pytest.mark.parametrize("place", CROSSINGS)
    def test_at_a_hit_on_either_side_of_the_horizon(self, ratio: float, place: str) -> None:
        lit = Lit.at(ratio, CROSSINGS[place](ratio), TILTED)
        sample = lit.sample(unit_square(100_000))
        lights = Lights.of(lit.light)
        inverse, found = lights.inverse_pdf_of_hits(sample.direction, normal=TILTED)
        assert found.mean() > 0.99
        expected = np.broadcast_to(to_host(sample.inverse_pdf), inverse.shape)
        error = np.abs(inverse / expected - 1)[found]
        if "above" in place:
            cosine = (to_host(sample.direction) @ TILTED)[found]
            assert (error < AGREE + COSINE / cosine).all()
        else:
            np.testing.assert_array_equal(error, 0)

    @pytest.mark.parametrize("ratio", RATIOS[1:-1])
    def test_of_a_cone_is_its_solid_angle(self, ratio: float) -> None:
        light, sigma = sphere_at(0.3, ratio)
        lights = Lights.of(light)
        direction = to_device(normalize(np.array([light.center])))
        inverse, found = lights.inverse_pdf_of_hits(direction, normal=AWAY)
        assert found.all()
        np.testing.assert_allclose(inverse, cone_solid_angle(sigma), rtol=SOLID_ANGLE)

    @pytest.mark.parametrize("light", [SPHERE, TRIANGLE])
    @pytest.mark.parametrize("normal", [UP, AWAY, TILTED, (0.8, 0, 0.6), (1, 0, 0)])
    def test_density_integrates_to_one(self, light: Shape, normal: Any) -> None:
        directions = square_to_sphere(sobol())
        inverse, found = Lights.of(light).inverse_pdf_of_hits(directions, normal=normal)
        density = np.where(found, 1 / np.where(found, inverse, 1), 0)
        assert 4 * pi * density.mean() == pytest.approx(1, abs=BIAS / 5)


class TestPowerHeuristic:
    def test_weights_of_both_techniques_sum_to_one(self) -> None:
        ratio = np.geomspace(1e-18, 1e18, 1001)
        weight = to_host(power_heuristic(to_device(ratio)))
        other = to_host(power_heuristic(to_device(1 / ratio)))
        np.testing.assert_allclose(weight + other, 1, rtol=3e-7)
        np.testing.assert_allclose(weight, 1 / (1 + ratio**2), rtol=5e-7, atol=1e-37)

    def test_where_one_technique_never_or_always_finds_a_direction(self) -> None:
        weight = to_host(power_heuristic(to_device([0, 1e-30, 1, 1e30, np.inf])))
        np.testing.assert_array_equal(weight, [1, 1, 0.5, 0, 0])
