"""The number of a vertex in a path."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from drjit.auto import UInt32


@dataclass(frozen=True)
class Depth:
    """The number of a vertex, 0 for the first one that camera rays hit.

    A vertex that is unrolled has an int, so that its facts are known when the kernel is compiled.
    In a loop, or where lanes are at different vertices, the number is an array, and so are the
    facts. Code for what is certainly not the case is left out of the kernel: ask ``may_…`` before.

    Parameters
    ----------
    number
        Of the vertex.
    bounces
        Number of vertices that may reflect.
    vertices
        Number of vertices; the last one may do no more than emit.
    """

    number: int | UInt32
    bounces: int
    vertices: int

    @property
    def is_first(self) -> Any:
        """Whether a camera ray leads to the vertex."""
        return self.number == 0

    @property
    def reflects(self) -> Any:
        """Whether light may be reflected at the vertex."""
        return self.number < self.bounces

    @property
    def has_next(self) -> Any:
        """Whether there is a vertex after this one."""
        return self.number < self.vertices - 1

    @property
    def next_reflects(self) -> Any:
        """Whether light may be reflected at the vertex after this one."""
        return self.number + 1 < self.bounces

    @property
    def may_be_first(self) -> bool:
        """Whether some lanes may be at their first vertex."""
        return self.is_first is not False

    @property
    def may_be_later(self) -> bool:
        """Whether some lanes may be beyond their first vertex."""
        return self.is_first is not True

    @property
    def may_reflect(self) -> bool:
        """Whether some lanes may reflect light at the vertex."""
        return self.reflects is not False

    @property
    def only_emits(self) -> bool:
        """Whether all lanes are beyond the first vertex, and at one that reflects nothing."""
        return (self.number == self.bounces) is True and not self.may_be_first

    @property
    def bounces_after_next(self) -> Any:
        """Number of vertices after the next one that may reflect light."""
        return self.bounces - (self.number + 1)

    def dimension(self, decision: int) -> Any:
        """Dimension of the sampler for a decision: light (0), point on it (1), direction (2)."""
        return 1 + 3 * self.number + decision


LIGHT, POINT, DIRECTION = range(3)
"""Decisions at a vertex."""
