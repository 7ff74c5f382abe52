"""Whether two checkouts render the same bits, with kernels of as many operations.

``python -m benchmarks.same_bits OTHER_CHECKOUT`` renders the built-in scenes by every mode with 0
to 4 bounces, in both checkouts. It prints what differs, and exits with 1 if anything does.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from itertools import product
from pathlib import Path
from typing import Any, TypeAlias

Picture: TypeAlias = dict[str, Any]
"""A checksum of the bits, how many rays they took, and the operations of the kernel."""

MODES = ("implicit-uniform", "implicit", "explicit-uniform", "explicit", "mis", "guided")
BOUNCES = tuple(range(5))
THIS = Path(__file__).resolve().parents[1]

RENDER = """
import hashlib, json, sys
from dataclasses import replace
import drpt

width, height, spp = 32, 24, 4
for line in sys.stdin:
    name, mode, bounces = json.loads(line)
    scene = drpt.load_scene(name)
    camera = replace(scene.camera, width=width, height=height)
    scene = drpt.Scene(camera=camera, shapes=scene.shapes)
    result = drpt.render(scene, spp, bounces, mode)
    bits = hashlib.sha256(result.image.tobytes() + result.standard_error.tobytes()).hexdigest()
    operations = drpt.explain(scene, bounces, mode).operations
    facts = {"image": bits[:12], "rays": result.rays, "operations": operations}
    print(json.dumps(facts), flush=True)
"""
"""The script that a checkout runs with its own package; all versions have its names."""


def main() -> int:
    """Render, and print a table of the differences."""
    args = _arguments()
    cases = list(product(args.scenes, args.modes, args.bounces))
    here, there = (_start(checkout, cases) for checkout in (THIS, args.other))
    print("| scene | mode | bounces | image | rays | operations there | here |")
    print("|---|---|--:|---|---|--:|--:|")
    different = 0
    for case in cases:
        one, other = _next(there), _next(here)
        if one != other:
            different += 1
            print(_row(case, one, other), flush=True)
    print(f"\n{different} of {len(cases)} pictures differ in bits, rays or operations")
    return 1 if different else 0


def _start(checkout: Path, cases: list[tuple[str, str, int]]) -> subprocess.Popen[str]:
    """A process that renders one case after the other by the package of a checkout.

    It runs in the checkout's own environment, if that has been made.
    """
    package = checkout / "src"
    if not (package / "drpt").is_dir():
        sys.exit(f"same_bits: {checkout} is no checkout of drpt: it has no folder src/drpt")
    own = checkout / ".venv/bin/python"
    process = subprocess.Popen(
        [own if own.exists() else sys.executable, "-c", RENDER],
        env={**os.environ, "PYTHONPATH": str(package)},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdin
    process.stdin.write("".join(json.dumps(case) + "\n" for case in cases))
    process.stdin.close()
    return process


def _next(process: subprocess.Popen[str]) -> Picture:
    assert process.stdout
    if line := process.stdout.readline():
        return dict(json.loads(line))
    sys.exit("same_bits: a checkout could not render; what it says stands above")


def _row(case: tuple[str, str, int], one: Picture, other: Picture) -> str:
    image, rays = (
        "same" if one[name] == other[name] else "**differs**" for name in ("image", "rays")
    )
    cells = *map(str, case), image, rays, str(one["operations"]), str(other["operations"])
    return f"| {' | '.join(cells)} |"


def _arguments() -> argparse.Namespace:
    from drpt.scene.builtin import builtin_names

    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.same_bits", description=__doc__, allow_abbrev=False
    )
    parser.add_argument("other", type=Path, help="folder of the other checkout")
    parser.add_argument("--scenes", nargs="+", default=builtin_names(), help="all by default")
    parser.add_argument("--modes", nargs="+", choices=MODES, default=MODES, metavar="MODE")
    parser.add_argument("--bounces", nargs="+", type=int, default=BOUNCES, help="0 to 4 by default")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
