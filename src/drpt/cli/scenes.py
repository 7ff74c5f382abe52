"""`drpt scenes`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from drpt.cli.status import STATUSES
from drpt.scene.builtin import builtin_descriptions

if TYPE_CHECKING:
    import argparse

    from drpt.cli.parser import Commands


def add(commands: Commands) -> None:
    """Declare the flags."""
    parser = commands.add_parser(
        "scenes",
        help="list the built-in scenes",
        description="List the built-in scenes: the name that drpt-render takes, and what it shows.",
        epilog=f"""examples:
  drpt scenes
  drpt scenes | grep cornell

exit status: {STATUSES}""",
    )
    parser.set_defaults(parser=parser, run=run)


def run(_: argparse.Namespace) -> int:
    """Print a line for each scene."""
    descriptions = builtin_descriptions()
    width = max(map(len, descriptions))
    for name, description in descriptions.items():
        print(f"{name:{width}}  {description}")
    return 0
