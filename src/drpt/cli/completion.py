"""`drpt completion`."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from drpt.cli.parser import Parser
from drpt.cli.status import STATUSES
from drpt.output import CURVES
from drpt.render import SAMPLERS, Mode
from drpt.scene.builtin import builtin_names

if TYPE_CHECKING:
    from drpt.cli.parser import Commands

WORDS = {"mode": tuple(Mode), "sampler": SAMPLERS, "curve": CURVES}
"""What the values of arguments may be, where argparse is not the one to refuse others."""
SCENES = {
    "bash": '_drpt_files_and_scenes() {{ compgen -f -W "{}" -- "$1"; }}',
    "zsh": "_drpt_files_and_scenes() {{ _alternative 'scene:scene:({})' 'file:file:_files' }}",
}
"""Functions of the shells that complete the names of scenes and of their files."""


def add(commands: Commands) -> None:
    """Declare the flags."""
    parser = commands.add_parser(
        "completion",
        help="print a script that lets a shell complete commands",
        description="""Print a script with which the Tab key completes commands, flags and values of
drpt and drpt-render.""",
        epilog=f"""examples:
  eval "$(drpt completion bash)"             in this bash
  drpt completion zsh > ~/.drpt-completion   and in ~/.zshrc, after compinit:
  eval "$(cat ~/.drpt-completion)"

exit status: {STATUSES}""",
    )
    parser.add_argument("shell", metavar="SHELL", choices=tuple(SCENES), help=" or ".join(SCENES))
    parser.set_defaults(parser=parser, run=run)


def run(args: argparse.Namespace) -> int:
    """Print the script."""
    import shtab

    scenes = SCENES[args.shell].format(" ".join(builtin_names()))
    for parser, prefix in _programs():
        _complete_values(parser)
        print(shtab.complete(parser, args.shell, prefix, scenes))
    return 0


def _programs() -> tuple[tuple[Parser, str], tuple[Parser, str]]:
    """`drpt` and `drpt-render`, and prefixes of their functions in a shell."""
    from drpt.cli import make_parser, render  # which import this module

    drpt = make_parser()
    commands = Parser().add_subparsers()
    render.add(commands)
    return (drpt, "drpt"), (commands.choices["render"], "render")


def _complete_values(parser: argparse.ArgumentParser) -> None:
    """Tell shtab by its attributes what the values of arguments are."""
    import shtab

    for action in parser._actions:  # shtab reads them, too
        if isinstance(action, argparse._SubParsersAction):
            for subparser in action.choices.values():
                _complete_values(subparser)
        elif action.dest == "scene":
            action.complete = dict.fromkeys(SCENES, "_drpt_files_and_scenes")  # type: ignore[attr-defined]
        elif action.dest in WORDS:
            action.choices = WORDS[action.dest]
        elif action.type is Path:
            action.complete = shtab.FILE  # type: ignore[attr-defined]
