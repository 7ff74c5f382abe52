"""Streaming mean and variance against NumPy's."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from drpt.film import Film

if TYPE_CHECKING:
    from tests.oracle.arrays import Floats

ROUNDING = 1e-12  # of float64
PIXELS = 7


def passes(counts: list[int], seed: int = 0) -> list[Floats]:
    """Samples (count, pixels, 3) of each pass."""
    rng = np.random.default_rng(seed)
    return [rng.lognormal(0, 1, (count, PIXELS, 3)) for count in counts]


def film_of(samples: list[Floats], parts: list[range] | None = None) -> Film:
    film = Film(PIXELS)
    for values in samples:
        for part in parts or [range(PIXELS)]:
            sums = values.sum(axis=0)[part.start : part.stop]
            film.add(part, sums, len(values))
    return film


def test_an_empty_film_is_black_and_knows_no_variance() -> None:
    film = Film(PIXELS)
    assert film.passes == 0
    assert not film.mean.any()
    assert film.mean.shape == (PIXELS, 3)
    assert np.isnan(film.variance).all()


@pytest.mark.parametrize("counts", [[5], [4, 4, 4], [8, 8, 3], [1, 1]])
def test_mean_is_that_of_all_samples(counts: list[int]) -> None:
    samples = passes(counts)
    film = film_of(samples)
    assert film.passes == len(counts)
    assert film.mean == pytest.approx(np.concatenate(samples).mean(axis=0), rel=ROUNDING)


def test_one_pass_tells_no_variance() -> None:
    assert np.isnan(film_of(passes([4])).variance).all()


def test_variance_of_equal_passes_is_that_of_their_means() -> None:
    samples = passes([16] * 5)
    means = np.array([values.mean(axis=0) for values in samples])
    expected = means.var(axis=0, ddof=1) / len(means)
    assert film_of(samples).variance == pytest.approx(expected, rel=ROUNDING)


def test_variance_weighs_passes_by_their_samples() -> None:
    counts = [8, 8, 2]
    samples = passes(counts)
    means = np.array([values.mean(axis=0) for values in samples])
    mean = np.average(means, axis=0, weights=counts)
    spread = np.average((means - mean) ** 2, axis=0, weights=counts)
    assert film_of(samples).variance == pytest.approx(spread / (len(counts) - 1), rel=ROUNDING)


def test_variance_is_unbiased_over_many_films() -> None:
    """Each estimate is as noisy as 7 degrees of freedom make it; their mean is known to 2 %."""
    estimates = np.array([film_of(passes([4] * 8, seed)).variance for seed in range(600)])
    truth = (np.exp(1) - 1) * np.exp(1) / 32  # of a log-normal value, over 32 samples
    assert estimates.mean() == pytest.approx(truth, rel=0.1)


def test_parts_add_up_to_the_same_bits() -> None:
    samples = passes([4, 4, 2])
    whole, parts = film_of(samples), film_of(samples, [range(3), range(3, 4), range(4, PIXELS)])
    assert np.array_equal(whole.mean, parts.mean)
    assert np.array_equal(whole.variance, parts.variance)
    assert parts.passes == 3


def test_a_pass_counts_once_all_its_parts_are_there() -> None:
    film = Film(PIXELS)
    film.add(range(3), np.ones((3, 3)), 1)
    assert film.passes == 0
    assert film.mean[:3].tolist() == [[1, 1, 1]] * 3
    film.add(range(3, PIXELS), np.ones((PIXELS - 3, 3)), 1)
    assert film.passes == 1


def test_many_equal_passes_stay_exact() -> None:
    film = Film(1)
    for _ in range(10_000):
        film.add(range(1), np.full((1, 3), 0.1 * 1024), 1024)
    assert film.mean == pytest.approx(0.1, rel=ROUNDING)
    assert film.variance == pytest.approx(0, abs=1e-25)


def test_values_that_are_not_finite_show() -> None:
    film = film_of(passes([2]))
    film.add(range(PIXELS), np.full((PIXELS, 3), np.inf), 2)
    assert not np.isfinite(film.mean).any()
