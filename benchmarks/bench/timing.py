"""Clocks: the first call, which compiles, apart from warm ones, which take turns."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import TYPE_CHECKING, NamedTuple

from drpt.kernel import backend

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from benchmarks.bench.renderers import Factory, Picture, Render
    from drpt import Scene

MIB = 2**20


class Run(NamedTuple):
    """A render and its wall-clock seconds."""

    seconds: float
    picture: Picture


@dataclass(frozen=True)
class ColdStart:
    """What comes before the first warm render.

    Attributes
    ----------
    load_seconds
        To put the scene into the renderer; drpt does that in every call.
    first_seconds, compile_seconds
        Of the first render, of one sample per pixel, and its share of the compiler.
    operations
        Of the largest kernel; 0 without one.
    peak_mib
        Of Dr.Jit's arrays in the first render; whole processes are measured at start-up.
    """

    load_seconds: float
    first_seconds: float
    compile_seconds: float
    operations: int
    peak_mib: float


def forget_kernels() -> None:
    """Drop all compiled kernels, also from the folder ``DRJIT_CACHE_DIR``: it is this run's own."""
    backend.load()
    import drjit as dr

    dr.flush_kernel_cache()
    for kernel in Path(os.environ["DRJIT_CACHE_DIR"]).glob("*.bin"):
        kernel.unlink()


def start(factory: Factory, scene: Scene, bounces: int) -> tuple[Render, ColdStart]:
    """Load a scene and compile its kernels, for one sample and, apart in Mitsuba, for several."""
    backend.load()
    import drjit as dr

    begin = perf_counter()
    render = factory(scene, bounces)
    loaded = perf_counter()
    dr.flush_malloc_cache()  # what it keeps counts as used
    dr.detail.malloc_clear_statistics()
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        render(1, 0)
        first = perf_counter()
        kernels = dr.kernel_history((dr.KernelType.JIT,))
    if kernels:
        render(4, 0)
    cold = ColdStart(
        load_seconds=loaded - begin,
        first_seconds=first - loaded,
        compile_seconds=sum(k["codegen_time"] + k["backend_time"] for k in kernels) / 1000,
        operations=max((k["operation_count"] for k in kernels), default=0),
        peak_mib=dr.detail.malloc_watermark(dr.JitBackend.LLVM) / MIB,
    )
    return render, cold


def alternate(
    jobs: Mapping[str, Callable[[int], Picture]], runs: int, first_seed: int = 1
) -> dict[str, list[Run]]:
    """Run warm jobs in turn, each with the seeds of all of its runs."""
    done: dict[str, list[Run]] = {name: [] for name in jobs}
    for seed in range(first_seed, first_seed + runs):
        for name, job in jobs.items():
            begin = perf_counter()
            picture = job(seed)
            done[name].append(Run(perf_counter() - begin, picture))
    return done


def median_seconds(runs: list[Run]) -> float:
    """Median time of some runs."""
    return median(run.seconds for run in runs)
