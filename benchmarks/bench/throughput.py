"""Paths per second, explicit, two bounces, side by side in turns."""

from __future__ import annotations

from functools import partial
from statistics import median
from typing import TYPE_CHECKING, Any

from benchmarks.bench.renderers import DRPT, MITSUBA, MITSUBAS, ORACLE, label, oracle
from benchmarks.bench.scenes import builtin, mesh
from benchmarks.bench.timing import Run, alternate, median_seconds, start
from drpt import Mode
from drpt.render import SAMPLERS

if TYPE_CHECKING:
    from benchmarks.bench.effort import Effort
    from benchmarks.bench.scenes import Configuration

RUNS, MESH_RUNS = 7, 3
BASELINE = f"{MITSUBA}, independent"


def measure_all(effort: Effort) -> list[dict[str, Any]]:
    """Measure the Cornell box, with the oracle, and the large mesh."""
    box, hills = builtin("cornell-box", 2), mesh(5000 if effort.quick else 500_000)
    spp = effort.throughput_spp
    return [*measure(box, spp, RUNS), *_oracle(box), *measure(hills, spp // 2, MESH_RUNS)]


def measure(configuration: Configuration, spp: int, runs: int) -> list[dict[str, Any]]:
    """Measure drpt with both samplers and Mitsuba; a row each."""
    print(f"throughput: {configuration}", flush=True)
    names = [BASELINE, *(label(Mode.EXPLICIT, sampler) for sampler in SAMPLERS)]
    factories = {name: {**DRPT, **MITSUBAS}[name] for name in names}
    jobs = {
        name: partial(start(factory, configuration.scene, configuration.bounces)[0], spp)
        for name, factory in factories.items()
    }
    alternate(jobs, 1, first_seed=0)
    done = alternate(jobs, runs)
    rows = [_row(configuration, name, spp, done[name]) for name in names]
    for row, name in zip(rows, names, strict=True):
        pairs = zip(done[BASELINE], done[name], strict=True)
        row["times_mitsuba"] = median(theirs.seconds / ours.seconds for theirs, ours in pairs)
    return rows


def _oracle(configuration: Configuration) -> list[dict[str, Any]]:
    render = oracle(configuration.scene, configuration.bounces)
    runs = alternate({ORACLE: partial(render, 1)}, 3)[ORACLE]
    return [_row(configuration, ORACLE, 1, runs)]


def _row(configuration: Configuration, name: str, spp: int, runs: list[Run]) -> dict[str, Any]:
    seconds, rays = median_seconds(runs), runs[0].picture.rays
    return {
        "name": configuration.name,
        "bounces": configuration.bounces,
        "renderer": name,
        "spp": spp,
        "seconds": seconds,
        "mpaths_per_s": configuration.paths_per_sample * spp / seconds / 1e6,
        "mrays_per_s": rays / seconds / 1e6 if rays is not None else None,
    }
