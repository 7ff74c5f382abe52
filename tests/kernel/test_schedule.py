"""Orders of work: the same sums, path by path, ray by ray and vertex by vertex."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

import drpt
from drpt.kernel.estimator import Mode
from drpt.kernel.launch import make_launcher
from tests.conftest import TYPES

if TYPE_CHECKING:
    from drpt.kernel.launch import Launcher

# Sums of the same float32 samples, in float64 but in another order.
SUMMATION = 1e-12


def launcher_of(
    name: str, mode: str, bounces: int, sampler: str, *, regeneration: bool
) -> Launcher:
    launcher = make_launcher(
        TYPES, drpt.load_scene(name), bounces, Mode(mode), sampler, jitter=True
    )
    tracer = launcher.tracer
    assert tracer.features.regeneration is (bounces > 2)
    features = replace(tracer.features, regeneration=regeneration)
    return replace(launcher, tracer=replace(tracer, features=features))


@pytest.mark.slow
@pytest.mark.parametrize("mode", Mode)
@pytest.mark.parametrize(
    ("name", "bounces", "sampler"),
    [("spheres", 3, "sobol"), ("spheres", 9, "independent"), ("many-lights", 5, "sobol")],
)
def test_paths_that_start_where_others_end_are_the_same(
    name: str, mode: str, bounces: int, sampler: str
) -> None:
    """Down to the last bit of each, and in number, although lanes take turns elsewhere."""
    by_vertex, by_path = (
        launcher_of(name, mode, bounces, sampler, regeneration=on).launch(
            range(20_000, 20_400), range(3, 14), 4, 5
        )
        for on in (True, False)
    )
    assert by_path.radiance.any()
    assert by_vertex.radiance == pytest.approx(by_path.radiance, rel=SUMMATION)
    assert by_vertex[1:] == by_path[1:]


def test_open_scenes_alone_regenerate_paths() -> None:
    found = {
        name: drpt.explain(drpt.load_scene(name), bounces=3).features["regeneration"]
        for name in ("spheres", "veach", "cornell-box", "furnace")
    }
    assert found == {"spheres": True, "veach": True, "cornell-box": False, "furnace": False}


def test_samples_that_are_not_finite_are_counted_once(monkeypatch: pytest.MonkeyPatch) -> None:
    from drpt.kernel.integrators.path import Tracer

    start = Tracer.start

    def broken(self: Tracer, ray: object) -> object:
        path = start(self, ray)  # type: ignore[arg-type]
        return path._replace(radiance=path.radiance + np.inf)

    monkeypatch.setattr(Tracer, "start", broken)
    launcher = launcher_of("spheres", "mis", 3, "sobol", regeneration=True)
    assert launcher.launch(range(100), range(7), 2, 0).non_finite == 700
