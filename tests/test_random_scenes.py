"""Random scenes of 1 to 6 shapes: every mode has the mean that the float64 oracle has.

Hypothesis draws the scenes, always the same ones; it does not shrink what fails, since each try
takes seconds. The mean of a scene is that of its whole picture: close to normal, as it is the
mean of about 10⁵ samples or more that are all bounded (see `tame_scene`).
"""

from __future__ import annotations

from dataclasses import replace
from random import Random
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, note, settings
from hypothesis import strategies as st

import drpt
from drpt.kernel.primitives import make_primitives
from drpt.scene.saving import to_toml
from tests.measuring import Measured, measure
from tests.oracle import path_tracer
from tests.oracle.statistics import (
    assert_means_agree,
    mean_of_independent,
    sidak,
    smallest_detectable,
)
from tests.random_scenes import tame_scene

if TYPE_CHECKING:
    from drpt.scene import Shape

SCENES = 8
MODES = tuple(drpt.Mode)
SIGNIFICANCE = sidak(1e-4, SCENES * len(MODES))
"""Of each comparison of three means: any of them fails by chance for one choice of seeds in 10⁴."""
DETECTED = 0.15
"""Relative error of a mean that every comparison sees 19 times out of 20; most see half of it."""
ALBEDO_FAULT = 0.8
"""Factor of an albedo that has to be found."""
BODY_SEED = 5
"""Of a scene with a body in it, for the tests of a single one."""
PICTURE = 16
BOUNCES = 2
PATHS = 2**19
ORACLE_SPP = 300

always_the_same = settings(
    derandomize=True,
    database=None,
    deadline=None,
    phases=[Phase.generate],
    max_examples=SCENES,
    suppress_health_check=[HealthCheck.too_slow],
)


@pytest.mark.slow
@given(st.integers(0, 2**32 - 1))
@always_the_same
def test_means_of_random_scenes_are_the_oracles(seed: int) -> None:
    scene = tame_scene(Random(seed), PICTURE)
    note(to_toml(scene))
    truth = oracle(scene)
    for mode in MODES:
        assert_agree(measure(scene, PATHS, BOUNCES, mode), truth)


def test_half_of_the_scenes_have_bodies() -> None:
    scenes = [tame_scene(Random(seed), PICTURE) for seed in range(40)]
    solids = [make_primitives(scene.shapes).solids for scene in scenes]
    assert np.mean([len(found) > 0 for found in solids]) >= 0.5
    assert np.mean([any(body.encloses for body in found) for found in solids]) >= 0.1


def test_the_mean_of_a_random_scene_is_the_oracles() -> None:
    scene = tame_scene(Random(BODY_SEED), PICTURE)
    assert_agree(measure(scene, PATHS, BOUNCES, "mis"), oracle(scene))


@pytest.mark.slow
def test_a_wrong_albedo_is_found() -> None:
    scene = tame_scene(Random(BODY_SEED), PICTURE)
    found = measure(darker(scene, ALBEDO_FAULT), PATHS, BOUNCES, "mis")
    with pytest.raises(AssertionError, match="means differ"):
        assert_agree(found, oracle(scene))


def test_light_where_all_is_dark_is_found() -> None:
    dark, leak = (Measured(np.full(3, mean), np.full(3, mean)) for mean in (0.0, 1e-9))
    assert_agree(dark, dark)
    with pytest.raises(AssertionError, match="where all is dark"):
        assert_agree(leak, dark)


def darker(scene: drpt.Scene, factor: float) -> drpt.Scene:
    """The same scene, all that reflects darker by a factor."""

    def repaint(shape: Shape) -> Shape:
        if shape.material is None:
            return shape
        r, g, b = shape.material.albedo
        albedo = (factor * r, factor * g, factor * b)
        return replace(shape, material=replace(shape.material, albedo=albedo))

    return drpt.Scene(scene.camera, map(repaint, scene.shapes))


def oracle(scene: drpt.Scene) -> Measured:
    rng = np.random.default_rng(1)
    options = {"direct_light": True, "sample_brdf": True}
    picture = path_tracer.render(scene, ORACLE_SPP, BOUNCES, rng, **options)
    return Measured(*mean_of_independent(*picture))


def assert_agree(found: Measured, truth: Measured) -> None:
    """Assert that means are the same: exactly, where the truth is 0, as in a closed room."""
    assert (found.mean[truth.mean == 0] == 0).all(), f"{found.mean} where all is dark"
    error = np.hypot(found.standard_error, truth.standard_error)
    detected = smallest_detectable(error, SIGNIFICANCE, 3)
    assert (detected <= DETECTED * truth.mean).all(), f"detects {detected} of {truth.mean} only"
    assert_means_agree(
        found.mean, found.standard_error, truth.mean, truth.standard_error, SIGNIFICANCE
    )
