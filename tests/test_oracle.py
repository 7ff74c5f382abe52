"""The float64 oracle against closed forms, against itself, and its gates against known biases."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from drpt.scene import Camera, Diffuse, Mesh, Phong, Scene, Sphere
from tests.oracle import brdf, closed_forms, geometry, path_tracer, statistics
from tests.oracle.arrays import Floats, basis, dot, normalize, sample_uniform_sphere

QUADRATURE = 1e-9  # relative error that the nested quadratures below reach
SIGNIFICANCE = 1e-4  # of each statistical gate; seeds are fixed, so it fails always or never
BIAS = 0.005  # what the statistical gates must detect
PATH_BIAS = 0.1  # what each comparison of rendered values must detect: all that a second buys

MATERIALS = [Diffuse(0.7), Phong(0.7, 0), Phong(0.7, 1.5), Phong(0.7, 40)]
QUAD = [(0, 1, 2), (0, 2, 3)]


def square(half: float, height: float = 0.0) -> list[tuple[float, float, float]]:
    """Return the corners of a square around the z axis, counter-clockwise seen from above."""
    return [
        (-half, -half, height),
        (half, -half, height),
        (half, half, height),
        (-half, half, height),
    ]


def one_pixel(eye: tuple[float, float, float], target: tuple[float, float, float]) -> Camera:
    return Camera(eye=eye, target=target, up=(0.0, 0.6, 0.8), fov=1e-6, width=1, height=1)


def estimate(
    scene: Scene, spp: int, bounces: int, *, direct_light: bool = False, sample_brdf: bool = False
) -> tuple[Floats, Floats]:
    rng = np.random.default_rng(7)
    return path_tracer.render(
        scene, spp, bounces, rng, direct_light=direct_light, sample_brdf=sample_brdf
    )


def assert_agree(mean: Floats, se: Floats, truth: Floats, se_truth: Floats | int = 0) -> None:
    """Assert that rendered colours (3,) are right, and that `PATH_BIAS` would have shown."""
    statistics.assert_means_agree(mean, se, truth, se_truth, SIGNIFICANCE)
    least = statistics.smallest_detectable(np.hypot(se, se_truth), SIGNIFICANCE, mean.size)
    assert np.all(least <= PATH_BIAS * truth)


def projected_cap(sigma: float, omega: float) -> float:
    """Integrate the cosine over the visible part of a cap, in polar coordinates of its centre."""

    def ring(gamma: float) -> float:
        a = math.cos(omega) * math.cos(gamma)
        b = math.sin(omega) * math.sin(gamma)
        end = math.acos(min(max(-a / b, -1.0), 1.0)) if b > 0 else math.pi * (a > 0)
        around = quad(lambda phi: a + b * math.cos(phi), 0, end, epsabs=1e-13)[0]
        return 2 * math.sin(gamma) * float(around)

    horizon = abs(math.pi / 2 - omega)
    points = [horizon] if 0 < horizon < sigma else None
    return float(quad(ring, 0, sigma, points=points, epsabs=1e-12, epsrel=1e-11, limit=200)[0])


class TestClosedForms:
    def test_furnace_is_the_geometric_series(self) -> None:
        s = (0.5 / 2) ** 2
        series = 0.8 * 3 * s * sum((0.8 * (1 - s)) ** j for j in range(4))
        assert closed_forms.furnace_radiance(0.8, 3, 0.5, 2, 4) == pytest.approx(series, rel=1e-14)
        assert closed_forms.furnace_radiance(0.8, 3, 0.5, 2, 0) == 0

    def test_furnace_converges_to_what_energy_conservation_asks(self) -> None:
        # A white wall returns all that it receives, until its radiance is the light's.
        assert closed_forms.furnace_radiance(1, 3, 0.5, 2, 1000) == pytest.approx(3, rel=1e-12)

    @pytest.mark.parametrize("sigma", [0.05, 0.6, 1.4])
    @pytest.mark.parametrize("omega", [0.0, 0.3, 1.2, math.pi / 2, 1.6, 2.2, math.pi])
    def test_sphere_light_irradiance(self, sigma: float, omega: float) -> None:
        expected = 2 * projected_cap(sigma, omega)
        value = closed_forms.sphere_light_irradiance(2, sigma, omega)
        assert value == pytest.approx(expected, rel=QUADRATURE, abs=QUADRATURE)
        if omega - sigma >= math.pi / 2:
            assert value == 0

    def test_sphere_light_flux(self) -> None:
        radius, height, a, b = 0.5, 0.8, 1.5, 0.7

        def irradiance(x: float, y: float) -> float:
            distance = math.sqrt(x * x + y * y + height**2)
            omega = math.acos(height / distance)
            return closed_forms.sphere_light_irradiance(2, math.asin(radius / distance), omega)

        nodes, weights = np.polynomial.legendre.leggauss(60)
        flux = sum(
            wx * wy * irradiance(a * x, b * y)
            for x, wx in zip(nodes, weights, strict=True)
            for y, wy in zip(nodes, weights, strict=True)
        )
        value = closed_forms.sphere_light_flux_through_rectangle(2, radius, height, a, b)
        assert value == pytest.approx(a * b * flux, rel=QUADRATURE)

    @pytest.mark.slow
    @pytest.mark.parametrize("exponent", [0, 1, 50, 1e4])
    def test_phong_mirrored_light(self, exponent: float) -> None:
        sigma, theta = 0.4, 0.9
        gamma, weights = np.polynomial.legendre.leggauss(400)
        gamma = sigma * (1 + gamma) / 2
        phi = 2 * np.pi * np.arange(16) / 16
        cosine = np.cos(theta) * np.cos(gamma)[:, None]
        cosine = cosine + np.sin(theta) * np.sin(gamma)[:, None] * np.cos(phi)
        around = 2 * np.pi * cosine.mean(axis=1)
        lobe = (exponent + 1) / (2 * np.pi) * np.cos(gamma) ** exponent
        expected = 0.7 * 3 * sigma / 2 * (weights * lobe * np.sin(gamma) * around).sum()
        value = closed_forms.phong_mirrored_light(0.7, exponent, 3, sigma, theta)
        assert value == pytest.approx(expected, rel=QUADRATURE)

    @pytest.mark.parametrize("exponent", [0, 1, 7.5, 200])
    @pytest.mark.parametrize("theta", [0, 1e-3, 0.7, 1.4, math.pi / 2])
    def test_phong_directional_albedo(self, exponent: float, theta: float) -> None:
        # Integrated around the normal instead of around the lobe.
        def over_azimuth(cos_i: float) -> float:
            a, b = math.cos(theta) * cos_i, math.sin(theta) * math.sqrt(1 - cos_i**2)
            end = math.acos(min(max(-a / b, -1.0), 1.0)) if b > 0 else math.pi
            lobe = quad(lambda phi: max(a + b * math.cos(phi), 0.0) ** exponent, 0, end)[0]
            return 2 * float(lobe) * cos_i

        kinks = [math.sin(theta), math.cos(theta)]
        integral, _ = quad(over_azimuth, 0, 1, points=kinks, epsabs=1e-12, limit=200)
        expected = 0.7 * (exponent + 1) / (2 * math.pi) * integral
        value = closed_forms.phong_directional_albedo(0.7, exponent, theta)
        assert value == pytest.approx(expected, rel=1e-8)

    def test_phong_directional_albedo_of_a_mirror_is_the_cosine(self) -> None:
        value = closed_forms.phong_directional_albedo(0.7, 1e8, 1.2)
        assert value == pytest.approx(0.7 * math.cos(1.2), rel=1e-7)


class TestGeometry:
    def test_sphere_from_outside_inside_and_behind(self) -> None:
        sphere = Sphere(center=(1, 2, 3), radius=2, material=Diffuse(0.5))
        origins = np.array([(1.0, 2.0, -7.0), (1.0, 2.0, 4.0), (1.0, 2.0, 7.0), (4.0, 2.0, -7.0)])
        hits = geometry.closest_hit([sphere], origins, np.tile([0.0, 0.0, 1.0], (4, 1)))
        assert hits.t.tolist() == [8, 1, math.inf, math.inf]
        assert hits.shape.tolist() == [0, 0, -1, -1]
        np.testing.assert_array_equal(hits.geometric_normal[:2], [(0, 0, -1), (0, 0, 1)])
        np.testing.assert_array_equal(hits.position[:2], [(1, 2, 1), (1, 2, 5)])

    def test_sphere_agrees_with_exact_arithmetic_near_its_silhouette(self) -> None:
        rng = np.random.default_rng(1)
        eye = np.array([0.0, 0.0, -1000.0])
        slope = 1 / math.sqrt(1000**2 - 1) * (1 + 1e-9 * rng.standard_normal(500))
        directions = np.stack([slope, 0 * slope, 1 + 0 * slope], axis=1)
        exact = [
            geometry.sphere_is_hit_exactly(eye.tolist(), d.tolist(), (0, 0, 0), 1)
            for d in directions
        ]
        sphere = Sphere(center=(0, 0, 0), radius=1, material=Diffuse(0.5))
        hits = geometry.closest_hit([sphere], np.tile(eye, (500, 1)), normalize(directions))
        assert 200 < sum(exact) < 300
        np.testing.assert_array_equal(hits.shape == 0, exact)

    def test_triangles_give_position_face_and_interpolated_normal(self) -> None:
        normals = [(-1, 0, 2), (1, 0, 2), (1, 0, 2), (-1, 0, 2)]
        mesh = Mesh(square(1), QUAD, normals, material=Diffuse(0.5))
        origins = np.array([(0.5, -0.25, 3.0), (-0.5, 0.25, -3.0), (1.5, 0.0, 3.0)])
        directions = np.array([(0.0, 0.0, -1.0), (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)])
        hits = geometry.closest_hit([mesh], origins, directions)
        assert hits.t.tolist() == [3, 3, math.inf]
        assert hits.primitive.tolist() == [0, 1, -1]
        np.testing.assert_allclose(hits.position[0], (0.5, -0.25, 0), atol=1e-15)
        np.testing.assert_array_equal(hits.geometric_normal[:2], [(0, 0, 1), (0, 0, 1)])
        expected = normalize(np.array([(0.5, 0, 2), (-0.5, 0, 2)]))
        np.testing.assert_allclose(hits.shading_normal[:2], expected, atol=1e-15)

    def test_no_ray_slips_through_shared_edges(self) -> None:
        vertices = np.array([(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)], float)
        faces = np.array([(0, 1, 2), (0, 2, 3), (0, 3, 1), (1, 3, 2)])
        mesh = Mesh(vertices, faces, material=Diffuse(0.5))
        weight = np.linspace(0, 1, 200)[:, None]
        edges = [(i, j) for i in range(4) for j in range(i)]
        targets = np.concatenate(
            [weight * vertices[i] + (1 - weight) * vertices[j] for i, j in edges]
        )
        origins = np.tile([0.1, 0.05, -0.07], (len(targets), 1))
        hits = geometry.closest_hit([mesh], origins, normalize(targets - origins))
        assert np.isfinite(hits.t).all()
        np.testing.assert_allclose(hits.position, targets, atol=1e-14)

    def test_triangles_without_area_are_never_hit(self) -> None:
        line = np.array([1.0, 2.0, 3.0])
        mesh = Mesh([-line, 0 * line, line], [(0, 1, 2), (0, 0, 1)], material=Diffuse(0.5))
        targets = np.linspace(-1, 1, 1001)[:, None] * line
        origins = np.tile([0.3, 0.2, 5.0], (1001, 1))
        hits = geometry.closest_hit([mesh], origins, normalize(targets - origins))
        assert not np.isfinite(hits.t).any()

    def test_nearest_shape_wins_and_the_interval_is_open(self) -> None:
        shapes = [
            Mesh(square(1, 0), QUAD, material=Diffuse(0.5)),
            Mesh(square(1, 1), QUAD, material=Diffuse(0.5)),
        ]
        origin, down = np.array([[0.1, 0.2, 3.0]]), np.array([[0.0, 0.0, -1.0]])
        assert geometry.closest_hit(shapes, origin, down).shape[0] == 1
        assert geometry.closest_hit(shapes, origin, down, t_min=2.0).shape[0] == 0
        assert not geometry.any_hit(shapes, origin, down, 0.0, np.array([2.0]))[0]
        assert geometry.any_hit(shapes, origin, down, 0.0, np.array([2.1]))[0]


class TestBrdf:
    n = np.array([[0.0, 0.0, 1.0]])

    @pytest.mark.parametrize("material", MATERIALS)
    def test_reciprocal_and_two_sided(self, material: Diffuse | Phong) -> None:
        rng = np.random.default_rng(3)
        wo, wi = np.abs(sample_uniform_sphere(rng, 100)), np.abs(sample_uniform_sphere(rng, 100))
        n = np.tile(self.n, (100, 1))
        forth = brdf.evaluate(material, n, n, wo, wi) / wi[:, 2:]
        back = brdf.evaluate(material, n, n, wi, wo) / wo[:, 2:]
        below = brdf.evaluate(material, n, n, -wo, -wi) / wi[:, 2:]
        np.testing.assert_allclose(forth, back, rtol=1e-12)
        np.testing.assert_array_equal(forth, below)

    @pytest.mark.parametrize("material", MATERIALS)
    def test_directional_albedo(self, material: Diffuse | Phong) -> None:
        theta = 0.9
        wo = np.array([[math.sin(theta), 0.0, math.cos(theta)]])

        def value(wi: Floats) -> Floats:
            n = np.tile(self.n, (len(wi), 1))
            return brdf.evaluate(material, n, n, np.tile(wo, (len(wi), 1)), wi)[:, 0]

        cos_edges, phi_edges = np.linspace(0, 1, 80), np.linspace(0, 2 * np.pi, 80)
        albedo = statistics.probability_per_cell(value, cos_edges, phi_edges).sum()
        expected = 0.7
        if isinstance(material, Phong):
            expected = closed_forms.phong_directional_albedo(0.7, material.exponent, theta)
        # α = 0 jumps at 90° from the lobe's axis, which runs across the cells.
        rel = 1e-4 if material == Phong(0.7, 0) else 1e-5
        assert albedo == pytest.approx(expected, rel=rel)

    @pytest.mark.parametrize("material", MATERIALS)
    def test_directions_behind_either_normal_do_not_count(self, material: Diffuse | Phong) -> None:
        ns = normalize(np.array([[1.0, 0.0, 1.0]]))
        front, behind_shading, behind_surface = (
            normalize(np.array([w])) for w in ((1.0, 0.0, 1.5), (-1.0, 0.0, 0.1), (1.0, 0.0, -0.1))
        )
        given = material, self.n, ns
        assert (brdf.evaluate(*given, front, front) > 0).all()
        for wo, wi in ((front, behind_shading), (front, behind_surface), (behind_shading, self.n)):
            assert (brdf.evaluate(*given, wo, wi) == 0).all()
            assert (brdf.density(*given, wo, wi) == 0).all()

    def test_normals_are_turned_together(self) -> None:
        ns = normalize(np.array([[1.0, 0.0, -2.0]]))
        wo = normalize(np.array([[0.3, 0.0, -1.0]]))
        ng, turned = brdf.turn_to_viewer(self.n, ns, wo)
        np.testing.assert_array_equal(ng, -self.n)
        np.testing.assert_array_equal(turned, ns)

    @pytest.mark.parametrize("material", MATERIALS)
    def test_samples_follow_the_density(self, material: Diffuse | Phong) -> None:
        count, theta = 100_000, 1.1
        ng, ns = self.n, normalize(np.array([[0.2, 0.1, 1.0]]))
        wo = np.array([[math.sin(theta), 0.0, math.cos(theta)]])
        _, turned = brdf.turn_to_viewer(ng, ns, wo)
        axis = turned if isinstance(material, Diffuse) else 2 * dot(ns, wo) * turned - wo
        to_world = basis(axis)[0]

        def around_axis(local: Floats) -> Floats:
            wi = local @ to_world
            n = len(wi)
            given = np.tile(ng, (n, 1)), np.tile(ns, (n, 1)), np.tile(wo, (n, 1))
            return brdf.density(material, *given, wi)

        given = np.tile(ng, (count, 1)), np.tile(ns, (count, 1)), np.tile(wo, (count, 1))
        local = brdf.sample(material, *given, np.random.default_rng(4)) @ to_world.T
        local = local[around_axis(local) > 0]
        edges = np.linspace(-1, 1, 41), np.linspace(0, 2 * np.pi, 41)
        good = statistics.chi2_test(local, count, around_axis, *edges)
        assert good.p_value > SIGNIFICANCE
        wrong = statistics.chi2_test(local, count, lambda w: 0.97 * around_axis(w), *edges)
        assert wrong.p_value < SIGNIFICANCE


FURNACE = Scene(
    one_pixel((0, 0, 0.7), (0, 0.3, 2)),
    [
        Sphere(center=(0, 0, 0), radius=0.5, radiance=(3, 2, 1)),
        Sphere(center=(0, 0, 0), radius=1, material=Diffuse(0.8)),
    ],
)
PLANE = Mesh(square(50), QUAD, material=Diffuse(0.6))
TRIANGLE_LIGHT = Mesh([(0, -1, 1), (0, 1, 1), (0, 0, 2.5)], [(0, 1, 2)], radiance=(2, 1, 0.5))
MIXED = Scene(
    Camera(eye=(4, 0, 2), target=(0, 0, 0.5), up=(0, 0, 1), fov=50, width=4, height=4),
    [
        Mesh(square(3), QUAD, material=Phong((0.8, 0.6, 0.9), 3)),
        TRIANGLE_LIGHT,
        Sphere(center=(1, 0.8, 0.5), radius=0.4, material=Diffuse((0.9, 0.5, 0.2))),
        Sphere(center=(1.2, -0.9, 0.8), radius=0.3, radiance=(4, 6, 8)),
    ],
)


class TestPathTracer:
    @pytest.mark.parametrize("bounces", [0, 1, 4])
    @pytest.mark.parametrize("direct_light", [False, True])
    @pytest.mark.parametrize("sample_brdf", [False, True])
    def test_furnace(self, bounces: int, direct_light: bool, sample_brdf: bool) -> None:
        mean, se = estimate(
            FURNACE, 60_000, bounces, direct_light=direct_light, sample_brdf=sample_brdf
        )
        wall = [closed_forms.furnace_radiance(0.8, L, 0.5, 1, bounces) for L in (3, 2, 1)]
        assert_agree(mean[0, 0], se[0, 0], np.array(wall))

    @pytest.mark.parametrize(
        "omega", [0.5, 1.6, *(pytest.param(angle, marks=pytest.mark.slow) for angle in (1.4, 2.3))]
    )
    @pytest.mark.parametrize("direct_light", [False, True])
    def test_plane_under_a_sphere_light(self, omega: float, direct_light: bool) -> None:
        sigma, distance = 0.6, 3.0
        center = distance * np.array([math.sin(omega), 0, math.cos(omega)])
        light = Sphere(center=center, radius=distance * math.sin(sigma), radiance=2)
        # The plane ends behind the point that is seen: else the light could cut it.
        plane = Mesh(
            [(-9, -9, 0), (1e-4, -9, 0), (1e-4, 9, 0), (-9, 9, 0)], QUAD, material=Diffuse(0.6)
        )
        scene = Scene(one_pixel((-2, 0, 1.5), (0, 0, 0)), [plane, light])
        mean, se = estimate(scene, 150_000, 1, direct_light=direct_light)
        E = closed_forms.sphere_light_irradiance(2, sigma, omega)
        assert_agree(mean[0, 0], se[0, 0], np.full(3, 0.6 / math.pi * E))

    def test_phong_around_a_mirrored_light(self) -> None:
        sigma, theta, exponent = 0.5, 0.8, 15
        light = Sphere(
            center=(4 * math.sin(theta), 0, 4 * math.cos(theta)),
            radius=4 * math.sin(sigma),
            radiance=2,
        )
        plane = Mesh(square(9), QUAD, material=Phong(0.6, exponent))
        eye = (-2 * math.sin(theta), 0.0, 2 * math.cos(theta))
        scene = Scene(one_pixel(eye, (0, 0, 0)), [plane, light])
        truth = closed_forms.phong_mirrored_light(0.6, exponent, 2, sigma, theta)
        for direct_light, sample_brdf in ((False, False), (True, False), (False, True)):
            mean, se = estimate(
                scene, 100_000, 1, direct_light=direct_light, sample_brdf=sample_brdf
            )
            assert_agree(mean[0, 0], se[0, 0], np.full(3, truth))

    def test_estimators_agree(self) -> None:
        reference = estimate(MIXED, 8000, 3)
        for direct_light, sample_brdf in ((True, False), (False, True), (True, True)):
            image = estimate(MIXED, 8001, 3, direct_light=direct_light, sample_brdf=sample_brdf)
            statistics.assert_means_agree(*image, *reference, SIGNIFICANCE)
            assert_agree(
                *statistics.mean_of_independent(*image),
                *statistics.mean_of_independent(*reference),
            )

    def test_triangle_lights_emit_from_their_front_alone(self) -> None:
        for x, expected in ((3.0, 1), (-3.0, 0)):
            scene = Scene(one_pixel((x, 0, 1.5), (0, 0, 1.5)), [TRIANGLE_LIGHT])
            mean, _ = estimate(scene, 2, 1)
            np.testing.assert_array_equal(mean[0, 0], np.multiply(expected, (2, 1, 0.5)))

    def test_camera(self) -> None:
        camera = Camera(eye=(1, 2, 3), target=(1, 2, 13), up=(0, 1, 0), fov=90, width=4, height=2)
        rng = np.random.default_rng(0)
        rows, columns = np.indices((2, 4)).reshape(2, -1)
        origins, directions = path_tracer.camera_rays(camera, rows, columns, rng)
        np.testing.assert_array_equal(origins, np.tile([1, 2, 3], (8, 1)))
        x, y = (directions[:, k] / directions[:, 2] for k in (0, 1))
        # forward × up = z × y = -x is right in the picture; half-width 2, half-height 1.
        assert np.floor(2 - x).tolist() == [0, 1, 2, 3] * 2
        assert np.floor(1 - y).tolist() == [0] * 4 + [1] * 4

    def test_standard_error_is_that_of_the_mean(self) -> None:
        # Pixels so small that all have the same expectation: their spread is the error.
        camera = Camera(
            eye=(0, 0, 5), target=(0, 0, 0), up=(0, 1, 0), fov=1e-6, width=30, height=30
        )
        scene = Scene(camera, [PLANE, Sphere(center=(0, 0, 9), radius=3, radiance=5)])
        mean, se = estimate(scene, 200, 1)
        assert mean[..., 0].std() == pytest.approx(math.sqrt((se[..., 0] ** 2).mean()), rel=0.1)


class TestStatistics:
    """Each gate passes what is right, and fails on `BIAS` or the least that it says it detects."""

    samples = np.random.default_rng(2).exponential(size=(400, 10_000))

    def test_means(self) -> None:
        mean = self.samples.mean(axis=1)
        se = self.samples.std(axis=1, ddof=1) / math.sqrt(self.samples.shape[1])
        image = mean.reshape(20, 20, 1), se.reshape(20, 20, 1)
        whole = statistics.mean_of_independent(*image)
        assert statistics.smallest_detectable(whole[1], SIGNIFICANCE).item() < BIAS
        statistics.assert_means_agree(*image, 1, 0, SIGNIFICANCE)
        statistics.assert_means_agree(*whole, 1, 0, SIGNIFICANCE)
        with pytest.raises(AssertionError, match="means differ"):
            statistics.assert_means_agree(*whole, 1 + BIAS, 0, SIGNIFICANCE)

    def test_one_wrong_value_among_many(self) -> None:
        mean, se = np.ones(1000), np.full(1000, 0.001)
        least = statistics.smallest_detectable(0.001, SIGNIFICANCE, comparisons=1000)
        mean[17] += 1.1 * least
        with pytest.raises(AssertionError, match=r"differ at \(17,\)"):
            statistics.assert_means_agree(mean, se, 1, 0, SIGNIFICANCE)

    def test_the_gate_has_the_significance_and_power_that_it_states(self) -> None:
        rng, truths = np.random.default_rng(5), 200_000
        values = rng.standard_normal(truths)
        least = statistics.smallest_detectable(1, 0.01)
        for shift, rate in ((0, 0.01), (least, 0.95)):
            failed = statistics.z_test_mean(values + shift, 1, 0) < 0.01
            assert failed.mean() == pytest.approx(rate, abs=0.002)

    def test_values_without_noise(self) -> None:
        statistics.assert_means_agree(1 + 1e-7, 0, 1, 0, SIGNIFICANCE)
        for wrong in (1 + 1e-5, math.nan, math.inf):
            with pytest.raises(AssertionError):
                statistics.assert_means_agree(wrong, 0, 1, 0, SIGNIFICANCE)

    def test_sidak(self) -> None:
        assert 1 - (1 - statistics.sidak(0.05, 12)) ** 12 == pytest.approx(0.05)

    def test_chi2_of_directions(self) -> None:
        # A density that is wrong by 3 % one way here and the other way there.
        directions = sample_uniform_sphere(np.random.default_rng(6), 300_000)
        edges = np.linspace(-1, 1, 21), np.linspace(0, 2 * np.pi, 21)
        for bias, passes in ((0.0, True), (0.03, False)):

            def pdf(w: Floats, bias: float = bias) -> Floats:
                return np.asarray((1 + bias * np.sign(w[:, 0])) / (4 * np.pi))

            test = statistics.chi2_test(directions, len(directions), pdf, *edges)
            assert (test.p_value > SIGNIFICANCE) == passes

    def test_chi2_pools_small_cells(self) -> None:
        expected = np.array([0.0, 1.0, 2.0, 3.0, 50.0, 60.0])
        good = statistics.chi2_of_counts(np.array([0.0, 2, 1, 4, 49, 60]), expected)
        assert good.degrees_of_freedom == 2
        assert good.statistic == pytest.approx(1 / 6 + 1 / 50)
        with pytest.raises(ValueError, match="too few"):
            statistics.chi2_of_counts(expected[:3], expected[:3])
