from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from drpt.crosscheck import Comparison, Estimate, compare
from drpt.crosscheck.compare import POWER, SIGNIFICANCE, of_any, sidak
from drpt.crosscheck.estimate import PASSES

if TYPE_CHECKING:
    from tests.oracle.arrays import Floats

SHAPE = 24, 20, 3  # no powers of two: the last blocks are smaller
TRIALS = 200
FALSE_ALARMS = 4  # of as many trials at 2 SIGNIFICANCE each: more with a probability of 6e-5
MISSES = 22  # of as many trials at 1 − POWER: more with a probability of 2e-4
NOISE = 0.1  # of a pass, relative to the mean


def estimate(passes: Floats, spp: int = PASSES) -> Estimate:
    mean = passes.mean(axis=0)
    return Estimate(mean, passes.var(axis=0, ddof=1) / len(passes), len(passes), spp)


def normal(seed: int, mean: Floats | float = 1.0, noise: float = NOISE) -> Estimate:
    rng = np.random.default_rng(seed)
    return estimate(mean * (1 + noise * rng.normal(size=(PASSES, *SHAPE))))


def exact(mean: Floats | float) -> Estimate:
    return Estimate(np.broadcast_to(mean, SHAPE) * 1.0, np.zeros(SHAPE), 0, 0)


def with_mean(image: Estimate, where: tuple[int, ...], value: float) -> Estimate:
    mean = image.mean.copy()
    mean[where] = value
    return replace(image, mean=mean)


def test_equal_expectations_pass() -> None:
    comparisons = [compare(normal(2 * i), normal(2 * i + 1)) for i in range(TRIALS)]
    assert sum(not c.passed for c in comparisons) <= FALSE_ALARMS
    p_values = [c.of_image.p_value for c in comparisons]
    assert 0.4 < np.mean(p_values) < 0.6


def disk(radius: float) -> Floats:
    """How much of each pixel a disk covers, (height, width, 1)."""
    fine = 100
    y, x = ((np.arange(n * fine) + 0.5) / fine - n / 2 for n in SHAPE[:2])
    inside = (x**2 + y[:, None] ** 2 < radius**2).astype(float)
    cover = inside.reshape(SHAPE[0], fine, SHAPE[1], fine).mean(axis=(1, 3))
    return np.asarray(cover[..., None])


