"""Whether the error that drpt tells is the true one, what it costs, and whether stopping biases.

Three Markdown tables, in about four minutes: ``python -m benchmarks.honesty``.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from operator import itemgetter
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.bench.report import table
from benchmarks.bench.scenes import resized
from benchmarks.bench.startup import DRPT, run
from drpt import load_scene, render
from drpt.error import DARK, relative_mse
from drpt.render import SAMPLERS
from drpt.scene.builtin import builtin_names

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from drpt import Result, Scene

    Floats = NDArray[np.float64]
    Row = dict[str, Any]

HEIGHT = 104
"""Pixels: a square picture has 10816 of them."""
REFERENCE_SPP, REFERENCE_SEED = 16384, 2**31
SPP = (16, 64, 256)
SEEDS = range(1, 5)
"""Pictures of each kind, so that one firefly does not decide."""
NORMAL_95 = 1.96
"""Half the width of an interval that covers 95 % of a normal distribution, in standard errors."""

STOPPED = ("cornell-box", "cornell-box-glossy", "spheres", "veach")
STOPPED_HEIGHT = 32
STOPPED_SPP = 64
STOPPED_SEEDS = range(1, 65)

COST_SCENE, COST_SPP, COST_RUNS = "cornell-box", (16, 64, 256), 9
MEMORY_SIZE, MEMORY_SPP = (1920, 1080), 16


@dataclass(frozen=True)
class Reference:
    """A picture of little error, and its standard error, (height, width, 3) each."""

    image: Floats
    standard_error: Floats

    @property
    def weights(self) -> Floats:
        """What makes squares of differences to the reference relative."""
        return np.asarray(1 / (self.image**2 + DARK))

    @property
    def rel_mse(self) -> float:
        """What is left of its own error."""
        return relative_mse(self.standard_error**2, self.image)


def main() -> None:
    """Print all tables; memory first, see `benchmarks.bench.startup.run`."""
    memory = [_memory_row(name, flag) for name, flag in (("on", ""), ("off", "--no-error"))]
    scenes = {name: resized(load_scene(name), HEIGHT) for name in builtin_names()}
    _print(row for name, scene in scenes.items() for row in coverage(name, scene))
    _print(stopping(name, sampler) for name, sampler in product(STOPPED, SAMPLERS))
    _print(cost(spp) for spp in COST_SPP)
    _print(memory)


def coverage(name: str, scene: Scene) -> list[Row]:
    """Hold what pictures say of their error against what it is; a row for each number of samples.

    That of the reference itself, which the rows allow for, is printed.
    """
    truth = reference(scene)
    print(f"{name}: the reference has a relMSE of {truth.rel_mse:.2g}\n", flush=True)
    rows: list[Row] = [{"scene": f"`{name}`", "spp": spp} for spp in SPP]
    for sampler, row in product(SAMPLERS, rows):
        results = [render(scene, row["spp"], sampler=sampler, seed=seed) for seed in SEEDS]
        row |= {f"{sampler}: {what}": value for what, value in _honesty(truth, results).items()}
    return rows


def reference(scene: Scene) -> Reference:
    """A picture of many samples and of a seed of its own."""
    result = render(scene, REFERENCE_SPP, seed=REFERENCE_SEED)
    return Reference(*(np.asarray(x, np.float64) for x in (result.image, result.standard_error)))


def _honesty(truth: Reference, results: Sequence[Result]) -> Row:
    inside, true = [], []
    for result in results:
        difference = result.image - truth.image
        inside.append(np.abs(difference) <= NORMAL_95 * _both(result.standard_error, truth))
        true.append(np.mean(difference**2 * truth.weights))
    true_error = float(np.mean(true)) - truth.rel_mse
    estimated = float(np.mean([result.error for result in results]))
    return {
        "covered": f"{100 * np.mean(inside):.1f} %",
        "relMSE": true_error,
        "est. / true": f"{estimated / true_error:.2f}",
    }


def _both(errors: NDArray[np.float32], truth: Reference) -> Floats:
    """Standard error of a difference to the reference."""
    return np.hypot(errors.astype(np.float64), truth.standard_error)


def stopping(name: str, sampler: str) -> Row:
    """Mean of pictures that stopped at an error that half of them have at once.

    With that target, chance decides most about when to stop, and so would bias most.
    """
    scene = resized(load_scene(name), STOPPED_HEIGHT)
    first = [render(scene, STOPPED_SPP, sampler=sampler, seed=seed).error for seed in STOPPED_SEEDS]
    target = median(first)
    results = [
        render(scene, REFERENCE_SPP, sampler=sampler, seed=seed, target_error=target)
        for seed in STOPPED_SEEDS
    ]
    truth = reference(scene).image.mean()
    means = np.array([result.image.mean(dtype=np.float64) for result in results]) / truth - 1
    taken = sorted(result.spp for result in results)
    return {
        "scene": name,
        "sampler": sampler,
        "target": target,
        "spp: least, median, most": f"{taken[0]}, {median(taken):.0f}, {taken[-1]}",
        "bias of the mean": f"{100 * means.mean():+.3f} %",
        "its standard error": f"{100 * means.std(ddof=1) / np.sqrt(len(means)):.3f} %",
    }


def cost(spp: int) -> Row:
    """Seconds of whole warm renders with and without the estimate, in turn."""
    scene = load_scene(COST_SCENE)
    on, off = (_timed(render, scene, spp, error=error) for error in (True, False))
    for job in (on, off):
        job()
    pairs = [(on(), off()) for _ in range(COST_RUNS)]
    with_it, without = (median(column) for column in zip(*pairs, strict=True))
    ratio = median(a / b for a, b in pairs)
    return {"spp": spp, "s with it": with_it, "s without": without, "ratio, in pairs": ratio}


def _timed(job: Callable[..., Result], *args: Any, **settings: Any) -> Callable[[], float]:
    """Call a job, ask for the error if it has one, and return the seconds."""

    def timed() -> float:
        begin = perf_counter()
        result = job(*args, **settings)
        if settings["error"]:
            _ = result.error
        return perf_counter() - begin

    return timed


def _memory_row(name: str, flag: str) -> Row:
    """What a whole process has resident at the most."""
    width, height = MEMORY_SIZE
    with TemporaryDirectory() as folder:
        size = f"--width {width} --height {height} --spp {MEMORY_SPP}"
        out = Path(folder) / "large.npy"
        process = run(f"{DRPT} {COST_SCENE} {size} {flag} -o {out}", Path(folder))
    return {"estimate": name, "picture": f"{width}x{height}", "MiB": process.peak_mib}


def _print(rows: Any) -> None:
    rows = list(rows)
    print(table({name: itemgetter(name) for name in rows[0]}, rows), end="\n\n", flush=True)


if __name__ == "__main__":
    main()
