"""How cost grows along one axis at a time, all else the same."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from benchmarks.bench.renderers import DRPT, MITSUBA, MITSUBAS, label
from benchmarks.bench.scenes import ball_pit, lanterns, resized, terrain
from benchmarks.bench.timing import alternate, median_seconds, start
from drpt import Mode, Scene, load_scene
from drpt.kernel import backend

if TYPE_CHECKING:
    from collections.abc import Callable

    from benchmarks.bench.effort import Effort

HEIGHT = 128
"""Pixels, where their number does not matter."""
RENDERERS = {
    name: DRPT[name] for name in (label(mode, "sobol") for mode in (Mode.EXPLICIT, Mode.MIS))
}
RENDERERS |= {name: MITSUBAS[name] for name in (f"{MITSUBA}, independent",)}


@dataclass(frozen=True)
class Workload:
    """One render; ``threads`` = 0 stands for all."""

    scene: Scene
    spp: int = 64
    bounces: int = 2
    threads: int = 0


@dataclass(frozen=True)
class Axis:
    """What grows, its values, and the render at each of them."""

    name: str
    values: tuple[int, ...]
    workload: Callable[[int], Workload]


def axes() -> list[Axis]:
    """All axes, with as many threads as there are cores."""
    box, spheres = load_scene("cornell-box"), load_scene("spheres")
    backend.load()
    import drjit as dr

    cores = dr.thread_count()
    threads = (*(2**k for k in range(cores.bit_length()) if 2**k < cores), cores)
    decades = tuple(10**k for k in range(1, 7))
    small = partial(resized, height=HEIGHT)
    return [
        Axis("spp", tuple(4**k for k in range(8)), lambda n: Workload(small(box), spp=n)),
        Axis(
            "pixels",
            tuple(4**k for k in range(2, 13)),
            lambda n: Workload(resized(box, round(n**0.5)), spp=16),
        ),
        Axis(
            "bounces, closed box",
            tuple(2**k for k in range(8)),
            lambda n: Workload(small(box), bounces=n),
        ),
        Axis(
            "bounces, open scene",
            tuple(2**k for k in range(8)),
            lambda n: Workload(small(spheres), bounces=n),
        ),
        Axis("spheres", decades, lambda n: Workload(small(ball_pit(n)), spp=16)),
        Axis("triangles", decades, lambda n: Workload(small(terrain(n)))),
        Axis("lights", (1, *decades[:4]), lambda n: Workload(small(lanterns(n)), spp=16)),
        Axis("threads", threads, lambda n: Workload(box, threads=n)),
    ]


def measure_all(effort: Effort) -> list[dict[str, Any]]:
    """Measure every axis, or three values of each."""
    return [measure(axis, effort) for axis in axes()]


def measure(axis: Axis, effort: Effort) -> dict[str, Any]:
    """Measure an axis; a renderer leaves it where the next value would take too long."""
    print(f"scaling: {axis.name}", flush=True)
    curves: dict[str, list[dict[str, float]]] = {name: [] for name in RENDERERS}
    left_after: dict[str, int] = {}
    for value in axis.values[:3] if effort.quick else axis.values:
        staying = [name for name in RENDERERS if name not in left_after]
        for name, point in at(axis.workload(value), staying, effort).items():
            curves[name].append({"value": value, **point})
            if expected_seconds(curves[name]) > effort.scaling_seconds:
                left_after[name] = value
    return {"axis": axis.name, "curves": curves, "left_after": left_after}


def expected_seconds(curve: list[dict[str, float]]) -> float:
    """Seconds of a curve's next point, with loading, if it grows as it did last."""
    last, previous = ([p["seconds"] + p["load_seconds"] for p in curve] * 2)[-1:-3:-1]
    return last**2 / previous


def at(workload: Workload, names: list[str], effort: Effort) -> dict[str, dict[str, float]]:
    """Measure some renderers at one value."""
    import drjit as dr

    threads = dr.thread_count()
    dr.set_thread_count(workload.threads or threads)
    started = {name: start(RENDERERS[name], workload.scene, workload.bounces) for name in names}
    jobs = {name: partial(render, workload.spp) for name, (render, _) in started.items()}
    runs = alternate(jobs, effort.runs)
    dr.set_thread_count(threads)
    paths = workload.scene.camera.width * workload.scene.camera.height * workload.spp
    return {
        name: {
            "seconds": median_seconds(runs[name]),
            "ns_per_path": median_seconds(runs[name]) / paths * 1e9,
            **asdict(started[name][1]),
        }
        for name in names
    }