@pytest.mark.parametrize("spp", [256, 4096])
def test_a_lights_edge_raises_no_alarm(spp: int) -> None:
    """Pixels at the edge of a light of radiance 100, some of which it is missed in."""
    rng = np.random.default_rng(spp)
    covers = [disk(radius) for radius in rng.uniform(2, 9, TRIALS // 10)]

    def picture(cover: Floats, spp: int) -> Estimate:
        per_pass = spp // PASSES
        hits = rng.binomial(per_pass, cover, size=(PASSES, *SHAPE[:2], 1)) / per_pass
        return estimate(0.3 + 100 * hits + 0.01 * rng.normal(size=(PASSES, *SHAPE)), spp)

    comparisons = [compare(picture(cover, spp), picture(cover, 65536)) for cover in covers]
    assert all(c.passed for c in comparisons)


def test_fireflies_raise_no_alarm() -> None:
    """An estimator of the same mean, half of which comes in one of 1000 samples."""
    rng = np.random.default_rng(1)

    def picture() -> Estimate:
        hits = rng.binomial(4, 1e-3, size=(PASSES, *SHAPE)) / 4
        return estimate(0.5 + 500 * hits, 4 * PASSES)

    comparisons = [compare(picture(), normal(i)) for i in range(TRIALS // 10)]
    assert all(c.passed for c in comparisons)


def test_what_is_called_detectable_is_detected() -> None:
    missed = 0
    for trial in range(TRIALS):
        right, wrong = normal(2 * trial), normal(2 * trial + 1)
        bias = compare(wrong, right).of_image.detectable
        shifted = replace(wrong, mean=wrong.mean + bias * [1, 0, 0])
        missed += compare(shifted, right).of_image.passed
    assert missed <= MISSES
    assert missed / TRIALS > (1 - POWER) / 5


def test_a_shift_of_all_pixels_shows_in_the_means_first() -> None:
    shifted = compare(normal(0, 1.005), normal(1))
    assert not shifted.of_image.passed
    assert shifted.of_blocks.passing > 0.5
    assert np.all(shifted.of_image.difference > 0)


def test_a_wrong_pixel_shows_in_the_blocks() -> None:
    wrong = compare(with_mean(normal(0), (5, 7, 1), 1.2), normal(1))
    assert wrong.of_image.passed
    assert not wrong.of_blocks.passed
    worst = wrong.of_blocks.worst
    assert worst is not None
    assert worst[:4] == (7, 5, 1, 1)
    assert str(worst).startswith("pixel (7, 5), G: 1.2 against ")
    assert np.argwhere(wrong.of_blocks.p_map < 1e-8).tolist() == [[5, 7]]
    assert 1 - wrong.of_blocks.passing == pytest.approx(1 / (SHAPE[0] * SHAPE[1]))


def test_opposite_errors_show_in_the_blocks() -> None:
    tilt = np.linspace(0.98, 1.02, SHAPE[1])[None, :, None]
    tilted = compare(normal(0, tilt), normal(1))
    assert tilted.of_image.passed
    assert not tilted.of_blocks.passed
    worst = tilted.of_blocks.worst
    assert worst is not None
    assert worst.side > 1
    assert f"{worst.side}x{worst.side} pixels from" in str(worst)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_what_is_not_finite_fails(value: float) -> None:
    wrong = compare(with_mean(normal(0), (0, 0, 0), value), normal(1), min_samples=10**6)
    assert wrong.of_image.p_value == wrong.of_blocks.p_value == 0
    assert not wrong.of_image.passed
    assert not wrong.of_blocks.passed


def test_a_missing_light_fails() -> None:
    assert not compare(exact_passes(0), normal(1)).passed
    half = np.where(np.arange(SHAPE[1])[None, :, None] < 10, 1.0, 0.0)
    assert not compare(exact_passes(half), normal(1)).of_blocks.passed


def test_black_is_black() -> None:
    black = compare(exact_passes(0), exact(0))
    assert black.passed
    assert black.of_blocks.worst is None
    assert (black.of_blocks.comparisons, black.of_blocks.passing) == (0, 1)


def exact_passes(mean: Floats | float) -> Estimate:
    return replace(exact(mean), passes=PASSES, spp=PASSES)


def test_certain_values_may_differ_by_roundings() -> None:
    assert compare(exact_passes(1 + 5e-7), exact(1)).passed
    wrong = compare(exact_passes(1 + 5e-6), exact(1))
    assert not wrong.passed
    assert wrong.of_blocks.worst is not None
    assert wrong.of_blocks.worst.errors == np.inf


def test_a_tolerance_is_not_held_against_the_image() -> None:
    assert not compare(normal(0, 1.01), normal(1)).passed
    tolerant = compare(normal(0, 1.01), normal(1), tolerance=0.01)
    assert tolerant.passed
    assert (tolerant.of_image.detectable > 0.01).all()
    assert compare(normal(0, 2), normal(1), tolerance=np.inf).passed


def test_edges_are_left_out_of_the_means_alone() -> None:
    edges = np.zeros(SHAPE[:2], np.bool_)
    edges[3] = True
    wrong = with_mean(normal(0), (3,), 2.0)
    comparison = compare(wrong, normal(1), edges=edges)
    assert comparison.of_image.passed
    assert not comparison.of_blocks.passed


def test_noise_is_judged_by_larger_blocks() -> None:
    sides = [compare(normal(0, noise=n), normal(1)).of_blocks.side for n in (0.1, 0.6, 2.4)]
    assert sides == [1, 2, 8]
    assert compare(normal(0, noise=100), normal(1)).of_blocks.comparisons == 0


def test_images_must_be_comparable() -> None:
    other = Estimate(np.ones((4, 5, 3)), np.ones((4, 5, 3)), PASSES, PASSES)
    with pytest.raises(ValueError, match="its size is 5x4, and the image's is 20x24"):
        compare(normal(0), other)
    with pytest.raises(ValueError, match="it must have two passes at least"):
        compare(exact(1), normal(0))


@pytest.mark.parametrize("comparisons", [1, 3, 10**6])
@pytest.mark.parametrize("significance", [1e-12, SIGNIFICANCE, 0.5])
def test_of_any_undoes_sidak(significance: float, comparisons: int) -> None:
    each = sidak(significance, comparisons)
    assert each == pytest.approx(significance / comparisons, rel=0.4)
    assert of_any(each, comparisons) == pytest.approx(significance)


def test_a_comparison_says_which_test_failed() -> None:
    comparison: Comparison = compare(normal(0, 1.05), normal(1))
    assert not comparison.of_image.passed
    assert not comparison.passed


def test_rare_samples_must_have_been_drawn() -> None:
    """A block of 16 pixels has 1024 samples, 64 each."""
    dark = compare(normal(0, 0.9), normal(1), min_samples=1000)
    assert not dark.of_image.passed
    assert dark.of_blocks.side == 4
    unknown = compare(normal(0, 0.9), normal(1), min_samples=10**6)
    assert unknown.passed
    assert not unknown.of_image.resolved
    assert unknown.of_blocks.comparisons == 0


def test_light_in_the_dark_fails() -> None:
    """The reference is black on the left, and the image has a bright pixel there."""
    half = np.where(np.arange(SHAPE[1])[None, :, None] < 10, 0.0, 1.0)
    right = compare(normal(0, half), normal(1, half))
    assert right.passed
    wrong = compare(with_mean(normal(0, half), (5, 3, 0), 0.1), normal(1, half))
    assert not wrong.of_blocks.passed
    assert wrong.of_blocks.worst is not None
    assert wrong.of_blocks.worst[:4] == (3, 5, 1, 0)


def test_edges_count_where_all_else_is_black() -> None:
    edges = np.ones(SHAPE[:2], np.bool_)
    wrong = compare(normal(0, 1.05), normal(1), edges=edges)
    assert not wrong.of_image.passed
    edges[0] = False
    lit = normal(1, np.where(edges, 1.0, 0.0)[..., None])
    assert compare(lit, lit, edges=edges).of_image.pixels == SHAPE[0] * SHAPE[1]
