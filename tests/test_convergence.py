"""How fast variance falls, in the picture and in its parts."""

from __future__ import annotations

import numpy as np
import pytest

from drpt.convergence import EDGE, INDEPENDENT, combined, fall, local_ratios, ratio

SHAPE = 64, 64, 3
NOWHERE = np.zeros(SHAPE[:2], bool)
# A sum over 2048 pixels, with one and two degrees of freedom each, has a ratio within 4 %; twice.
SCATTER = 0.08


def squares(ratios: np.ndarray, scale: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Differences of runs and of their halves (height, width, 3), for ρ of pixels."""
    rng = np.random.default_rng(0)
    coarse = scale * rng.chisquare(1, SHAPE)
    return coarse, scale * ratios * rng.chisquare(2, SHAPE) / 2


def test_the_ratio_of_a_picture() -> None:
    for true in (2.0, 2.8, 6.0):
        assert ratio(*squares(np.full(SHAPE, true), np.ones(SHAPE))) == pytest.approx(
            true, rel=0.05
        )


def test_places_of_one_noise_have_their_own_ratios() -> None:
    true = np.where(np.arange(64) < 32, 2.2, 4.0)[None, :, None] * np.ones(SHAPE)
    found = local_ratios(*squares(true, np.ones(SHAPE)), 3.0, NOWHERE)
    assert found[:, :32].mean() == pytest.approx(2.2, rel=2 * SCATTER)  # in steps of tiles
    assert found[:, 32:].mean() == pytest.approx(4.0, rel=2 * SCATTER)


def test_levels_of_noise_have_their_own_ratios() -> None:
    """Every eighth pixel has 10⁴ times the noise, as the edges of lights have."""
    loud = (np.arange(64) % 8 == 0)[None, :, None] & np.ones(SHAPE, bool)
    found = local_ratios(*squares(np.where(loud, 4.0, 2.2), np.where(loud, 1e4, 1.0)), 2.5, NOWHERE)
    assert found[loud[..., 0]].mean() == pytest.approx(4.0, rel=2 * SCATTER)
    assert found[~loud[..., 0]].mean() == pytest.approx(2.2, rel=SCATTER)


def test_pixels_of_lights_have_their_own_ratios() -> None:
    """Of the same noise, in the same tiles."""
    lights = (np.arange(64) % 2 == 0)[None, :] & np.ones(SHAPE[:2], bool)
    true = np.where(lights, 4.0, 2.2)[..., None] * np.ones(SHAPE)
    found = local_ratios(*squares(true, np.ones(SHAPE)), 2.2, lights)
    assert found[lights].mean() == pytest.approx(4.0, rel=2 * SCATTER)
    assert found[~lights].mean() == pytest.approx(2.2, rel=SCATTER)


def test_a_single_pixel_of_a_light_is_near_the_theory() -> None:
    """Its own differences, which say 8, weigh as one pixel, the theory as three."""
    lights = np.zeros(SHAPE[:2], bool)
    lights[20, 20] = True
    coarse, fine = squares(np.full(SHAPE, 2.2), np.ones(SHAPE))
    noise = (1 + 2 * 8 / EDGE) / 3
    coarse[20, 20], fine[20, 20] = [1 / noise / 3], [8 / noise / 3]  # of noise 1, one level
    expected = (8 / noise + 3 * EDGE) / (1 / noise + 3)
    assert local_ratios(coarse, fine, 3.0, lights)[20, 20] == pytest.approx(expected)


def test_without_noise_it_is_that_of_the_picture() -> None:
    assert (local_ratios(np.zeros(SHAPE), np.zeros(SHAPE), 3.0, NOWHERE) == 3.0).all()
    assert ratio(np.zeros(SHAPE), np.zeros(SHAPE)) == INDEPENDENT


def test_both_sizes_tell_the_same() -> None:
    coarse, fine = squares(np.full(SHAPE, 3.0), np.ones(SHAPE))
    assert combined(coarse, fine, 3.0).mean() == pytest.approx(1, rel=SCATTER)


@pytest.mark.parametrize(("growth", "expected"), [(1.0, 1.0), (1.5, 1 / 1.5)])
def test_independent_samples_fall_as_their_number(growth: float, expected: float) -> None:
    assert fall(growth, INDEPENDENT) == pytest.approx(expected)
