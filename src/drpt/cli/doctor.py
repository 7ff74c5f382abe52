"""`drpt doctor`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from drpt import doctor

if TYPE_CHECKING:
    import argparse

    from drpt.cli.parser import Commands


def add(commands: Commands) -> None:
    """Declare the flags."""
    parser = commands.add_parser(
        "doctor",
        help="say what was found on this machine",
        description="""Say what drpt found on this machine (LLVM, threads, CUDA, the folder of
compiled kernels, versions), render a pixel whose value is known, and say what to do about
problems.""",
        epilog="""examples:
  drpt doctor
  DRPT_BACKEND=llvm drpt doctor        what the CPU alone would do

exit status: 0 if drpt can render; 1 if not; 2 for bad input""",
    )
    parser.set_defaults(parser=parser, run=run)


def run(_: argparse.Namespace) -> int:
    """Print the report."""
    return doctor.main()
