"""Paths per second of drpt and of Mitsuba 3, side by side.

Both render the same scene in turn, several times, after a warm-up that compiles their kernels;
medians count. Mitsuba runs its path integrator in ``llvm_ad_rgb`` with the independent sampler.

    python -m benchmarks.throughput [--scene cornell-box] [--spp 256] [--bounces 2] [--runs 7]
"""

from __future__ import annotations

import argparse
from statistics import median
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from drpt import load_scene, render
from drpt.crosscheck import to_mitsuba
from drpt.render import SAMPLERS

if TYPE_CHECKING:
    from collections.abc import Callable


def main() -> None:
    """Print a line for each renderer, and the ratios."""
    args = _arguments()
    scene = load_scene(args.scene)
    reference = to_mitsuba(scene, args.bounces)
    import mitsuba as mi

    def in_mitsuba(seed: int) -> Any:
        return np.array(mi.render(reference, spp=args.spp, seed=mi.UInt32(seed)))

    def in_drpt(sampler: str) -> Callable[[int], Any]:
        return lambda seed: (
            render(scene, args.spp, args.bounces, args.mode, sampler=sampler, seed=seed).image
        )

    renderers = {"mitsuba": in_mitsuba, **{f"drpt {s}": in_drpt(s) for s in SAMPLERS}}
    seconds: dict[str, list[float]] = {name: [] for name in renderers}
    for run in range(-1, args.runs):
        for name, renderer in renderers.items():
            start = perf_counter()
            image = renderer(run + 1)
            if run < 0:
                print(f"{name:18} mean {image.mean(axis=(0, 1), dtype=np.float64)}")
            else:
                seconds[name].append(perf_counter() - start)
    paths = scene.camera.width * scene.camera.height * args.spp
    for name, times in seconds.items():
        ratios = [m / t for m, t in zip(seconds["mitsuba"], times, strict=True)]
        print(
            f"{name:18} {median(times):7.3f} s  {paths / median(times) / 1e6:7.2f} Mpaths/s"
            f"  {median(ratios):5.2f} x Mitsuba ({min(ratios):.2f} to {max(ratios):.2f})"
        )


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False)
    parser.add_argument("--scene", default="cornell-box")
    parser.add_argument("--spp", type=int, default=256)
    parser.add_argument("--bounces", type=int, default=2)
    parser.add_argument("--mode", default="explicit")
    parser.add_argument("--runs", type=int, default=7)
    return parser.parse_args()


if __name__ == "__main__":
    main()
