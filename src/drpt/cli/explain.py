"""`drpt explain`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from drpt.cli.parser import add_scene, add_transport
from drpt.cli.status import STATUSES, bad_input
from drpt.render import explain
from drpt.scene import load_scene

if TYPE_CHECKING:
    import argparse

    from drpt.cli.parser import Commands


def add(commands: Commands) -> None:
    """Declare the flags."""
    parser = commands.add_parser(
        "explain",
        help="say what is compiled for a scene",
        description="Say what the kernels compiled for a scene contain, and what they leave out.",
        epilog=f"""examples:
  drpt explain cornell-box --bounces 2 --mode explicit
  drpt explain my.toml --bounces 0

exit status: {STATUSES}""",
    )
    add_scene(parser)
    add_transport(parser.add_argument_group("light"))
    parser.set_defaults(parser=parser, run=run)


def run(args: argparse.Namespace) -> int:
    """Print the explanation."""
    with bad_input(args.parser):
        scene = load_scene(args.scene)
        explanation = explain(scene, bounces=args.bounces, mode=args.mode)
    print(explanation)
    return 0
