"""`drpt merge`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from drpt.cli.status import STATUSES, bad_input
from drpt.merging import merge, seeds
from drpt.output import check_target, write

if TYPE_CHECKING:
    import argparse

    from drpt.cli.parser import Commands


def add(commands: Commands) -> None:
    """Declare the flags."""
    parser = commands.add_parser(
        "merge",
        help="add up renders with different seeds",
        description="""Add up renders of a scene with different seeds, such as those of several
machines, to one that has all of their samples, and its estimated error. Scene, size, bounces and
jitter must be the same; spp, mode and sampler may differ. What was merged can be merged again.""",
        epilog=f"""examples:
  drpt render veach --seed 1 -o 1.exr
  drpt render veach --seed 2 -o 2.exr
  drpt merge 1.exr 2.exr -o veach.exr

exit status: {STATUSES}""",
    )
    parser.add_argument(
        "pictures", metavar="IN", type=Path, nargs="+", help="a render, .exr, with its metadata"
    )
    parser.add_argument(
        "-o", "--output", metavar="OUT", type=Path, required=True, help="where to write it, .exr"
    )
    parser.set_defaults(parser=parser, run=run)


def run(args: argparse.Namespace) -> int:
    """Write what was merged, and say what it is."""
    with bad_input(args.parser):
        if args.output.suffix.lower() != ".exr":
            raise ValueError(f"{args.output}: the name of a merged picture must end with .exr")
        check_target(args.output)
        layers, metadata = merge(args.pictures)
    image = layers.pop("RGB")
    write(args.output, image, metadata, layers=layers)
    error = f"relMSE {metadata['error']:.2g}" if "error" in metadata else "relMSE unknown"
    height, width, _ = image.shape
    facts = f"{width}x{height}", f"{metadata['spp']} spp", _count(seeds(metadata)), error
    print("  ".join(facts), args.output, sep="\n")
    return 0


def _count(seeds: list[str]) -> str:
    return "1 seed" if len(seeds) == 1 else f"{len(seeds)} seeds"
