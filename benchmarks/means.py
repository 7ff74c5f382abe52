"""How far drpt's image means are from Mitsuba's, in every scene and mode: a table.

Each mode takes as many samples against the stored reference as fit into its time, or as make the
means certain to 0.01 %: ``python -m benchmarks.means [--seconds 60] [--bounces 3]``.
"""

from __future__ import annotations

import argparse
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

from drpt import Mode, load_scene
from drpt.crosscheck import check, measure, stored_reference
from drpt.crosscheck.estimate import MAX_SPP, PASSES
from drpt.scene.builtin import builtin_names
from reference.make import path_of

if TYPE_CHECKING:
    from drpt.crosscheck import Reference, Report

TARGET = 1e-4
"""Standard error of the image mean, relative to it, that is enough."""
PILOT = 1024


def main() -> None:
    """Print the table."""
    args = _arguments()
    print("| scene | mode | spp | difference of the means | standard error | verdict |")
    print("|---|---|--:|--:|--:|---|")
    for name in builtin_names():
        against = stored_reference(load_scene(name), path_of(name, args.bounces))
        for mode in Mode:
            report = longest(against, mode, args.seconds)
            test = report.comparison.of_image
            worst = int(np.abs(test.difference / test.reference).argmax())
            difference, error = (
                f"{100 * values[worst] / test.reference[worst]:.4f} %"
                for values in (test.difference, test.standard_error)
            )
            cells = name, mode, str(report.comparison.image.spp), difference, error, report.verdict
            print(f"| {' | '.join(cells)} |", flush=True)


def longest(against: Reference, mode: Mode, seconds: float) -> Report:
    """Check with so many samples as the time allows, or as are enough."""
    measure(against.scene, PASSES, against.bounces, mode)  # compiles
    start = perf_counter()
    pilot = measure(against.scene, PILOT, against.bounces, mode)
    affordable = seconds / (perf_counter() - start)
    error = np.sqrt(pilot.variance.sum(axis=(0, 1))) / pilot.mean[..., 0].size
    enough = float(((error / pilot.mean.mean(axis=(0, 1)) / TARGET) ** 2).max())
    passes = PILOT * min(affordable, max(enough, 1)) // PASSES
    return check(against, mode, PASSES * int(min(passes, MAX_SPP // PASSES)), seed=1)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False)
    parser.add_argument("--seconds", type=float, default=60, help="for each picture")
    parser.add_argument("--bounces", type=int, default=3)
    return parser.parse_args()


if __name__ == "__main__":
    main()
