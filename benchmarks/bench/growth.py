"""What drpt's cost should hardly grow with: lights, and bounces where most paths leave."""

from __future__ import annotations

from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any
from unittest.mock import patch

from benchmarks.bench.metrics import own_rel_mse
from benchmarks.bench.renderers import drpt
from benchmarks.bench.scenes import lanterns, resized
from benchmarks.bench.timing import alternate, median_seconds, start
from drpt import Mode, Scene, load_scene
from drpt.crosscheck import measure

if TYPE_CHECKING:
    from collections.abc import Iterator

    from benchmarks.bench.effort import Effort

HEIGHT = 64
"""Pixels of the scenes of many lights, each row."""
FEW, MANY = 10, 10_000
SPP = 64
SHORT, LONG = 2, 8
"""Bounces."""
ALIKE = 1 - 2.0**-20
"""Even share of a choice that leaves nothing to importance; with all of it nothing is divided."""


def measure_all(effort: Effort) -> dict[str, float]:
    """Measure all of them, by MIS with Sobol' points."""
    print("growth: many lights, long paths", flush=True)
    many = 100 if effort.quick else MANY
    few_lights, many_lights = (resized(lanterns(n), HEIGHT) for n in (FEW, many))
    spheres = load_scene("spheres")
    chosen = choice_rel_mse(many_lights)
    with uniform_choice():
        uniform = choice_rel_mse(many_lights)
    return {
        "lights": many,
        "lights_time": _ratio((many_lights, SHORT), (few_lights, SHORT), effort),
        "choice_rel_mse": chosen,
        "uniform_rel_mse": uniform,
        "bounces_time": _ratio((spheres, LONG), (spheres, SHORT), effort),
    }


@contextmanager
def uniform_choice() -> Iterator[None]:
    """Let drpt choose all lights alike, which it has no setting for.

    The kernels stay the same, and so does their time; what changes is the even share of each
    choice. Raises `RuntimeError` where nothing has chosen by it.
    """
    from drpt.kernel import device_scene
    from drpt.kernel.emitters import light_tree
    from drpt.kernel.launch import forget

    kept = light_tree.LightTree
    made: list[Any] = []

    def even(*arguments: Any) -> Any:
        made.append(kept(*arguments))
        return made[-1]

    forget()
    with patch.object(light_tree, "EVEN", ALIKE), patch.object(device_scene, "LightTree", even):
        yield
    forget()
    if not made:
        raise RuntimeError("lights are chosen by something else than a LightTree")


def choice_rel_mse(scene: Scene) -> float:
    """Return the relMSE of 64 passes of independent samples, by their own spread."""
    estimate = measure(scene, SPP, SHORT, Mode.MIS, sampler="independent")
    return own_rel_mse(estimate)


def _ratio(long: tuple[Scene, int], short: tuple[Scene, int], effort: Effort) -> float:
    """Time per path of one scene and bounces over another's; pictures of the same size."""
    jobs: dict[str, Any] = {}
    for name, (scene, bounces) in {"long": long, "short": short}.items():
        jobs[name] = partial(start(drpt(Mode.MIS, "sobol"), scene, bounces)[0], SPP)
    runs = alternate(jobs, effort.runs)
    return median_seconds(runs["long"]) / median_seconds(runs["short"])
