"""Fair shares of a thread's time: whoever asks for much delays nobody but themselves.

Start-time fair queueing (Goyal, Vin and Cheng 1996), with the time that a step took in place of a
packet's length, which is charged afterwards: a compilation cannot be interrupted, and nobody knows
before how long it takes. What is new here is a lead for what somebody waits for.
"""

from __future__ import annotations

from enum import IntEnum
from math import inf
from typing import TYPE_CHECKING, Generic, TypeVar

if TYPE_CHECKING:
    from collections.abc import Mapping

T = TypeVar("T")

MAX_DEBT = 2.5
"""Seconds of use for which somebody waits at most, however long a step took: so many seconds each
of the others gets meanwhile. Most compilations are shorter."""


class Urgency(IntEnum):
    """How much somebody waits for a step."""

    REFINE = 0
    """A picture that is seen gets better."""
    CHANGE = 1
    """What was asked for is done."""
    SHOW = 2
    """A picture that is there, and that was not seen yet, is sent."""


LEAD = {Urgency.REFINE: 0.0, Urgency.CHANGE: 0.5, Urgency.SHOW: inf}
"""By how many seconds of use a step comes before others: a change is seen soon, but whoever asks
for one after the other gets no more time than the others. What is shown has been paid for."""


class Shares(Generic[T]):
    """Who of some members is served next."""

    def __init__(self) -> None:
        self._used: dict[T, float] = {}
        self._now = 0.0

    @property
    def members(self) -> list[T]:
        """All members."""
        return list(self._used)

    def join(self, member: T) -> None:
        """Add a member, which has used as much as whoever waits and has used least."""
        self._used[member] = self._now

    def leave(self, member: T) -> None:
        """Remove a member, if it is there."""
        self._used.pop(member, None)

    def charge(self, member: T, seconds: float) -> None:
        """Count the time that a member has used, up to `MAX_DEBT`, unless it has left."""
        if member in self._used:
            self._used[member] = min(self._used[member] + seconds, self._now + MAX_DEBT)

    def next(self, waiting: Mapping[T, Urgency]) -> T | None:
        """Return the member to serve next, of those that wait.

        Whoever did not wait before saves no time for later: it starts at the present.
        """
        if not waiting:
            return None
        for member in waiting:
            self._used[member] = max(self._used[member], self._now)
        self._now = min(self._used[member] for member in waiting)
        return min(waiting, key=lambda member: self._used[member] - LEAD[waiting[member]])
