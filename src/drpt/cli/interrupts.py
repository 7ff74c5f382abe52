"""Ctrl-C and SIGTERM: what they do while a command runs.

Before and after that Ctrl-C ends the process at once, see :mod:`drpt`.
"""

from __future__ import annotations

import signal
import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING

from drpt.cli.status import say

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Request:
    """A signal that has asked for an end, or None yet."""

    def __init__(self) -> None:
        self.signal: signal.Signals | None = None

    @property
    def status(self) -> int:
        """Exit status by which a shell knows the signal; 0 without one."""
        return 0 if self.signal is None else 128 + self.signal


@contextmanager
def interrupts_raised() -> Iterator[None]:
    """Let Ctrl-C raise `KeyboardInterrupt` once, and restore the previous handler.

    During an import it ends the process instead, as some modules take any exception there for a
    missing dependency and continue. An ignored signal stays ignored.
    """
    before = signal.getsignal(signal.SIGINT)

    def interrupt(number: int, frame: FrameType | None) -> None:
        if _imports(frame):
            signal.signal(number, signal.SIG_DFL)
            signal.raise_signal(number)
        signal.signal(number, before)
        raise KeyboardInterrupt

    if before != signal.SIG_IGN:
        signal.signal(signal.SIGINT, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _imports(frame: FrameType | None) -> bool:
    """Whether a frame runs during an import."""
    while frame is not None and "importlib._bootstrap" not in frame.f_code.co_filename:
        frame = frame.f_back
    return frame is not None


@contextmanager
def interrupts_noted(
    after: str = "this pass", leave: Callable[[int], object] = sys.exit
) -> Iterator[Request]:
    """Note the first signal, and say ``after`` what it stops; at the second, ``leave``.

    Signals that were ignored stay so, as Ctrl-C is in what a script runs in the background.
    """
    request = Request()

    def note(number: int, _: FrameType | None) -> None:
        if request.signal is None:
            request.signal = signal.Signals(number)
            say(f"stopping after {after}; once more stops at once")
        elif number == signal.SIGINT:
            leave(request.status)
        else:
            signal.raise_signal(signal.SIGINT)  # which waits for Dr.Jit

    before = {number: signal.getsignal(number) for number in SIGNALS}
    heeded = [number for number in SIGNALS if before[number] != signal.SIG_IGN]
    for number in heeded:
        signal.signal(number, note)
    try:
        yield request
    finally:
        for number in heeded:
            signal.signal(number, before[number])
