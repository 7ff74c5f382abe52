import numpy as np
import pytest

from drpt import Camera, Scene, Sphere
from drpt.crosscheck import reference

SPP = 4096
SPREAD = 0.23  # relative: 5 σ of the mean of 64 variances of 15 degrees of freedom each


@pytest.fixture
def scene() -> Scene:
    """A light of radiance 1, whose edge crosses many pixels."""
    camera = Camera((0, 0, 4), (0, 0, 0), (0, 1, 0), 40, 32, 32)
    return Scene(camera, [Sphere((0, 0, 0), 1, radiance=1)])


def test_standard_error_is_the_binomial_one(scene: Scene) -> None:
    mean, standard_error = reference(scene, SPP, 0)
    assert mean.dtype == standard_error.dtype == np.float64
    edge = (mean[..., 0] > 0.05) & (mean[..., 0] < 0.95)
    variance = mean * (1 - mean) / SPP
    ratio = standard_error[edge, 0] ** 2 / variance[edge, 0]
    assert ratio.mean() == pytest.approx(1, rel=SPREAD)


def test_seeds_give_other_noise(scene: Scene) -> None:
    first, second = (reference(scene, 16, 0, seed)[0] for seed in (0, 1))
    assert (first != second).any()


@pytest.mark.parametrize("spp", [0, 8, 100])
def test_samples_must_divide_into_passes(scene: Scene, spp: int) -> None:
    with pytest.raises(ValueError, match=f"spp: {spp} is not allowed"):
        reference(scene, spp)
