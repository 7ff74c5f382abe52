"""Run the stress suite, print a Markdown table, and exit with 1 if any case fails.

python -m benchmarks.stress [AREA ...] [--quick | --long] [--plot FOLDER]
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from benchmarks.stress import AREAS
from benchmarks.stress.harness import HEADER, notes, plot, row, run


def main() -> int:
    """Run the areas that are asked for."""
    args = _arguments()
    cases = [case for area in args.areas or AREAS for case in AREAS[area]]
    print(HEADER)
    passed = True
    for case in cases:
        points = []
        for point in run(case, quick=args.quick, long=args.long):
            print(row(point), flush=True)
            points.append(point)
        passed &= all(point.passed for point in points)
        if args.plot:
            plot(points, args.plot)
    print(f"\n{notes(cases)}")
    return 0 if passed else 1


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.stress", description=__doc__, allow_abbrev=False
    )
    parser.add_argument(
        "areas", nargs="*", metavar="AREA", help=f"of {', '.join(AREAS)}; all if none is named"
    )
    length = parser.add_mutually_exclusive_group()
    length.add_argument("--quick", action="store_true", help="fewer values and samples")
    length.add_argument("--long", action="store_true", help="1e9 rays in each closed room")
    parser.add_argument("--plot", metavar="FOLDER", type=Path, help="draw each sweep as a PNG")
    args = parser.parse_args()
    for area in args.areas:
        if area not in AREAS:
            parser.error(f"AREA: {area!r} is not allowed; it must be one of {', '.join(AREAS)}")
    if args.plot:
        args.plot.mkdir(parents=True, exist_ok=True)
    return args


if __name__ == "__main__":
    sys.exit(main())
