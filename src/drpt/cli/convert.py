"""`drpt convert`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from drpt.cli.parser import add_display
from drpt.cli.status import STATUSES, bad_input
from drpt.output import READABLE, SUFFIXES, check_target, read, write

if TYPE_CHECKING:
    import argparse

    from drpt.cli.parser import Commands


def add(commands: Commands) -> None:
    """Declare the flags."""
    parser = commands.add_parser(
        "convert",
        help="write a picture in another format",
        description="Write a picture in another format; an .npy has no metadata, others keep it.",
        epilog=f"""examples:
  drpt convert box.exr box.png --exposure 1.5
  drpt convert veach.exr veach.png --curve filmic
  drpt convert mine.npy mine.exr

exit status: {STATUSES}""",
    )
    parser.add_argument(
        "input", metavar="IN", type=Path, help=f"the picture, {' or '.join(READABLE)}"
    )
    parser.add_argument(
        "output", metavar="OUT", type=Path, help=f"where to write it ({', '.join(SUFFIXES)})"
    )
    add_display(parser)
    parser.set_defaults(parser=parser, run=run)


def run(args: argparse.Namespace) -> int:
    """Read the picture and write it."""
    look = {"exposure": args.exposure, "curve": args.curve}
    with bad_input(args.parser):
        check_target(args.output, **look)
        if args.output.suffix.lower() != ".png" and (args.exposure or args.curve != "srgb"):
            raise ValueError(f"{args.output}: exposure and curve are for a .png alone")
        layers, metadata = read(args.input)
    write(args.output, layers.pop("RGB"), metadata, **look, layers=layers)
    return 0
