"""One picture, however it is computed: loops, Embree, plans of passes.

All of them trace the same samples. That threads change nothing is shown in `test_render`, and that
CPUs do not in `kernel/test_arithmetic`.
"""

from __future__ import annotations

import numpy as np
import pytest

import drpt
from drpt.kernel.launch import forget
from tests.measuring import with_radiance
from tests.test_modes import small_scene

# Plans of passes add the same samples up in another order, in float64; the picture is float32.
ULP = 2.0**-23
# Rounding in another place moves hit points by 1e-7 of the scene, which grows from bounce to bounce
# and in glossy lobes.
ROUNDING = 2e-4
# Share of the values that may differ by more: a path in them goes another way at an edge.
FLIPPED = 0.01
# Such paths are lost on one side of an edge and found on the other: means differ much less.
MEAN = 2e-5

SPP = 64
BOUNCES = 4
MODES = ("mis", "implicit-uniform")  # all that there is, and what is least smooth


def assert_same(found: drpt.Result, plain: drpt.Result) -> None:
    assert found.non_finite == plain.non_finite == 0
    assert found.rays == pytest.approx(plain.rays, rel=MEAN)
    assert found.image.mean() == pytest.approx(plain.image.mean(), rel=MEAN)
    differs = np.abs(found.image - plain.image) > ROUNDING * plain.image
    assert differs.mean() <= FLIPPED


@pytest.mark.parametrize(
    "plan",
    [
        {"LAUNCH_PATHS": 2**14},
        {"LAUNCH_PIXELS": 500},
        {"LAUNCH_LANES": 1},
        {"LAUNCH_PATHS": 2**13, "LAUNCH_PIXELS": 1000, "LAUNCH_LANES": 2**12},
    ],
    ids=["passes", "parts", "lanes", "all"],
)
def test_plans_of_passes_change_the_last_bit_at_most(
    plan: dict[str, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    plain = drpt.render(small_scene(), SPP, 1, "explicit")
    for name, value in plan.items():
        monkeypatch.setattr(f"drpt.plan.{name}", value)
    found = drpt.render(small_scene(), SPP, 1, "explicit")
    assert (np.abs(found.image - plain.image) <= ULP * plain.image).all()
    assert (found.rays, found.non_finite) == (plain.rays, plain.non_finite)


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
def test_bounces_in_a_loop_and_unrolled(mode: str, monkeypatch: pytest.MonkeyPatch) -> None:
    plain = drpt.render(small_scene(), SPP, BOUNCES, mode)
    monkeypatch.setattr("drpt.kernel.integrators.path.UNROLLED_VERTICES", 1)
    assert_same(drpt.render(small_scene(), SPP, BOUNCES, mode), plain)


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
def test_triangles_in_embree_and_unrolled(mode: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """And spheres in a loop."""
    plain = drpt.render(small_scene(), SPP, BOUNCES, mode)
    monkeypatch.setattr("drpt.kernel.primitives.FACET_LIMIT", 0)
    monkeypatch.setattr("drpt.kernel.primitives.LIGHT_FACET_LIMIT", 0)
    monkeypatch.setattr("drpt.kernel.spheres.SPHERE_LIMIT", 0)
    forget()
    assert_same(drpt.render(small_scene(), SPP, BOUNCES, mode), plain)


@pytest.mark.slow
def test_the_gate_sees_a_picture_that_is_brighter_by_little() -> None:
    plain = drpt.render(small_scene(), SPP, BOUNCES, "mis")
    brighter = with_radiance(small_scene(), 1 + 2 * MEAN)
    with pytest.raises(AssertionError):
        assert_same(drpt.render(brighter, SPP, BOUNCES, "mis"), plain)


@pytest.mark.slow
def test_the_gate_sees_other_samples() -> None:
    plain = drpt.render(small_scene(), SPP, BOUNCES, "mis")
    with pytest.raises(AssertionError):
        assert_same(drpt.render(small_scene(), SPP, BOUNCES, "mis", seed=1), plain)
