"""Fuzz one way into drpt: ``python -m benchmarks.fuzz scenes --minutes 60 --seed 1``."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from benchmarks.fuzz.harness import OUT, fuzz
from benchmarks.fuzz.worker import load

TARGETS = ("checkpoints", "exr", "meshes", "mitsuba", "scenes")
"""Modules of this package, each with a ``TARGET``."""


def main() -> int:
    """Run a target, print the report, and fail if there are faults."""
    parser = argparse.ArgumentParser("python -m benchmarks.fuzz", description=__doc__)
    parser.add_argument("target", choices=TARGETS)
    parser.add_argument("--minutes", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--inputs", type=int, help="stop after this number of inputs")
    parser.add_argument("--write", type=int, metavar="INDEX", help="write that input to stdout")
    args = parser.parse_args()
    if args.write is not None:
        sys.stdout.buffer.write(load(args.target).input(args.seed, args.write))
        return 0
    report = fuzz(args.target, args.seed, seconds=60 * args.minutes, inputs=args.inputs)
    for index, fault in list(report.faults.items())[:10]:
        print(f"input {index}, kept in {Path(OUT).resolve()}: {fault}")
    print(report)
    return 1 if report.faults else 0


if __name__ == "__main__":
    sys.exit(main())
