"""What every kind of emitter offers: samples of directions to it, and their densities.

A light is an emitter with a number, the row of which has its shape, radiance and area.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, Protocol

import drjit as dr

from drpt.kernel.vec import gather_row, greater

if TYPE_CHECKING:
    from types import ModuleType

    from drjit.auto import Array2f, Array3f, Array4f, Float, UInt32

    from drpt.kernel.camera import Ray
    from drpt.kernel.intersect import Hit


class Receiver(NamedTuple):
    """A point of a surface, and the shading normal there, on the side that is to be lit."""

    point: Array3f
    normal: Array3f


class DirectionSample(NamedTuple):
    """A direction to a light, the distance to it, and 1 / density per solid angle; 0 if unlit."""

    direction: Array3f
    distance: Float
    inverse_pdf: Float


class LightRow(NamedTuple):
    """Shape of a light, (normal, offset) or (centre, radius), its radiance and area."""

    shape: Array4f
    radiance: Array3f
    area: Float


@dataclass
class LightRows:
    """Rows of 8 by light; ``only`` is that of a single light, which lanes need not gather."""

    types: ModuleType
    rows: Float
    only: LightRow | None

    def of(self, light: UInt32) -> LightRow:
        """The row of a light."""
        return self.only or light_row(gather_row(self.rows, light, 8), self.types)


def light_row(numbers: list[Float], types: ModuleType) -> LightRow:
    """The row that eight numbers make."""
    return LightRow(types.Array4f(*numbers[:4]), types.Array3f(*numbers[4:7]), numbers[7])


class EmitterKind(Protocol):
    """Emitters of one kind, with consecutive numbers."""

    count: int

    def sample(self, at: Receiver, light: UInt32, u: Array2f, *, visible: bool) -> DirectionSample:
        """Solid angle: a direction from a receiver to a light.

        With ``visible``, samples keep to the part of its surface that faces the receiver, if the
        kind can; else they are uniform on the whole surface.
        """
        ...

    def inverse_pdf(self, at: Receiver, light: UInt32, ray: Ray, hit: Hit) -> Float:
        """1 / density with which visible samples find a receiver's ray that hits the light."""
        ...


def direction_to(point: Array3f, target: Array3f, normal: Array3f, area: Float) -> DirectionSample:
    """Direction to a point that is uniform on an area; only its front emits."""
    way = target - point
    distance = dr.norm(way)
    direction = way / distance
    cosine = greater(-dr.dot(direction, normal), 0)
    return DirectionSample(direction, distance, area * cosine / dr.square(distance))
