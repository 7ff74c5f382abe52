"""Measure drpt beside Mitsuba 3 and NumPy; some twenty minutes, or one or two with --quick.

Writes results.json, results.md and plots. Areas that are not named keep the results that the
folder has, if they come from the same machine and versions. Let nothing else run meanwhile.
"""

from __future__ import annotations

import argparse
import json
import os
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from benchmarks.bench import error_against_time, growth, scaling, startup, throughput
from benchmarks.bench.effort import FULL, QUICK
from benchmarks.bench.machine import machine, versions
from benchmarks.bench.plots import plot_error, plot_scaling
from benchmarks.bench.report import report, summary

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from benchmarks.bench.effort import Effort

AREAS = ("startup", "throughput", "error", "growth", "scaling", "targets")
"""Start-up comes first, while this process is small; targets are made of the others."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure the areas, write everything, and print the targets."""
    args = _arguments(arguments)
    args.output.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as kernels:  # of this run alone, so that first calls do compile
        os.environ["DRJIT_CACHE_DIR"] = kernels
        os.environ["DRPT_BACKEND"] = "llvm"
        results = measure(args.areas or AREAS, QUICK if args.quick else FULL, args.output)
    (args.output / "results.md").write_text(report(results))
    if results.get("error"):
        plot_error(results["error"], args.output / "error.png")
    if results.get("scaling"):
        plot_scaling(results["scaling"], args.output / "scaling.png")
    print(summary(results))


def measure(areas: Sequence[str], effort: Effort, output: Path) -> dict[str, Any]:
    """Measure the areas in their order, and write what there is after each part of them."""
    path = output / "results.json"
    conditions = {"machine": machine(), "versions": versions(), "quick": effort.quick}
    results = merged(path, conditions)

    def keep(area: str, found: Any) -> None:
        results[area] = found
        path.write_text(json.dumps(results, indent=1) + "\n")

    measures: dict[str, Callable[[], Any]] = {
        "startup": lambda: startup.measure_all(effort),
        "throughput": lambda: throughput.measure_all(effort),
        "error": lambda: error_against_time.measure_all(
            effort, output / "references", partial(keep, "error")
        ),
        "growth": lambda: growth.measure_all(effort),
        "scaling": lambda: scaling.measure_all(effort),
    }
    for area, measure_area in measures.items():
        if area in areas:
            keep(area, measure_area())
    return results


def merged(path: Path, measured: dict[str, Any]) -> dict[str, Any]:
    """Add to the results of a file, if they were measured under the same conditions."""
    if not path.exists():
        return measured
    previous: dict[str, Any] = json.loads(path.read_text())
    same = all(previous[key] == measured[key] for key in ("machine", "versions", "quick"))
    return {**previous, **measured} if same else measured


def _arguments(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.bench", description=__doc__, allow_abbrev=False
    )
    parser.add_argument(
        "areas", nargs="*", metavar="AREA", help=f"of {', '.join(AREAS)}; all if none is named"
    )
    parser.add_argument("--quick", action="store_true", help="one scene, short axes, few samples")
    parser.add_argument(
        "-o", "--output", type=Path, default=Path("out/bench"), metavar="FOLDER", help="%(default)s"
    )
    args = parser.parse_args(arguments)
    for area in args.areas:
        if area not in AREAS:
            parser.error(f"AREA: {area!r} is not allowed; it must be one of {', '.join(AREAS)}")
    return args


if __name__ == "__main__":
    main()
