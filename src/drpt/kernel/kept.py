"""Results that are kept for the next calls with the same arguments."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Generic, TypeVar, TypeVarTuple

from drpt.immutable import with_own_arrays

if TYPE_CHECKING:
    from collections.abc import Callable

Args = TypeVarTuple("Args")
R = TypeVar("R")

KEPT = 2
"""Results that are kept: of two scenes, so that they can be rendered by turns."""


class Kept(Generic[*Args, R]):
    """A function that keeps its last results, told apart by their positional arguments.

    Those are the same if they are identical or equal. The function gets, and a result is kept with,
    arguments whose arrays the caller cannot reach. Unlike `functools.lru_cache` this takes no
    hash of them, which would take longer than to render what has a million shapes.
    """

    def __init__(self, make: Callable[[*Args], R]) -> None:
        self.make = make
        self._results: list[tuple[tuple[Any, ...], R]] = []

    def __call__(self, *args: *Args) -> R:
        """Return what was made from these arguments, or make it."""
        kept = (entry for entry in self._results if _same(entry[0], args))
        entry = next(kept, None) or self._made(*args)
        others = [other for other in self._results if other is not entry]
        self._results = [entry, *others][:KEPT]
        return entry[1]

    def _made(self, *args: *Args) -> tuple[tuple[Any, ...], R]:
        own = with_own_arrays(args)
        return own, self.make(*own)

    def forget(self) -> None:
        """Keep nothing of what there is."""
        self._results = []


def _same(some: tuple[Any, ...], others: tuple[Any, ...]) -> bool:
    return all(one is other or one == other for one, other in zip(some, others, strict=True))
