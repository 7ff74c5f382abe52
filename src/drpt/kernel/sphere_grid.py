"""Many spheres: a grid of cells, which a ray crosses one after the other.

Source: Amanatides & Woo 1987, "A Fast Voxel Traversal Algorithm for Ray Tracing"; here several
cursors take the cells by turns, none of which waits for the rows of another.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from operator import or_
from typing import TYPE_CHECKING, Any, NamedTuple

import drjit as dr

from drpt.kernel.camera import Ray
from drpt.kernel.cells import DIGIT_BITS, LINKS, SLACK, rows_of
from drpt.kernel.meet import Ball, meet_box, meet_sphere
from drpt.kernel.vec import gather_row, lesser, types_of, vec3

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

    import numpy as np
    from drjit.auto import Array3f, Array3u, Bool, Float, UInt32
    from numpy.typing import NDArray

    from drpt.kernel.cells import Cells
    from drpt.kernel.scene_geometry import Visit

    Array = NDArray[np.float64]
    Ints = NDArray[np.intp]

AFAR = 2.0**-20
"""By which a walk starts before the grid, and a ray may miss it, relative to the distance there.

Rounding moves no ray by more.
"""
BEFORE = 1 / 4
"""By which it starts before the grid at the most, relative to the size of that.

A ray that is still farther off then, by rounding, has come from so far away that the grid is
smaller than what its direction tells apart.
"""
CURSORS = 3
"""Rows that a ray looks at at once: while those of one come from memory, others are at work."""
_EXPONENT = 0x7F800000
"""Bits that the exponent of a floating-point number has."""
_NO_ROW = 0
"""That of a cell on the sides, where no sphere is."""


class _Cell(NamedTuple):
    """A cell, and how far it is along a ray to the next side of it along each axis."""

    number: UInt32
    sides: Array3f


class _Cursor(NamedTuple):
    """A row of a cell, which the ray enters at ``t``."""

    row: UInt32
    t: Float


class _Look(NamedTuple):
    """Whether a row's sphere is close to the line of a ray, and the next row of its cell, or 0."""

    close: Bool
    link: UInt32


@dataclass
class _Course:
    """How a ray goes from cell to cell, until it ``leaves`` the grid.

    For each axis, how far it is along the ray from one side to the next, and by how much the number
    of the cell changes there.
    """

    leaves: Float
    widths: Array3f
    strides: Array3u

    def next_cell(self, cell: _Cell, where: Bool) -> tuple[_Cell, _Cursor]:
        """The next cell for the lanes ``where`` that is wanted, and a cursor at its first row."""
        sides = cell.sides
        t = lesser(lesser(sides.x, sides.y), sides.z)
        # Over an edge at once: what lies near it is in the cells before and after it, too.
        over = where & (sides == t)
        number = cell.number + dr.sum(dr.select(over, self.strides, type(self.strides)(0)))
        row = dr.select(t < self.leaves, number, _NO_ROW)
        return _Cell(number, dr.select(over, sides + self.widths, sides)), _Cursor(row, t)

    def next_row(self, cell: _Cell, cursor: _Cursor, link: UInt32) -> tuple[_Cell, _Cursor]:
        """Move a cursor to the next row of its cell, else to the next cell; returns also that."""
        crosses = link == 0
        cell, first = self.next_cell(cell, crosses)
        row, t = dr.select(crosses, first.row, link), dr.select(crosses, first.t, cursor.t)
        return cell, _Cursor(row, t)


