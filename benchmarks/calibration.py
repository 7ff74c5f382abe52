"""Calibration of standard errors: in pixels that show lights, beside these, and elsewhere.

A Markdown table: ``python -m benchmarks.calibration``, an hour; ``--seeds 64`` takes a quarter.
A ratio is the mean squared standard error over the variance across the seeds, with an interval of
95 %. Where that misses `BOUNDS`, or a value that is equal in all pictures has a standard error, the
exit status is 1.
"""

from __future__ import annotations

import argparse
import sys
from itertools import product
from operator import itemgetter
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from benchmarks.bench.report import table
from benchmarks.bench.scenes import configurations, resized
from drpt import render
from drpt.render import SAMPLERS

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from benchmarks.bench.scenes import Configuration

    Array = NDArray[np.float64]
    Mask = NDArray[np.bool_]

HEIGHT = 32
SPP = (16, 64, 256)
SEEDS = 256
BOUNDS = 0.7, 1.4
LIGHT_SPP = 1024
"""Samples per pixel that find the pixels that show a light."""
BESIDE = 2
"""Largest distance in pixels of a pixel beside a light."""
NOTHING = 1e-6
"""Largest relative standard error of a value that is equal in all pictures."""
GROUPS = 16
"""Number of groups of seeds, whose ratios give the interval."""
STUDENT_95 = 2.13
"""Half of an interval that covers 95 % of a t-distribution of `GROUPS` - 1 degrees of freedom."""


class Ratio(NamedTuple):
    """Mean squared standard error over variance, and half of its interval."""

    value: float
    half: float

    @property
    def is_bad(self) -> bool:
        """Whether the whole interval is out of bounds."""
        return self.value + self.half < BOUNDS[0] or self.value - self.half > BOUNDS[1]

    def __str__(self) -> str:
        return f"{self.value:.2f} ± {self.half:.2f}{' (!)' if self.is_bad else ''}"


def main() -> int:
    """Print the table; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False)
    parser.add_argument("--seeds", type=int, default=SEEDS, help="default: %(default)s")
    parser.add_argument("scenes", metavar="SCENE", nargs="*", help="by default all")
    args = parser.parse_args()
    chosen = [c for c in configurations() if not args.scenes or c.name in args.scenes]
    rows, bad = [], 0
    for configuration, spp, sampler in product(chosen, SPP, SAMPLERS):
        row, outside = calibrate(configuration, spp, sampler, args.seeds)
        print(row, file=sys.stderr, flush=True)
        rows.append(row)
        bad += outside
    print(table({name: itemgetter(name) for name in rows[0]}, rows))
    return 1 if bad else 0


def calibrate(
    configuration: Configuration, spp: int, sampler: str, seeds: int
) -> tuple[dict[str, Any], int]:
    """A row of the table, and how many of its cells are out of bounds."""
    scene = resized(configuration.scene, HEIGHT)
    results = [
        render(scene, spp, configuration.bounces, sampler=sampler, seed=seed)
        for seed in range(seeds)
    ]
    images = np.array([result.image for result in results], np.float64)
    errors = np.array([result.standard_error for result in results], np.float64)
    equal = (images == images[0]).all(axis=0)
    told = float((errors[:, equal] / np.maximum(images[:, equal], 1e-30)).max(initial=0))
    squares, deviations = errors**2, (images - images.mean(axis=0)) ** 2 * seeds / (seeds - 1)
    ratios = {
        name: _ratio(squares[:, where], deviations[:, where])
        for name, where in _regions(render(scene, LIGHT_SPP, 0).image, ~equal)
    }
    row = {
        "scene": configuration.name,
        "bounces": configuration.bounces,
        "spp": spp,
        "sampler": sampler,
        "equal": f"{100 * equal.mean():.0f} %",
        "their error": f"{told:.1g}",
        **{name: str(ratio) for name, ratio in ratios.items()},
    }
    return row, sum(r.is_bad for r in ratios.values()) + (told > NOTHING)


def _regions(lights: NDArray[np.float32], noisy: Mask) -> Iterator[tuple[str, Mask]]:
    from scipy.ndimage import binary_dilation

    lit = lights.max(axis=2) > 0
    around = binary_dilation(lit, np.ones((3, 3)), BESIDE)
    for name, where in (("lights", lit), ("beside", around & ~lit), ("elsewhere", ~around)):
        yield name, where[..., None] & noisy


def _ratio(squares: Array, deviations: Array) -> Ratio:
    """Return the ratio of the means of two arrays (seeds, values), with its interval."""
    if not squares.size:
        return Ratio(np.nan, np.nan)
    parts = [
        a.mean() / b.mean()
        for a, b in zip(
            np.array_split(squares, GROUPS), np.array_split(deviations, GROUPS), strict=True
        )
    ]
    half = STUDENT_95 * float(np.std(parts, ddof=1)) / GROUPS**0.5
    return Ratio(float(squares.mean() / deviations.mean()), half)


if __name__ == "__main__":
    sys.exit(main())
