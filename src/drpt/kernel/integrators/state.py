"""The state of a path between two vertices."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from drpt.kernel.camera import Ray

if TYPE_CHECKING:
    from drjit.auto import Array3f, Bool, Float, UInt32


class Path(NamedTuple):
    """A path that has reached a ray towards its next vertex."""

    origin: Array3f
    direction: Array3f
    active: Bool  # whether there is a next vertex
    beta: Array3f  # throughput up to it
    normal: Array3f  # shading normal where the ray starts, for MIS
    pdf: Float  # density of BSDF samples in its direction; infinite if no light sample finds it
    guide: tuple[Any, ...]  # state of the strategy that chose its direction
    radiance: Array3f  # collected so far
    rays: UInt32  # traced so far

    @property
    def ray(self) -> Ray:
        """The ray towards the next vertex."""
        return Ray(self.origin, self.direction)