class SphereGrid:
    """Spheres (n, 4) as centres and radii, numbered by ``numbers`` (n,), in their cells."""

    def __init__(
        self,
        cells: Cells,
        spheres: Array,
        numbers: Ints,
        types: ModuleType,
        upload: Callable[[NDArray[Any]], Any],
    ) -> None:
        self.afar = False
        rows = rows_of(cells, spheres, numbers)
        self._words, self._spheres, self._numbers = (upload(table) for table in rows)
        self._first = int(numbers[0])
        self._center, self._low, self._high, self._width, self._per_width = (
            types.Array3f(*(dr.opaque(types.Float32, float(x)) for x in vector))
            for vector in (cells.center, cells.low, cells.high, cells.width, 1 / cells.width)
        )
        self._last, self._strides = (
            types.Array3u(*(dr.opaque(types.UInt32, int(x)) for x in counts))
            for counts in (cells.counts - 1, cells.strides)
        )
        self._size = dr.opaque(types.Float32, float((cells.high - cells.low).max()))

    def walk(
        self,
        ray: Ray,
        active: Bool,
        end: Float,
        found: UInt32,
        visit: Visit,
        but: UInt32 | None = None,
    ) -> tuple[Float, UInt32]:
        """As all `ManySpheres` do.

        On the way distances are measured from where the ray enters the grid, and coordinates from
        its centre, so that from afar the cells are where the spheres are.
        """
        origin = ray.origin - self._center
        near, far = self._span(Ray(origin, ray.direction))
        active = active & (near <= lesser(far * (1 + AFAR), end)) & (near < dr.inf)
        start = dr.select(active, near - lesser(near * AFAR, self._size * BEFORE), 0)
        way = Ray(dr.fma(ray.direction, start, origin), ray.direction)
        enters, leaves = self._span(way)
        active &= enters < self._size
        cell, course = self._enter(way, leaves)
        room = (1 + 1 / SLACK) * dr.square(AFAR * (start + self._size))
        digits = None if but is None else self._digits(but)

        def step(place: Any, end: Float, found: UInt32, *state: Any) -> tuple[Any, ...]:
            cell, cursors = _Cell(*place), [_Cursor(*cursor) for cursor in state]
            looks = [self._look(cursor.row, way, room, digits) for cursor in cursors]

            def meet(end: Float, found: UInt32) -> tuple[Float, UInt32]:
                for cursor, look in zip(cursors, looks, strict=True):
                    number, met, t = self._meet(cursor.row, ray, look.close)
                    end, found = visit(number, met, t, end, found)
                return end, found

            any_close = reduce(or_, (look.close for look in looks))
            end, found = dr.if_stmt((end, found), any_close, meet, lambda *state: state)
            for k, look in enumerate(looks):
                cell, cursors[k] = course.next_row(cell, cursors[k], look.link)
            return tuple(cell), end, found, *map(tuple, cursors)

        def goes_on(_: Any, end: Float, __: UInt32, *cursors: Any) -> Bool:
            hindmost = reduce(lesser, (_Cursor(*cursor).t for cursor in cursors))
            return active & (hindmost < lesser(course.leaves, end - start))

        cursors = [_Cursor(cell.number, types_of(end).Float32(0))]
        while len(cursors) < CURSORS:
            cell, cursor = course.next_cell(cell, active)
            cursors.append(cursor)
        state: tuple[Any, ...] = (tuple(cell), end, found, *map(tuple, cursors))
        _, end, found, *_ = dr.while_loop(state, goes_on, step)
        return end, found

    def _span(self, ray: Ray) -> tuple[Float, Float]:
        return meet_box(ray.origin, dr.rcp(ray.direction), self._low, self._high, dr.inf)

    def _enter(self, ray: Ray, leaves: Float) -> tuple[_Cell, _Course]:
        """The cell where a ray starts, and how it goes on from there."""
        types = types_of(ray.origin.x)
        place = dr.floor((ray.origin - self._low) * self._per_width)
        place = dr.maximum(0, dr.minimum(place, types.Array3f(self._last)))
        upward = ray.direction > 0
        side = dr.fma(place + dr.select(upward, 1, 0), self._width, self._low)
        inverse = dr.rcp(ray.direction)
        away = dr.select(ray.direction == 0, dr.inf, (side - ray.origin) * inverse)
        number = dr.dot(types.Array3u(place) + 1, self._strides)
        strides = dr.select(upward, self._strides, -self._strides)
        return _Cell(number, away), _Course(leaves, dr.abs(self._width * inverse), strides)

    def _digits(self, number: UInt32) -> Array3u:
        """What the coordinates of a sphere end with in its rows; of none, if it is not in there."""
        mark = dr.minimum(number - self._first, LINKS - 1)
        return types_of(number).Array3u(mark, mark >> DIGIT_BITS, mark >> 2 * DIGIT_BITS)

    def _look(self, row: UInt32, ray: Ray, room: Float, but: Array3u | None) -> _Look:
        """Look at a row; spheres whose coordinates end with the digits ``but`` are not close.

        There is so much ``room``, a square, for what rounding moves rays by.
        """
        types = types_of(ray.origin.x)
        x, y, z, word = gather_row(self._words, row, 4)
        bits = (x, y, z, (word >> 1) & _EXPONENT)
        numbers: Any = [dr.reinterpret_array(types.Float32, number) for number in bits]
        spoke = ray.origin - vec3(*numbers[:3])
        aside = dr.fma(ray.direction, -dr.dot(spoke, ray.direction), spoke)
        close = dr.squared_norm(aside) - room < numbers[3]
        if but is not None:
            differ = (x ^ but.x) | (y ^ but.y) | (z ^ but.z)
            close &= (differ & (2**DIGIT_BITS - 1)) != 0
        return _Look(close, word & (LINKS - 1))

    def _meet(self, row: UInt32, ray: Ray, close: Bool) -> tuple[UInt32, Bool, Float]:
        """The number of a row's sphere, and whether and where a ray that is close meets it."""
        sphere = gather_row(self._spheres, row, 4, close)
        met, t = meet_sphere(ray, Ball(vec3(*sphere[:3]), sphere[3], afar=self.afar))
        return dr.gather(type(row), self._numbers, row, close), close & met, t
