from collections.abc import Callable

import numpy as np
import pytest

from drpt import Camera, Diffuse, Scene, Sphere, render
from drpt.crosscheck import Estimate, measure, reference
from drpt.crosscheck.estimate import FILM_SPP, PASSES
from tests.oracle.statistics import assert_means_agree

SPP = 64 * PASSES
SPREAD = 0.11  # relative: 5 σ of the mean of 64 variances of 63 degrees of freedom each
SIGNIFICANCE = 1e-4

RENDERERS = [measure, reference]


@pytest.fixture
def scene() -> Scene:
    """A light of radiance 1, whose edge crosses many pixels."""
    camera = Camera((0, 0, 4), (0, 0, 0), (0, 1, 0), 40, 32, 32)
    return Scene(camera, [Sphere((0, 0, 0), 1, radiance=1)])


def independent(scene: Scene, spp: int, bounces: int, seed: int = 0) -> Estimate:
    return measure(scene, spp, bounces, sampler="independent", seed=seed)


@pytest.mark.parametrize("renderer", [independent, reference])
def test_variance_is_the_binomial_one(scene: Scene, renderer: Callable[..., Estimate]) -> None:
    estimate = renderer(scene, SPP, 0)
    assert estimate.mean.dtype == estimate.variance.dtype == np.float64
    assert (estimate.passes, estimate.spp) == (PASSES, SPP)
    mean = estimate.mean[..., 0]
    edge = (mean > 0.05) & (mean < 0.95)
    ratio = estimate.variance[edge, 0] / (mean * (1 - mean) / SPP)[edge]
    assert ratio.mean() == pytest.approx(1, rel=SPREAD)


def test_sobol_points_have_less(scene: Scene) -> None:
    ours, theirs = (f(scene, SPP, 0).variance.sum() for f in (measure, independent))
    assert ours < theirs / 4


def test_the_mean_is_that_of_a_render(scene: Scene) -> None:
    shapes = [*scene.shapes, Sphere((1.5, 0, 0.5), 0.5, Diffuse(0.5))]
    lit = Scene(scene.camera, shapes)
    estimate = measure(lit, SPP, 1)
    picture = render(lit, SPP, 1, seed=12345).image
    mean = estimate.mean.mean(axis=(0, 1))
    error = np.sqrt(estimate.variance.sum(axis=(0, 1))) / 32**2
    assert_means_agree(mean, error, picture.mean(axis=(0, 1)), error, SIGNIFICANCE)


@pytest.mark.parametrize("renderer", RENDERERS)
def test_seeds_give_other_noise(scene: Scene, renderer: Callable[..., Estimate]) -> None:
    first, again, second = (renderer(scene, PASSES, 0, seed=seed).mean for seed in (0, 0, 1))
    assert (first == again).all()
    assert (first != second).any()


@pytest.mark.parametrize("renderer", RENDERERS)
def test_passes_are_told(scene: Scene, renderer: Callable[..., Estimate]) -> None:
    told: list[int] = []
    renderer(scene, PASSES, 0, on_pass=told.append)
    assert told == list(range(1, PASSES + 1))


def test_a_long_pass_is_not_added_up_in_float32() -> None:
    camera = Camera((0, 0, 4), (0, 0, 0), (0, 1, 0), 1, 2, 2)
    scene = Scene(camera, [Sphere((0, 0, 0), 1, radiance=0.1)])
    estimate = reference(scene, 16 * FILM_SPP * PASSES, 0)
    np.testing.assert_allclose(estimate.mean, 0.1, rtol=5e-6)  # 256 terms; 4096 are 4e-5 off


@pytest.mark.parametrize("renderer", RENDERERS)
@pytest.mark.parametrize("spp", [0, 8, 100, 64.0, True, 2**31])
def test_samples_must_divide_into_passes(
    scene: Scene, renderer: Callable[..., Estimate], spp: int
) -> None:
    with pytest.raises(ValueError, match=f"spp: {spp} is not allowed; it must be a multiple"):
        renderer(scene, spp)
