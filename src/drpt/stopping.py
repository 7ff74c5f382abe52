"""When a render has had enough samples."""

from __future__ import annotations

from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

from drpt.settings import check_positive

if TYPE_CHECKING:
    from collections.abc import Callable

LEAST_SPP = 64
"""With fewer samples, whatever is rare in a picture may not have happened yet, and is no error."""
FASTEST = 3
"""An error falls with this power of the samples at the most, so that it need not be asked for."""


class Stopping:
    """Stops a render when its error is small enough, or its time is over.

    Parameters
    ----------
    target_error
        relMSE that is small enough, or None.
    time_limit
        Seconds from :meth:`start` on, or None.

    Attributes
    ----------
    last_look
        After how many samples the error was asked for last, and what it was.
    """

    def __init__(self, target_error: float | None, time_limit: float | None) -> None:
        self._target = _optional("target_error", target_error)
        self._limit = _optional("time_limit", time_limit)
        self._start = perf_counter()
        self.last_look: tuple[int, float] | None = None

    @property
    def may_come(self) -> bool:
        """Whether there is anything that stops it."""
        return self._target is not None or self._limit is not None

    @property
    def has_target(self) -> bool:
        """Whether an error stops it."""
        return self._target is not None

    def start(self) -> None:
        """Begin to count the time."""
        self._start = perf_counter()

    def has_come(self, spp: int, error: Callable[[], float]) -> bool:
        """Whether to stop after so many samples; ``error()`` is asked for where it may be."""
        if self._limit is not None and perf_counter() - self._start >= self._limit:
            return True
        if self._target is None or spp < self._next_look(self._target):
            return False
        self.last_look = spp, error()
        return self.is_enough(self.last_look[1])

    def is_enough(self, error: float) -> bool:
        """Whether an error is small enough."""
        return self._target is not None and error <= self._target

    def expected_spp(self, spp: int, seconds: float, error: float) -> float:
        """About after how many samples it stops, given the seconds of one and the error of ``spp``.

        The error is taken to fall as 1 / samples, as that of independent ones does.
        """
        left = np.inf if self._limit is None else self._limit - (perf_counter() - self._start)
        by_time = spp + max(left, 0) / seconds
        by_error = spp * error / self._target if self._target and error > 0 else np.inf
        return float(max(spp, min(by_time, by_error)))

    def _next_look(self, target: float) -> float:
        """Samples from which on the error is worth to be asked for."""
        if self.last_look is None or not target < self.last_look[1] < np.inf:
            return LEAST_SPP
        spp, error = self.last_look
        least: float = spp * (error / target) ** (1 / FASTEST)
        return least


def _optional(name: str, value: float | None) -> float | None:
    return None if value is None else check_positive(name, value)
