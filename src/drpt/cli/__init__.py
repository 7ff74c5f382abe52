"""The command line: flags to calls, nothing else.

A subcommand is a module with two functions, and an entry in `COMMANDS`: ``add(commands)`` declares
its flags, ``run(args)`` does what they say and returns the exit status.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from drpt.cli import (
    check,
    compare,
    completion,
    convert,
    doctor,
    explain,
    gallery,
    merge,
    render,
    scenes,
    view,
)
from drpt.cli.interrupts import interrupts_raised
from drpt.cli.parser import Parser, add_version
from drpt.cli.status import (
    FAILED,
    INTERRUPTED,
    drop_stdout,
    one_line_warnings,
    print_anything,
    say,
)
from drpt.kernel import backend

if TYPE_CHECKING:
    import argparse
    from collections.abc import Sequence

COMMANDS = (
    render,
    view,
    compare,
    merge,
    convert,
    gallery,
    check,
    scenes,
    explain,
    doctor,
    completion,
)
"""In the order in which ``drpt --help`` lists them."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run `drpt` and return its exit status.

    Raises
    ------
    SystemExit
        With status 2 on bad usage or a bad scene, with 0 after ``--help`` and ``--version``.
    """
    program, unread = "drpt", 0
    try:
        with interrupts_raised():
            print_anything()
            args = _parse(argv)
            program, unread = args.parser.prog, getattr(args, "unread", 0)
            with one_line_warnings(program):
                status: int = args.run(args)
            print(end="", flush=True)
    except KeyboardInterrupt:
        say(f"{program}: interrupted")
        return INTERRUPTED
    except BrokenPipeError:
        drop_stdout()
        return unread
    except (OSError, MemoryError, backend.BackendError) as error:
        say(f"{program}: error: {error}")
        return FAILED
    return status


def render_main(argv: Sequence[str] | None = None) -> int:
    """Run `drpt-render`, which is `drpt render`, and return its exit status."""
    return main(["render", *(sys.argv[1:] if argv is None else argv)])


def make_parser() -> Parser:
    """Return the parser of `drpt`, with all subcommands."""
    parser = Parser(
        prog="drpt",
        description="A small, fast, exact path tracer.",
        epilog="""first steps:
  drpt scenes                               scenes to choose from
  drpt render cornell-box -o cornell.png    a picture
  drpt render --help                        all that can be set

exit status: 0; 1 if the run failed, or as COMMAND --help says; 2 for bad input;
130 after Ctrl-C""",
    )
    add_version(parser)
    commands = parser.add_subparsers(metavar="COMMAND", required=True)
    for command in COMMANDS:
        command.add(commands)
    return parser


def _parse(argv: Sequence[str] | None) -> argparse.Namespace:
    args, unknown = make_parser().parse_known_args(argv)
    if unknown:
        args.parser.error(f"unknown arguments: {' '.join(unknown)}")
    return args
