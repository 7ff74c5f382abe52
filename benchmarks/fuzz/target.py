"""A fuzzing target: how to make inputs, what to call, and what the call may raise."""

from __future__ import annotations

from dataclasses import dataclass
from random import Random
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path
    from types import ModuleType


@dataclass(frozen=True)
class Target:
    """A way into drpt.

    Attributes
    ----------
    name
        What it is called on the command line.
    suffix
        End of the name of the file that holds an input.
    make
        Makes an input, mostly a valid file that was changed; the same for the same random state.
    call
        Reads the file as drpt's users do.
    allowed
        Exceptions that may come out of the call. Their message is one line of printable
        characters, and names the file.
    past_parser
        A function that the call enters only where the parser of the format has let a file through.
    modules
        Modules whose branches are counted.
    """

    name: str
    suffix: str
    make: Callable[[Random], bytes]
    call: Callable[[Path], object]
    allowed: tuple[type[Exception], ...]
    past_parser: Callable[..., Any]
    modules: tuple[ModuleType, ...]

    def input(self, seed: int, index: int) -> bytes:
        """Return the input of a number in the sequence of a seed."""
        return self.make(Random(f"{self.name} {seed} {index}"))
