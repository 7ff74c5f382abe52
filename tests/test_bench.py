"""The benchmark: its metrics against closed forms, and one tiny run."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from math import nan
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.bench import error_against_time, metrics
from benchmarks.bench.effort import QUICK
from benchmarks.bench.growth import uniform_choice
from benchmarks.bench.machine import cpu_model, machine, versions
from benchmarks.bench.renderers import ALL, MITSUBAS, ORACLE, label
from benchmarks.bench.report import figure, report
from benchmarks.bench.scenes import Configuration, ball_pit, lanterns, resized, terrain
from benchmarks.bench.targets import Target, targets
from drpt import Mode, Scene, load_scene, render
from drpt.crosscheck.estimate import Estimate

ROUNDING = 1e-12
"""Of float64, in a few operations."""
TINY = replace(QUICK, runs=1, point_seconds=0, slow_point_seconds=0, reference_spp=64)


def flat(mean: float, variance: float = 0.0) -> Estimate:
    return Estimate(np.full((4, 5, 3), mean), np.full((4, 5, 3), variance), 64, 64)


def test_relative_error_of_a_known_picture() -> None:
    image = np.full((4, 5, 3), 0.5)
    assert metrics.rel_mse(image, flat(0.3)) == pytest.approx(0.04 / 0.1, rel=ROUNDING)
    assert metrics.rel_mse(image, flat(0.3, 0.01)) == pytest.approx(0.03 / 0.1, rel=ROUNDING)
    assert metrics.own_rel_mse(flat(0.3, 0.01)) == pytest.approx(0.01 / 0.1, rel=ROUNDING)


def test_noise_of_a_reference_is_taken_off() -> None:
    rng = np.random.default_rng(1)
    shape = (200, 200, 3)
    truth, image = rng.normal(10, 0.1, shape), rng.normal(10, 0.2, shape)
    reference = Estimate(truth, np.full(shape, 0.01), 64, 64)
    error = 2**0.5 * 0.05 / truth.size**0.5  # of the mean of squares of variance 0.05
    assert 100 * metrics.rel_mse(image, reference) == pytest.approx(0.04, abs=5 * error)


def test_bias_is_relative_and_knows_its_noise() -> None:
    exact = metrics.bias(np.full((4, 5, 3), 0.303), flat(0.3))
    assert exact.value == pytest.approx(0.01, rel=1e-10)
    assert exact.standard_error < ROUNDING
    alternating = np.array([0.2, 0.4] * 10).reshape(4, 5, 1) * np.ones(3)
    noisy = metrics.bias(alternating, flat(0.3))
    assert noisy.value == pytest.approx(0, abs=ROUNDING)
    assert noisy.standard_error == pytest.approx(0.1 / 20**0.5 / 0.3, rel=ROUNDING)


def test_time_to_a_target_is_interpolated_along_a_power_law() -> None:
    seconds, errors = [1.0, 4.0, 16.0], [1.0, 0.125, 0.125**2]
    time, extrapolated = metrics.time_to(1.0 / 64 * 2, seconds, errors)
    assert time == pytest.approx(32 ** (2 / 3), rel=1e-9)
    assert not extrapolated
    assert metrics.slope(seconds, errors) == pytest.approx(-1.5, rel=1e-9)


def test_slopes_leave_out_what_fixed_costs_rule() -> None:
    assert metrics.slope([0.01, 1.0, 4.0], [1.0, 0.4, 0.1]) == pytest.approx(-1, rel=1e-9)


@pytest.mark.parametrize("target", [0.01, 4.0])
def test_time_outside_of_the_points_goes_as_one_over_error(target: float) -> None:
    time, extrapolated = metrics.time_to(target, [1.0, 4.0], [0.4, 0.1])
    assert time == pytest.approx(0.4 / target, rel=ROUNDING)
    assert extrapolated


def test_time_beyond_the_last_point_goes_on_along_the_slope() -> None:
    slope = 4 ** (1 / 1.25)  # error ∝ 1 / time^1.25
    time, extrapolated = metrics.time_to(0.1 / 4, [1.0, slope], [0.4, 0.1])
    assert time == pytest.approx(slope**2, rel=ROUNDING)
    assert extrapolated


def test_time_beyond_the_last_point_heeds_no_slope_that_cannot_last() -> None:
    assert metrics.time_to(0.05, [1.0, 1.1], [0.4, 0.1]).seconds == pytest.approx(
        1.1 * 2 ** (2 / 3)
    )
    assert metrics.time_to(0.05, [1.0, 4.0], [0.2, 0.1]).seconds == pytest.approx(8)


def test_one_point_has_no_slope() -> None:
    assert metrics.slope([1.0], [1.0]) is None


@pytest.mark.parametrize(
    ("measured", "at_least", "verdict"),
    [(2.0, True, "ok"), (2.0, False, "short"), (1.0, False, "ok"), (nan, True, "not measured")],
)
def test_verdicts(measured: float, at_least: bool, verdict: str) -> None:
    assert Target("", 1.0, at_least, measured).verdict == verdict


def test_no_target_is_met_where_nothing_was_measured() -> None:
    assert {target.verdict for target in targets({})} == {"not measured"}


@pytest.mark.parametrize(("value", "shown"), [(None, "-"), (nan, "-"), (1234.6, "1235"), (7, "7")])
def test_figures(value: object, shown: str) -> None:
    assert figure(value) == shown


def test_the_processor_is_named() -> None:
    assert cpu_model("processor\t: 0\nmodel name\t: Fast One\n") == "Fast One"
    assert cpu_model("")


@pytest.mark.parametrize("count", [8, 800])
def test_generated_scenes_have_the_size_asked_for(count: int) -> None:
    assert sum(hasattr(s, "radius") and not s.is_light for s in ball_pit(count).shapes) == count
    assert sum(shape.is_light for shape in lanterns(count).shapes) == count
    assert len(getattr(terrain(count).shapes[0], "faces")) == count  # noqa: B009


@pytest.mark.parametrize("scene", [terrain(200), ball_pit(20), lanterns(20)])
def test_generated_scenes_are_lit(scene: Scene) -> None:
    image = render(resized(scene, 16), 64, 2).image
    assert np.isfinite(image).all()
    assert (image > 0).mean() > 0.5  # most of what the camera sees


def test_lights_can_be_chosen_alike() -> None:
    scene = resized(lanterns(40), 8)
    plain = render(scene, 4, 1).image
    with uniform_choice():
        alike = render(scene, 4, 1).image
    assert not np.array_equal(alike, plain)
    np.testing.assert_array_equal(render(scene, 4, 1).image, plain)


def test_uniform_choice_notices_that_nothing_asks_for_it() -> None:
    with pytest.raises(RuntimeError, match="LightTree"), uniform_choice():
        pass


def test_kernels_of_a_run_are_its_own() -> None:
    """The folder for them is chosen before Dr.Jit is loaded, which looks for it then."""
    code = "import sys, benchmarks.bench.__main__; print('drjit' in sys.modules)"
    root = Path(__file__).parents[1]
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=root, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "False"


@pytest.fixture
def tiny_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    monkeypatch.setenv("DRJIT_CACHE_DIR", str(tmp_path))
    names = (label(Mode.EXPLICIT, "independent"), *list(MITSUBAS)[:1], ORACLE)
    box = Configuration("cornell-box", resized(load_scene("cornell-box"), 16), 1)
    return error_against_time.measure(box, {name: ALL[name] for name in names}, TINY, tmp_path)


def test_a_tiny_run(tiny_run: dict[str, Any]) -> None:
    results = {"machine": machine(), "versions": versions(), "quick": True, "error": [tiny_run]}
    assert json.loads(json.dumps(results)) == results
    assert tiny_run["reference"]["spp"] == TINY.reference_spp
    for name, measured in tiny_run["renderers"].items():
        (point,) = measured["points"]
        assert point["spp"] == 1
        assert abs(point["bias"]) < 5 * point["bias_error"]
        assert measured["extrapolated"]
        assert measured["seconds_to_target"] > point["seconds"] > 0
        assert (measured["operations"] > 0) == (name != ORACLE)
        assert f"| {name} | 1 | {figure(point['seconds'])} |" in report(results)
