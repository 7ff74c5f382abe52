"""Error against time of every renderer, up the ladder of samples per pixel, side by side."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from benchmarks.bench import metrics
from benchmarks.bench.references import reference
from benchmarks.bench.renderers import ALL, MITSUBAS, ORACLE, label
from benchmarks.bench.scenes import configurations
from benchmarks.bench.timing import alternate, forget_kernels, median_seconds, start
from drpt import Mode
from drpt.render import SAMPLERS

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from benchmarks.bench.effort import Effort
    from benchmarks.bench.renderers import Factory
    from benchmarks.bench.scenes import Configuration
    from benchmarks.bench.timing import Run
    from drpt.crosscheck.estimate import Estimate

TARGET = 1e-3
"""relMSE whose time is told."""
CLOSE = 4
"""The ladder quadruples down to this many targets, and doubles from there."""
ORACLE_TRIANGLES = 1000
"""More of them NumPy does not test in any useful time."""
BEST = (Mode.EXPLICIT, Mode.MIS, Mode.GUIDED)
CONTENDERS = {label(mode, sampler) for mode in BEST for sampler in SAMPLERS} | {*MITSUBAS}
"""What may be the best of its kind, and gets more time."""


@dataclass(frozen=True)
class Point:
    """What so many samples per pixel cost and yield; medians and means over the runs."""

    spp: int
    seconds: float
    rel_mse: float
    bias: float
    bias_error: float
    mpaths_per_s: float
    mrays_per_s: float | None


def measure_all(
    effort: Effort, cache: Path, keep: Callable[[list[dict[str, Any]]], None]
) -> list[dict[str, Any]]:
    """Measure every configuration, or the first one of a quick run; ``keep`` what there is."""
    measured = []
    for configuration in configurations()[:1] if effort.quick else configurations():
        measured.append(measure(configuration, fitting(configuration), effort, cache))
        keep(measured)
    return measured


def fitting(configuration: Configuration) -> dict[str, Factory]:
    """All renderers, but the oracle only where there are few triangles."""
    meshes = (getattr(shape, "faces", ()) for shape in configuration.scene.shapes)
    large = sum(map(len, meshes)) > ORACLE_TRIANGLES
    return {name: factory for name, factory in ALL.items() if name != ORACLE or not large}


def measure(
    configuration: Configuration, factories: Mapping[str, Factory], effort: Effort, cache: Path
) -> dict[str, Any]:
    """Measure some renderers on a configuration."""
    print(configuration, flush=True)
    forget_kernels()
    started = {
        name: start(factory, configuration.scene, configuration.bounces)
        for name, factory in factories.items()
    }
    truth = reference(configuration, effort.reference_spp, cache)
    points: dict[str, list[Point]] = {name: [] for name in factories}
    spp = dict.fromkeys(factories, 1)
    while climbing := [name for name in spp if goes_on(name, points[name], spp[name], effort)]:
        jobs = {name: partial(started[name][0], spp[name]) for name in climbing}
        compiling = {name: job for name, job in jobs.items() if name in MITSUBAS}
        alternate(compiling, 1, first_seed=0)  # multijitter is compiled for its samples
        runs = alternate(jobs, effort.runs)
        for name in climbing:
            points[name].append(_point(configuration, spp[name], runs[name], truth))
            spp[name] *= 2 if points[name][-1].rel_mse < CLOSE * TARGET else 4
    return {
        "name": configuration.name,
        "bounces": configuration.bounces,
        "reference": {"spp": truth.spp, "rel_mse": metrics.own_rel_mse(truth)},
        "renderers": {
            name: {**asdict(started[name][1]), **_summary(points[name])} for name in factories
        },
    }


def goes_on(name: str, points: list[Point], spp: int, effort: Effort) -> bool:
    """Whether a renderer is due for another point: the target is ahead, and it has time."""
    if not points:
        return True
    last = points[-1]
    limit = effort.point_seconds if name in CONTENDERS else effort.slow_point_seconds
    return last.rel_mse > TARGET and last.seconds * spp / last.spp <= limit


def _point(configuration: Configuration, spp: int, runs: list[Run], truth: Estimate) -> Point:
    seconds = median_seconds(runs)
    pictures = [run.picture for run in runs]
    biases = [metrics.bias(picture.image, truth) for picture in pictures]
    rays = pictures[0].rays
    return Point(
        spp=spp,
        seconds=seconds,
        rel_mse=sum(metrics.rel_mse(picture.image, truth) for picture in pictures) / len(runs),
        bias=sum(bias.value for bias in biases) / len(runs),
        bias_error=sum(bias.standard_error**2 for bias in biases) ** 0.5 / len(runs),
        mpaths_per_s=configuration.paths_per_sample * spp / seconds / 1e6,
        mrays_per_s=rays / seconds / 1e6 if rays is not None else None,
    )


def _summary(points: list[Point]) -> dict[str, Any]:
    seconds, errors = [p.seconds for p in points], [p.rel_mse for p in points]
    reach = metrics.time_to(TARGET, seconds, errors)
    return {
        "points": [asdict(point) for point in points],
        "slope": metrics.slope(seconds, errors),
        "seconds_to_target": reach.seconds,
        "extrapolated": reach.extrapolated,
    }
