"""Records which branches of modules a call takes."""

from __future__ import annotations

import dis
import re
import sys
from collections import defaultdict
from contextlib import contextmanager
from itertools import pairwise
from types import CodeType, FrameType, ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator


Branch = tuple[str, int, int]
"""A file, and the lines before and after a conditional jump."""
_JUMPS_IF = re.compile("JUMP.*_IF|FOR_ITER")
"""Names of instructions that jump or do not."""


class Tracer:
    """Records the branches taken in some modules, and whether a function is entered.

    Attributes
    ----------
    branches
        All branches between different lines.
    taken
        Those that were taken so far.
    entered
        Whether the marked function was entered since :meth:`watching` began.
    """

    def __init__(self, modules: tuple[ModuleType, ...], marker: Callable[..., Any]) -> None:
        self._files = {str(module.__file__) for module in modules}
        self.branches = {branch for file in self._files for branch in _branches_of(file)}
        self._lines: dict[tuple[str, int], set[int]] = defaultdict(set)
        for file, before, after in self.branches:
            self._lines[file, before].add(after)
        self._marker = marker.__code__
        self.taken: set[Branch] = set()
        self.entered = False

    @contextmanager
    def watching(self) -> Iterator[None]:
        """Record branches meanwhile."""
        self.entered = False
        sys.settrace(self._enter)
        try:
            yield
        finally:
            sys.settrace(None)

    def _enter(self, frame: FrameType, event: str, argument: object) -> Any:
        code = frame.f_code
        self.entered = self.entered or code is self._marker
        file = code.co_filename
        if file not in self._files:
            return None
        line = frame.f_lineno

        def follow(frame: FrameType, event: str, argument: object) -> Any:
            nonlocal line
            if event == "line":
                if frame.f_lineno in self._lines.get((file, line), ()):
                    self.taken.add((file, line, frame.f_lineno))
                line = frame.f_lineno
            return follow

        return follow


def _branches_of(file: str) -> Iterator[Branch]:
    with open(file, encoding="utf-8") as stream:
        codes = [compile(stream.read(), file, "exec")]
    for code in codes:  # the list grows meanwhile
        codes += [constant for constant in code.co_consts if isinstance(constant, CodeType)]
        yield from _jumps(file, code)


def _jumps(file: str, code: CodeType) -> Iterator[Branch]:
    lines: dict[int, int] = {}
    for start, stop, line in code.co_lines():
        lines |= dict.fromkeys(range(start, stop, 2), line or 0)
    instructions = list(dis.get_instructions(code))
    for instruction, following in pairwise(instructions):
        if _JUMPS_IF.search(instruction.opname):
            before = lines.get(instruction.offset, 0)
            for offset in (instruction.argval, following.offset):
                after = lines.get(offset, 0)
                if before and after and before != after:
                    yield file, before, after
