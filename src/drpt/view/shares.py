"""Divides a thread's time fairly, so that expensive requests delay only their own session.

This is start-time fair queueing (Goyal, Vin and Cheng 1996). The time of a step replaces the length
of a packet, and is charged afterwards: a compilation cannot be interrupted, and its time is not
known in advance. In addition, urgent steps get a lead.
"""

from __future__ import annotations

from enum import IntEnum
from math import inf
from typing import TYPE_CHECKING, Generic, TypeVar

if TYPE_CHECKING:
    from collections.abc import Mapping

T = TypeVar("T")

MAX_DEBT = 2.5
"""Largest debt of a member in seconds, however long its step took. Meanwhile each other member gets
at most this time. Most compilations are shorter."""


class Urgency(IntEnum):
    """How urgently a user waits for a step."""

    REFINE = 0
    """A visible picture gets more samples."""
    CHANGE = 1
    """A request is handled."""
    SHOW = 2
    """A first picture, which is ready, is sent."""


LEAD = {Urgency.REFINE: 0.0, Urgency.CHANGE: 0.5, Urgency.SHOW: inf}
"""Lead of a step before others, in seconds of use. A change is visible soon, but many changes get
no more time than other members. The time for a first picture has been charged already."""


class Shares(Generic[T]):
    """Decides which of several members is served next."""

    def __init__(self) -> None:
        self._used: dict[T, float] = {}
        self._now = 0.0

    @property
    def members(self) -> list[T]:
        """All members."""
        return list(self._used)

    def join(self, member: T) -> None:
        """Add a member, with the same use as the waiting member that has used least."""
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

        A member that did not wait before cannot save time: its use is raised to the present.
        """
        if not waiting:
            return None
        for member in waiting:
            self._used[member] = max(self._used[member], self._now)
        self._now = min(self._used[member] for member in waiting)
        return min(waiting, key=lambda member: self._used[member] - LEAD[waiting[member]])
