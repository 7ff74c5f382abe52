"""Sums of samples and of blocks of them, against NumPy's."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from drpt.film import BLOCKS, Film

if TYPE_CHECKING:
    from tests.oracle.arrays import Floats

ROUNDING = 1e-12  # of float64
SINGLE = 1e-6  # of float32 sums of few runs
DRIFT = 1e-4  # of float32 sums of a thousand passes; far below the noise of what they hold
PIXELS = 7


def random_samples(count: int, seed: int = 0) -> Floats:
    """Samples (count, pixels, 3)."""
    return np.random.default_rng(seed).lognormal(0, 1, (count, PIXELS, 3))


def sums_of(samples: Floats, run: int) -> Floats:
    """Sums of runs of samples."""
    return np.add.reduceat(samples, np.arange(0, len(samples), run), axis=0)


def expose(
    film: Film,
    samples: Floats,
    passes: list[tuple[int, int]],
    parts: tuple[range, ...] = (range(PIXELS),),
) -> Film:
    """Add the samples that follow in passes of (samples, run), each in parts of some pixels."""
    for count, run in passes:
        numbers = range(film.samples, film.samples + count)
        sums = sums_of(samples[numbers.start : numbers.stop], run)
        for part in parts:
            film.add(part, sums[:, part.start : part.stop], numbers, run)
    return film


def test_an_empty_film_is_black_and_has_no_blocks() -> None:
    film = Film(PIXELS)
    assert (film.samples, film.ahead) == (0, 0)
    assert film.mean.shape == (PIXELS, 3)
    assert not film.mean.any()
    assert film.leading_blocks.shape == (0, PIXELS, 3)


@pytest.mark.parametrize("blocks", [True, False])
@pytest.mark.parametrize("passes", [[(5, 1)], [(4, 2)] * 3, [(8, 4), (8, 4), (3, 1)], [(64, 8)]])
def test_mean_is_that_of_all_samples(passes: list[tuple[int, int]], blocks: bool) -> None:
    count = sum(n for n, _ in passes)
    samples = random_samples(count)
    film = expose(Film(PIXELS, blocks=blocks), samples, passes)
    assert film.samples == count
    assert film.mean == pytest.approx(samples.mean(axis=0), rel=ROUNDING)


@pytest.mark.parametrize("count", [*range(2, 40), 64, 100, 127, 128, 1000])
@pytest.mark.parametrize(("every", "run"), [(1, 1), (4, 2), (16, 16), (16, 4)])
def test_leading_blocks_are_the_first_samples_in_equal_runs(
    count: int, every: int, run: int
) -> None:
    samples = random_samples(count)
    passes = [(min(every, count - start), run) for start in range(0, count, every)]
    film = expose(Film(PIXELS), samples, passes)
    blocks = film.leading_blocks
    if count < 2 * run:
        assert len(blocks) == 0
        return
    assert film.size.bit_count() == 1
    assert len(blocks) == (4 if count >= 4 * run else 2)
    covered = len(blocks) * film.size
    assert covered <= count < 2 * covered
    assert blocks.dtype == np.float32
    assert blocks == pytest.approx(sums_of(samples[:covered], film.size), rel=SINGLE)


@pytest.mark.parametrize("passes", [[(16, 16)], [(16, 2), (16, 4), (32, 8), (64, 64), (37, 4)]])
def test_runs_of_growing_passes_are_joined(passes: list[tuple[int, int]]) -> None:
    samples = random_samples(sum(n for n, _ in passes))
    film = expose(Film(PIXELS), samples, passes)
    covered = len(film.leading_blocks) * film.size
    assert film.leading_blocks == pytest.approx(sums_of(samples[:covered], film.size), rel=SINGLE)
    assert film.size >= max(run for _, run in passes)
    assert len(samples) < 2 * covered or not covered


def test_half_of_the_blocks_or_more_are_full() -> None:
    film, samples = Film(PIXELS), random_samples(1000)
    expose(film, samples, [(BLOCKS // 2, 1)])
    while film.samples < len(samples) - 3:
        expose(film, samples, [(3, 1)])
        assert BLOCKS // 2 <= film.samples // film.size < BLOCKS


def test_no_blocks_are_kept_where_none_are_wanted() -> None:
    film = expose(Film(PIXELS, blocks=False), random_samples(64), [(16, 1)] * 4)
    assert film.leading_blocks.shape == (0, PIXELS, 3)
    assert film.state["blocks"].size == 0


PARTS = (range(3), range(3, 4), range(4, PIXELS))


def test_parts_add_up_to_the_same_bits() -> None:
    samples, passes = random_samples(90), [(16, 2), (16, 2), (32, 4), (26, 4)]
    whole = expose(Film(PIXELS), samples, passes)
    parts = expose(Film(PIXELS), samples, passes, PARTS)
    assert np.array_equal(whole.mean, parts.mean)
    assert np.array_equal(whole.leading_blocks, parts.leading_blocks)
    assert (parts.samples, parts.size) == (whole.samples, whole.size) == (90, 16)


def test_a_pass_counts_once_all_its_parts_are_there() -> None:
    samples = random_samples(32)
    film = expose(Film(PIXELS), samples, [(8, 1)])
    sums = sums_of(samples[8:], 4)
    film.add(range(3), sums[:, :3], range(8, 32), 4)
    assert (film.samples, film.ahead) == (8, 3)
    assert film.mean[:3] == pytest.approx(samples[:, :3].mean(axis=0), rel=ROUNDING)
    assert film.mean[3:] == pytest.approx(samples[:8, 3:].mean(axis=0), rel=ROUNDING)
    assert len(film.leading_blocks) == 0
    film.add(range(3, PIXELS), sums[:, 3:], range(8, 32), 4)
    assert (film.samples, film.ahead) == (32, 0)
    assert len(film.leading_blocks) == 4
    assert film.mean == pytest.approx(samples.mean(axis=0), rel=ROUNDING)


@pytest.mark.parametrize("blocks", [True, False])
@pytest.mark.parametrize("before", [1, 3, 16, 48])
def test_a_restored_film_goes_on_with_the_same_bits(before: int, blocks: bool) -> None:
    samples = random_samples(before + 200)
    film = expose(Film(PIXELS, blocks=blocks), samples, [(before, 1)])
    copy = Film(PIXELS, blocks=blocks)
    state: dict[str, Any] = film.state
    copy.restore(**state, samples=film.samples, size=film.size)
    for later in ([], [(30, 2)], [(170, 8)]):
        assert np.array_equal(expose(copy, samples, later).mean, expose(film, samples, later).mean)
        assert np.array_equal(copy.leading_blocks, film.leading_blocks)
        assert (copy.samples, copy.size) == (film.samples, film.size)


def test_many_equal_passes_stay_exact() -> None:
    film = Film(1)
    for k in range(10_000):
        film.add(range(1), np.full((1, 1, 3), 0.1 * 1024), range(1024 * k, 1024 * (k + 1)), 1024)
    assert film.mean == pytest.approx(0.1, rel=ROUNDING)
    assert film.leading_blocks == pytest.approx(0.1 * film.size, rel=DRIFT)


@pytest.mark.parametrize("value", [np.inf, np.nan])
def test_values_that_are_not_finite_show_in_their_pixel_alone(value: float) -> None:
    samples = random_samples(64)
    samples[40, 2] = value
    film = expose(Film(PIXELS), samples, [(16, 1)] * 4)
    for found in (film.mean, *film.leading_blocks):
        assert np.isfinite(np.delete(found, 2, axis=0)).all()
    assert not np.isfinite(film.mean[2]).any()
