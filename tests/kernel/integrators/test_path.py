"""The path tracer, ray by ray: what it counts, where it ends, and the float64 path tracer."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

import drpt
from drpt.kernel.integrators.path import UNROLLED_VERTICES
from tests.measuring import Measured, assert_agree, measure, measure_to, with_radiance
from tests.oracle import path_tracer
from tests.oracle.statistics import mean_of_independent

if TYPE_CHECKING:
    from drpt.scene import Shape
    from tests.oracle.arrays import Floats

MODES = tuple(drpt.Mode)
# The oracle takes 10 µs a path: what a few seconds of it detect.
DETECTABLE = 0.06
# Relative, of a sample without noise: the roundings of sin²σ cos ω, also where ω is grazing.
DIRECT = 2e-6

FLOOR = drpt.Mesh(
    [[-3, -3, 0], [3, -3, 0], [3, 3, 0], [-3, 3, 0]],
    [[0, 1, 2], [0, 2, 3]],
    material=drpt.Diffuse((0.7, 0.5, 0.9)),
)
LIGHT = drpt.Sphere((0, 0, 2), 0.8, radiance=(2, 3, 4))
BALL = drpt.Sphere((0.8, -0.8, 0.5), 0.5, material=drpt.Phong(0.8, 12))
CHALK = drpt.Sphere((-0.8, -0.8, 0.5), 0.5, material=drpt.Diffuse(0.8))
PANEL = drpt.Mesh([[-2, -1, 0.5], [-2, 1, 0.5], [-2, 0, 2.0]], [[0, 1, 2]], radiance=(6, 5, 4))
SMOOTH = drpt.Mesh(
    [[-1.5, -1.5, 0.2], [-0.2, -1.2, 0.2], [-1.0, -0.6, 1.0]],
    [[0, 1, 2]],
    [[-0.3, -1, 0.4], [0.3, -1, 0.4], [0.0, -1, 0.6]],
    material=drpt.Diffuse(0.8),
)


def scene_of(*shapes: Shape, side: int = 12) -> drpt.Scene:
    camera = drpt.Camera((0.5, -5, 2), (0, 0, 0.6), (0, 0, 1), 40, side, side)
    return drpt.Scene(camera=camera, shapes=shapes)


@pytest.fixture(scope="module", params=["spheres and floor", "all kinds"])
def scene_and_truth(request: pytest.FixtureRequest) -> tuple[drpt.Scene, Measured]:
    kinds = {
        "spheres and floor": (FLOOR, LIGHT, BALL),
        "all kinds": (FLOOR, LIGHT, BALL, PANEL, SMOOTH),
    }
    scene = scene_of(*kinds[request.param])
    rng = np.random.default_rng(0)
    image = path_tracer.render(scene, 512, 2, rng, direct_light=True, sample_brdf=True)
    return scene, Measured(*mean_of_independent(*image))


@pytest.mark.parametrize("mode", MODES)
def test_modes_agree_with_the_float64_path_tracer(
    mode: str, scene_and_truth: tuple[drpt.Scene, Measured]
) -> None:
    scene, truth = scene_and_truth
    assert_agree(measure(scene, 2**22, 2, mode), truth, DETECTABLE)


def test_the_comparison_with_the_oracle_sees_a_tenth_more_light(
    scene_and_truth: tuple[drpt.Scene, Measured],
) -> None:
    scene, truth = scene_and_truth
    with pytest.raises(AssertionError, match="means differ"):
        assert_agree(measure(with_radiance(scene, 1.1), 2**22, 2, "mis"), truth, DETECTABLE)


@pytest.mark.parametrize(
    "mode", [m if m == "mis" else pytest.param(m, marks=pytest.mark.slow) for m in MODES]
)
@pytest.mark.parametrize("shapes", [(CHALK, LIGHT), (BALL, LIGHT, PANEL), (CHALK, BALL, PANEL)])
def test_no_sample_of_an_open_scene_is_anything_but_finite(
    shapes: tuple[Shape, ...], mode: str
) -> None:
    for bounces in (1, 2):
        result = drpt.render(scene_of(*shapes), 16, bounces, mode)
        assert result.non_finite == 0
        assert np.isfinite(result.image).all()


@pytest.mark.parametrize("mode", MODES)
def test_no_radiance_is_negative(mode: str) -> None:
    image = drpt.render(scene_of(FLOOR, LIGHT, BALL, PANEL, SMOOTH), 64, 3, mode).image
    assert image.min() == 0


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
def test_light_adds_up_over_bounces(mode: str) -> None:
    scene = scene_of(FLOOR, LIGHT, BALL)
    means = [
        drpt.render(scene, 256, k, mode).image.mean() for k in (0, 1, 2, UNROLLED_VERTICES + 1)
    ]
    assert means[0] < means[1] < means[2]
    assert (np.diff(means) >= -1e-7).all()  # the same samples, with something added
    assert np.diff(means)[-1] < 0.1 * np.diff(means)[0]


@pytest.mark.parametrize("height", [3.0, 0.3, 0.1001])
def test_direct_light_has_no_noise_where_a_diffuse_surface_sees_a_whole_light(
    height: float,
) -> None:
    """All samples are ρ L sin²σ cos ω, down to a light that almost rests on the floor."""
    distance = np.hypot(1, height)
    expected = 0.25 * (0.1 / distance) ** 2 * height / distance
    samples = floor_by_a_small_light(height)
    assert samples == pytest.approx(expected, rel=DIRECT)


def test_direct_light_has_noise_where_the_horizon_cuts_the_light() -> None:
    samples = floor_by_a_small_light(0.0999)
    assert samples.std() > 0.1 * samples.mean()


def floor_by_a_small_light(height: float) -> Floats:
    """Return samples of a point of a diffuse floor with a light aside."""
    camera = drpt.Camera((0, -1, 3), (0, 0, 0), (0, 1, 0), 1e-6, 1, 1)
    floor = drpt.Mesh(FLOOR.vertices, FLOOR.faces, material=drpt.Diffuse(0.25))
    scene = drpt.Scene(camera=camera, shapes=[floor, drpt.Sphere((1, 0, height), 0.1, radiance=1)])
    images = [
        drpt.render(scene, 1, 1, "explicit", sampler="independent", seed=seed, jitter=False).image
        for seed in range(64)
    ]
    return np.array(images, np.float64)


def test_rays_to_vertices_and_lights_are_counted() -> None:
    """A floor that fills the picture, a light that is seen from all of it, nothing else."""
    camera = drpt.Camera((0, -0.1, 1), (0, 0, 0), (0, 1, 0), 20, 8, 8)
    scene = drpt.Scene(camera=camera, shapes=[FLOOR, LIGHT])
    paths = 64 * 10
    rays = {mode: drpt.render(scene, 10, 1, mode).rays for mode in map(str, MODES)}
    assert rays["explicit"] == 2 * paths
    assert paths < rays["implicit"] <= 2 * paths
    assert paths < rays["explicit-uniform"] < 2 * paths  # points on the back of the light
    assert rays["mis"] == rays["implicit"] + paths
    assert drpt.render(scene, 10, 0, "mis").rays == paths


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
def test_a_light_ends_paths(mode: str) -> None:
    """What is behind a light, or inside one, gets nothing and gives nothing."""
    hidden = drpt.Sphere(LIGHT.center, 0.4, material=drpt.Diffuse(1))
    plain = measure_to(0.02, scene_of(FLOOR, LIGHT), 2, mode)
    assert_agree(measure_to(0.02, scene_of(FLOOR, LIGHT, hidden), 2, mode, seed=3), plain, 0.03)


@pytest.mark.parametrize("mode", MODES)
def test_a_triangle_light_is_dark_from_behind(mode: str) -> None:
    turned = drpt.Mesh(PANEL.vertices, np.fliplr(PANEL.faces), radiance=PANEL.radiance)
    wall = drpt.Mesh([[-3, -3, 0], [-3, 3, 0], [-3, 0, 4]], [[0, 1, 2]], material=drpt.Diffuse(0.5))
    seen = [
        drpt.render(scene_of(wall, panel), 64, 1, mode).image.sum() for panel in (PANEL, turned)
    ]
    assert min(seen) == 0 < max(seen)


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
def test_surfaces_reflect_on_both_sides(mode: str) -> None:
    flipped = drpt.Mesh(FLOOR.vertices, np.fliplr(FLOOR.faces), material=FLOOR.material)
    a = measure_to(0.02, scene_of(FLOOR, LIGHT), 1, mode)
    assert_agree(measure_to(0.02, scene_of(flipped, LIGHT), 1, mode, seed=3), a, 0.03)


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
def test_the_loop_continues_what_is_unrolled(mode: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = scene_of(FLOOR, LIGHT, BALL, PANEL)
    unrolled = drpt.render(scene, 16, 3, mode)
    monkeypatch.setattr("drpt.kernel.integrators.path.UNROLLED_VERTICES", 1)
    looped = drpt.render(scene, 16, 3, mode)
    assert looped.image == pytest.approx(unrolled.image, rel=1e-4, abs=1e-5)
