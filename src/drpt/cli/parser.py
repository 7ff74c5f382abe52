"""The parser, the types of its values, and the flags that several subcommands share."""

from __future__ import annotations

import argparse
import re
import sys
from contextlib import suppress
from typing import TYPE_CHECKING, Any, NoReturn, TypeAlias

from drpt.cli.status import BAD_INPUT, say
from drpt.distribution import VERSION
from drpt.render import SAMPLERS, Mode

if TYPE_CHECKING:
    from collections.abc import Sequence

    Commands: TypeAlias = "argparse._SubParsersAction[Parser]"

MAX_THREADS = 1024
"""More than the cores of a machine; the system refuses to start very many more."""


class Parser(argparse.ArgumentParser):
    """A parser whose errors are one line, and whose flags are written in full."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(
            allow_abbrev=False, formatter_class=argparse.RawDescriptionHelpFormatter, **settings
        )

    def error(self, message: str) -> NoReturn:
        """Say what is wrong with the input, and leave."""
        say(f"{self.prog}: error: {message.removeprefix('argument ')}")
        sys.exit(BAD_INPUT)

    def _print_message(self, message: str, file: Any = None) -> None:
        print(message, end="", file=file, flush=True)  # argparse would swallow an OSError


def integer(text: str) -> int:
    """Return a whole number in ASCII digits."""
    with suppress(ValueError):  # Python reads no thousands of digits
        if re.fullmatch("[+-]?[0-9]+", text):
            return int(text)
    raise argparse.ArgumentTypeError(f"{text!r} is not an integer")


def thread_count(text: str) -> int:
    """Return a whole number from 1 to `MAX_THREADS`."""
    count = integer(text)
    if not 1 <= count <= MAX_THREADS:
        allowed = f"a whole number from 1 to {MAX_THREADS}"
        raise argparse.ArgumentTypeError(f"{count} is not allowed; it must be {allowed}")
    return count


def number(text: str) -> float:
    """Return any number that Python reads, NaN and infinity among them."""
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number") from None


def add_version(parser: Parser) -> None:
    """Add ``--version``."""
    parser.add_argument(
        "--version",
        action="version",
        version=f"%(prog)s {VERSION}",
        help="say the version",
    )


def add_scene(parser: Parser) -> None:
    """Add the argument ``SCENE``."""
    parser.add_argument(
        "scene", metavar="SCENE", help="a built-in scene (drpt scenes lists them) or a scene file"
    )


def add_size(group: argparse._ActionsContainer) -> None:
    """Add ``--width`` and ``--height``; see `drpt.Scene.resized`."""
    for side, other in (("width", "height"), ("height", "width")):
        group.add_argument(
            f"--{side}",
            metavar="N",
            type=integer,
            help=f"pixels (default: the scene's; with --{other} alone, by its aspect ratio)",
        )


def add_display(group: argparse._ActionsContainer) -> None:
    """Add ``--exposure`` and ``--curve``."""
    group.add_argument(
        "--exposure",
        metavar="STOPS",
        type=number,
        default=0.0,
        help="brighten a .png by so many stops (default: 0)",
    )
    group.add_argument(
        "--curve",
        metavar="C",
        default="srgb",
        help="how a .png shows bright radiance: srgb clips it, filmic rolls it off "
        "(default: %(default)s)",
    )


def add_transport(group: argparse._ActionsContainer, modes: Sequence[str] = tuple(Mode)) -> None:
    """Add ``--bounces`` and ``--mode``."""
    group.add_argument(
        "--bounces",
        metavar="N",
        type=integer,
        default=3,
        help="how often light bounces at most: 0 shows the lights, 1 adds what they light, "
        "2 one indirect bounce, ... (default: 3)",
    )
    group.add_argument(
        "--mode",
        metavar="M",
        default="mis",
        help=f"how light is found: {', '.join(modes)} (default: %(default)s)",
    )


def add_sampling(group: argparse._ActionsContainer, spp: int = 64) -> None:
    """Add ``--spp``, ``--sampler`` and ``--seed``."""
    group.add_argument(
        "--spp",
        metavar="N",
        type=integer,
        default=spp,
        help="samples per pixel; more give less noise (default: %(default)s)",
    )
    group.add_argument(
        "--sampler",
        metavar="S",
        default="sobol",
        help=f"{', '.join(SAMPLERS)} (default: %(default)s)",
    )
    group.add_argument(
        "--seed",
        metavar="N",
        type=integer,
        default=0,
        help="another number gives other noise (default: %(default)s)",
    )
