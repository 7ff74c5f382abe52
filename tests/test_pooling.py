"""Variances of pixels, pooled with those of neighbours that are as noisy."""

from __future__ import annotations

import numpy as np
import pytest

from drpt import pooling
from drpt.pooling import pooled

SHAPE = 40, 30, 3
DEGREES_OF_FREEDOM = 3  # of the variances of pixels, as a picture has them
FLOAT32 = 1e-5  # relative, of sums of a thousand values
# A mean of 3600 variances with 3 degrees of freedom is within 2.4 % of its expectation; four times.
SCATTER = 0.1


def noisy(true: float, seed: int = 0) -> np.ndarray:
    """Estimated variances of pixels that have a true one."""
    rng = np.random.default_rng(seed)
    return true * rng.chisquare(DEGREES_OF_FREEDOM, SHAPE) / DEGREES_OF_FREEDOM


IMAGE = np.ones(SHAPE)
NOWHERE = np.zeros(SHAPE[:2], bool)


def test_the_sum_is_kept() -> None:
    variances = noisy(1) * np.random.default_rng(1).lognormal(sigma=3, size=SHAPE)
    assert pooled(variances, IMAGE, NOWHERE).sum() == pytest.approx(variances.sum(), rel=FLOAT32)


def test_like_pixels_share_their_variance() -> None:
    variances = noisy(1)
    assert pooled(variances, IMAGE, NOWHERE).std() < 0.2 * variances.std()


def test_a_loud_place_stays_apart_from_a_quiet_one() -> None:
    """An edge with 10⁴ times the variance, a pixel wide, between quiet pixels."""
    variances = noisy(1)
    variances[:, 15] *= 1e4
    found = pooled(variances, IMAGE, NOWHERE)
    beside = [13, 14, 16, 17]
    assert found[:, 15].mean() == pytest.approx(variances[:, 15].mean(), rel=1e-3)
    assert found[:, beside].mean() == pytest.approx(1, rel=SCATTER)


def test_pixels_of_a_light_share_nothing_with_others() -> None:
    """Twice the variance alone would be similar enough."""
    lights = np.zeros(SHAPE[:2], bool)
    lights[10:20, 10:20] = True
    variances = noisy(1) * np.where(lights, 2, 1)[..., None]
    found = pooled(variances, IMAGE, lights)
    for where in (lights, ~lights):
        assert found[where].sum() == pytest.approx(variances[where].sum(), rel=FLOAT32)
        assert found[where].std() < 0.3 * variances[where].std()


def test_pixels_of_other_brightness_share_little() -> None:
    """Of an edge from 1 to 100, pixels with 3 times the variance stay apart."""
    image, variances = np.ones(SHAPE), noisy(1)
    image[:, 15:] = 100
    variances[:, 15:] *= 3
    found = pooled(variances, image, NOWHERE)
    assert found[:, :15].sum() == pytest.approx(variances[:, :15].sum(), rel=1e-3)
    assert found[:, :15].std() < 0.2 * variances[:, :15].std()


@pytest.mark.parametrize("rounding", [0.0, 1e-14])
def test_a_pixel_without_noise_stays_so(rounding: float) -> None:
    """All samples are equal, but for what float32 rounds."""
    variances = noisy(1)
    variances[10:20, 10:20] = rounding
    variances[30, 20, 1] = rounding
    found = pooled(variances, IMAGE, NOWHERE)
    assert (np.sqrt(found[10:20, 10:20]) <= 1e-6).all()
    assert np.sqrt(found[30, 20, 1]) <= 1e-6
    assert (found[30, 20, [0, 2]] > 0).all()


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e60])
@pytest.mark.parametrize("bright", [1.0, np.nan, np.inf, 1e38])
def test_what_is_not_finite_stays_where_it_is(value: float, bright: float) -> None:
    variances, image = noisy(1), IMAGE.copy()
    variances[20, 10], image[20, 10] = value, bright
    found = pooled(variances, image, NOWHERE)
    assert not np.isfinite(found[20, 10]).any()
    others = np.ones(SHAPE[:2], bool)
    others[20, 10] = False
    assert found[others].sum() == pytest.approx(variances[others].sum(), rel=FLOAT32)


def test_strips_are_seamless(monkeypatch: pytest.MonkeyPatch) -> None:
    variances = noisy(1)
    whole = pooled(variances, IMAGE, NOWHERE)
    monkeypatch.setattr(pooling, "STRIP", 15 * SHAPE[1])
    np.testing.assert_allclose(pooled(variances, IMAGE, NOWHERE), whole, rtol=FLOAT32)


@pytest.mark.parametrize("shape", [(1, 1, 3), (1, 5, 3), (2, 1, 3), (3, 2, 3)])
def test_the_smallest_pictures(shape: tuple[int, int, int]) -> None:
    nowhere = np.zeros(shape[:2], bool)
    assert pooled(np.ones(shape), np.ones(shape), nowhere) == pytest.approx(np.ones(shape))
