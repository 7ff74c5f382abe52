"""Whether a guide is expected to reduce the noise."""

from __future__ import annotations

from random import Random
from typing import TYPE_CHECKING
from unittest.mock import patch

import numpy as np
import pytest
from scipy.stats import binom

import drpt
from drpt.kernel import launch
from drpt.kernel.guiding.directions import GuidedDirections
from drpt.kernel.guiding.pilot import WORTHWHILE, Pilot, best_shares, expected
from drpt.kernel.launch import make_launcher
from tests.conftest import TYPES
from tests.measuring import assert_agree, measure, with_picture
from tests.random_scenes import tame_scene

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from drpt.kernel.guiding.guide import Guide
    from tests.oracle.arrays import Floats

PIXELS, SAMPLES = 512, 256
CLOSE = 0.1
"""Relative tolerance of an expected ratio, from the noise of the samples."""
DETECTABLE = 0.01
PILOTS, CHANCE = 200, 1e-4
HALF = np.array([[0, 0, 0], [0, 0.5, 0.5]])
"""Shares: half of the directions from patches of row 1, with 1 or 2 vertices to come."""


def pilot_of(light: Floats, ratio: Floats) -> Pilot:
    """Paths that get light at their second vertex alone, all of them from patches of row 1."""
    return Pilot(
        np.stack([np.zeros_like(light), light]), ratio[None], np.ones((1, *ratio.shape), np.uint32)
    )


def quarter(pixels: int = PIXELS, seed: int = 0) -> NDArray[np.bool_]:
    """Whether each path goes where all light comes from, a quarter of the directions."""
    return np.random.default_rng(seed).random((pixels, SAMPLES)) < 0.25


def known(lit: NDArray[np.bool_]) -> Pilot:
    """A guide leads where the light comes from, always."""
    return pilot_of(lit.astype(float), np.where(lit, 4.0, 0))


def test_a_guide_that_knows_where_light_comes_from_pays() -> None:
    """It leads there always: half of the directions have 5/8 there, and weigh 1 / 2.5.

    With p = 1/4 the variance falls from p − p² to p / 2.5 − p², a fifth.
    """
    pilot = known(quarter())
    assert expected(pilot, HALF, 2).value == pytest.approx(0.2, rel=CLOSE)
    assert best_shares(pilot, HALF, 2) is not None


def test_a_guide_that_leads_elsewhere_does_not() -> None:
    """The chance of the light is halved: p / (1/2) − p², 7/3 of the variance."""
    lit = quarter()
    pilot = pilot_of(lit.astype(float), np.where(lit, 0, 4 / 3))
    assert expected(pilot, HALF, 2).value == pytest.approx(7 / 3, rel=CLOSE)
    assert best_shares(pilot, HALF, 2) is None


def test_a_gain_that_cannot_be_told_from_none_is_not_taken() -> None:
    """From few pixels the same gain is uncertain."""
    pilot = known(quarter(pixels=2, seed=3))
    found = expected(pilot, HALF, 2)
    assert found.value < WORTHWHILE < found.at_most
    assert best_shares(pilot, HALF, 2) is None


def test_an_estimate_is_below_the_upper_end_of_its_interval() -> None:
    """In all but 2.5 % of pilots."""
    found = [expected(known(quarter(pixels=128, seed=n)), HALF, 2) for n in range(PILOTS)]
    missed = sum(one.at_most < 0.2 for one in found)
    assert missed <= binom.isf(CHANCE, PILOTS, 0.025)
    spread = np.std([one.value for one in found], ddof=1)
    assert np.mean([one.error for one in found]) == pytest.approx(spread, rel=0.2)


@pytest.mark.parametrize("brightness", [2.0**-20, 2.0**20])
def test_the_brightness_of_the_lamps_decides_nothing(brightness: float) -> None:
    pilot = known(quarter())
    brighter = pilot._replace(light=brightness * pilot.light)
    assert expected(brighter, HALF, 2) == expected(pilot, HALF, 2)


def test_what_cannot_be_told_is_not_guided() -> None:
    for light in (0.0, np.nan, np.inf):
        pilot = pilot_of(np.full((4, 8), light), np.ones((4, 8)))
        assert best_shares(pilot, HALF, 2) is None


def guide_of(scene: drpt.Scene, bounces: int) -> Guide | None:
    made = make_launcher(TYPES, scene, bounces, drpt.Mode.GUIDED, "sobol", jitter=True)
    directions = made.tracer.directions
    return directions.guide if isinstance(directions, GuidedDirections) else None


def test_boxes_are_guided_and_a_mirror_on_a_floor_is_not() -> None:
    glossy = drpt.load_scene("cornell-box-glossy")
    assert guide_of(glossy, 3) is not None
    floor = [[-4, 0, -4], [-4, 0, 4], [4, 0, 4], [4, 0, -4]]
    scene = drpt.Scene(
        drpt.Camera((0, 3, 9), (0, 0.5, 0), (0, 1, 0), 40, 32, 32),
        [
            drpt.Mesh(floor, [[0, 1, 2], [0, 2, 3]], material=drpt.Diffuse(0.7)),
            drpt.Sphere((0, 3, 0), 0.5, radiance=20),
            drpt.Sphere((1.2, 1, 1), 1, drpt.Phong(0.85, 1000)),
        ],
    )
    assert guide_of(scene, 3) is None
    guided, mis = (drpt.render(scene, 4, 3, mode).image for mode in ("guided", "mis"))
    np.testing.assert_array_equal(guided, mis)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 6])
@pytest.mark.parametrize("bounces", [3, 7])
def test_guided_means_are_those_of_mis_where_a_guide_is_left_out(seed: int, bounces: int) -> None:
    """Vertices that stand one after the other in the kernel, and those of its loop."""
    scene = with_picture(tame_scene(Random(seed), 16), 16, 16)
    with patch.object(launch, "best_shares", lambda _, shares, __: shares):
        guided = measure(scene, 2**21, bounces, "guided")
    assert_agree(guided, measure(scene, 2**21, bounces, "mis"), DETECTABLE)
