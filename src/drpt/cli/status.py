"""Exit statuses, and how errors become one line and one of them."""

from __future__ import annotations

import io
import os
import sys
import warnings
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterator

FAILED = 1
BAD_INPUT = 2
INTERRUPTED = 130
TERMINATED = 143

STATUSES = f"0; {FAILED} if the run failed; {BAD_INPUT} for bad input; {INTERRUPTED} after Ctrl-C"
"""For the help of a subcommand to which nothing else applies."""


@contextmanager
def bad_input(parser: argparse.ArgumentParser) -> Iterator[None]:
    """Turn what is wrong with the input into the parser's error."""
    try:
        yield
    except OSError as error:
        named = error.filename and error.strerror
        parser.error(f"{error.filename}: {error.strerror}" if named else str(error))
    except (ValueError, ImportError) as error:
        parser.error(str(error))


@contextmanager
def one_line_warnings(program: str) -> Iterator[None]:
    """Print each warning on one line, without its place in the code."""
    with warnings.catch_warnings():
        warnings.showwarning = lambda message, *_, **__: say(f"{program}: warning: {message}")
        yield


def say(line: str) -> None:
    """Print a line to stderr, which may be nobody's any more."""
    with suppress(OSError):
        print(*line.splitlines(), file=sys.stderr)


def print_anything() -> None:
    """Let stdout and stderr escape characters that their encoding lacks, as in file names."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # not None, nor what a caller has put there
            stream.reconfigure(errors="backslashreplace")


def drop_stdout() -> None:
    """Send what is left in stdout nowhere: its reader has gone, and Python would complain."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
