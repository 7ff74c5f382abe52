"""When a render stops: by its error, by its time, and without bias."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest

import drpt
from benchmarks.stopping import caustic, edge
from drpt.error import DARK
from drpt.stopping import LEAST_SPP, Stopping
from tests.scenes import LAMP_AND_BALL, seen_by

# A mean of 400 stopped renders is unbiased if it is within so many standard errors.
DEVIATIONS = 3
# Of the rank statistic of all pixels together, which needs no more than that.
SEEDS = 400


def never() -> float:
    raise AssertionError


class TestStopping:
    def test_without_a_limit_nothing_stops(self) -> None:
        stopping = Stopping(None, None)
        assert not stopping.may_come
        assert not stopping.has_come(10**9, never)

    def test_an_error_that_is_small_enough_stops(self) -> None:
        stopping = Stopping(1e-3, None)
        assert stopping.may_come
        assert not stopping.has_come(64, lambda: 1.01e-3)
        assert stopping.has_come(128, lambda: 1e-3)

    def test_few_samples_are_never_enough(self) -> None:
        assert not Stopping(1e9, None).has_come(LEAST_SPP - 1, never)
        assert Stopping(1e9, None).has_come(LEAST_SPP, lambda: 0.0)

    def test_the_error_is_asked_for_only_where_it_may_be_reached(self) -> None:
        stopping = Stopping(1e-4, None)
        assert not stopping.has_come(64, lambda: 8e-4)
        assert stopping.last_look == (64, 8e-4)
        assert not stopping.has_come(127, never)
        assert stopping.has_come(128, lambda: 1e-4)

    @pytest.mark.parametrize("error", [float("nan"), float("inf")])
    def test_an_error_that_is_unknown_is_not_small(self, error: float) -> None:
        stopping = Stopping(1e-4, None)
        assert not stopping.has_come(64, lambda: error)

    def test_time_counts_from_the_start(self) -> None:
        stopping = Stopping(None, 0.05)
        time.sleep(0.06)
        stopping.start()
        assert not stopping.has_come(1, never)
        time.sleep(0.06)
        assert stopping.has_come(1, never)


BAD: list[dict[str, Any]] = [
    {"target_error": 0},
    {"target_error": -1e-3},
    {"target_error": "small"},
    {"target_error": float("nan")},
    {"time_limit": 0},
    {"time_limit": True},
    {"time_limit": float("inf")},
]


@pytest.mark.parametrize("bad", BAD)
def test_bad_limits_are_refused_by_name(bad: dict[str, Any]) -> None:
    ((name, value),) = bad.items()
    with pytest.raises(ValueError, match=rf"^{name}: .*; it must be a finite number > 0$") as error:
        drpt.Rendering(LAMP_AND_BALL, **bad)
    assert repr(value) in str(error.value)


def test_a_target_needs_an_error() -> None:
    with pytest.raises(ValueError, match=r"^error: False .* where there is a target_error"):
        drpt.Rendering(LAMP_AND_BALL, error=False, target_error=1e-3)


@pytest.mark.parametrize("sampler", ["sobol", "independent"])
def test_a_render_stops_in_the_pass_in_which_its_error_is_small_enough(sampler: str) -> None:
    target, most = 3e-4, 2**16
    passes = drpt.Rendering(
        LAMP_AND_BALL, most, 2, sampler=sampler, target_error=1e-30, time_limit=1e9
    )
    errors = {}
    for spp in passes.passes():
        if spp >= 64:
            errors[spp] = passes._measure(passes.result()._estimate).bound
            if errors[spp] <= target:
                break
    result = drpt.render(LAMP_AND_BALL, most, 2, sampler=sampler, target_error=target)
    assert 64 < result.spp < most
    assert result.spp == max(errors)
    assert result.error <= result.error_bound <= target
    assert result.error_bound == pytest.approx(errors[result.spp])
    assert all(error > target for spp, error in errors.items() if spp < result.spp)
    assert not result.partial


def test_the_error_is_uncertain_where_a_few_pixels_that_show_no_light_hold_it() -> None:
    """A caustic, of which some pixels get a sample in hundreds; a lamp's edge is measured."""
    found = [drpt.render(caustic(), 1024, 2, seed=seed, target_error=1e-9) for seed in range(6)]
    uncertain = [result for result in found if result.error_uncertain]
    assert len(uncertain) >= 4
    assert "error uncertain" in str(uncertain[0])
    assert uncertain[0].metadata["error_uncertain"] is True
    found = [drpt.render(edge(), 256, 2, seed=seed, target_error=1e-9) for seed in range(6)]
    assert not any(result.error_uncertain for result in found)


def test_a_target_that_is_not_reached_takes_all_samples() -> None:
    result = drpt.render(LAMP_AND_BALL, 100, 2, target_error=1e-12)
    assert result.spp == 100
    assert result.error > 1e-12
    assert not result.partial


def test_a_render_stopped_early_is_the_one_of_so_many_samples() -> None:
    stopped = drpt.render(LAMP_AND_BALL, 2**16, 2, target_error=1e-3)
    plain = drpt.render(LAMP_AND_BALL, stopped.spp, 2)
    assert stopped.image == pytest.approx(plain.image, rel=1e-6)  # passes of other lengths
    assert stopped._estimate.relative_mse == pytest.approx(plain.error, rel=1e-4)
    again = drpt.render(LAMP_AND_BALL, 2**16, 2, target_error=1e-3)
    assert np.array_equal(again.image, stopped.image)


def test_time_that_is_over_stops_after_the_running_pass() -> None:
    result = drpt.render(LAMP_AND_BALL, 2**30, 2, time_limit=0.2)
    assert 0 < result.spp < 2**30
    assert 0.2 <= result.seconds < 5
    assert not result.partial


@pytest.mark.slow
@pytest.mark.parametrize("sampler", ["sobol", "independent"])
def test_stopping_does_not_bias_the_picture(sampler: str) -> None:
    """Targets are such that about as many renders stop after 64 samples as later."""
    scene = seen_by(LAMP_AND_BALL, 12, 8)
    truth = drpt.render(scene, 2**16, 1, seed=2**40).image.astype(np.float64)
    settings: Any = {"bounces": 1, "mode": "implicit", "sampler": sampler}
    first = [
        drpt.render(scene, 64, seed=seed, target_error=1e-30, **settings) for seed in range(20)
    ]
    middle = np.median([result.error_bound for result in first])
    stopped = [
        drpt.render(scene, 1024, seed=seed, target_error=float(middle), **settings)
        for seed in range(SEEDS)
    ]
    spp = np.array([result.spp for result in stopped])
    assert 0.2 < (spp == 64).mean() < 0.8
    weights = 1 / (truth**2 + DARK)
    biases = [float(np.mean((r.image - truth) * truth * weights)) for r in stopped]
    assert abs(np.mean(biases)) <= DEVIATIONS * np.std(biases) / SEEDS**0.5
    images = np.array([result.image for result in stopped], np.float64)
    lit = images.std(axis=0) > 0
    deviations = (images.mean(axis=0) - truth)[lit] / (images.std(axis=0)[lit] / SEEDS**0.5)
    assert np.abs(deviations).mean() < 1  # 0.80 of a normal distribution


def test_a_limit_that_is_over_at_once_leaves_one_pass() -> None:
    result = drpt.render(LAMP_AND_BALL, 2**20, 2, time_limit=1e-9)
    assert result.spp > 0
    assert result.image.any()
