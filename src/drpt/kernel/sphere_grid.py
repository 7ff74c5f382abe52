"""Many spheres: a grid of cells, which a ray crosses one after the other.

Source: Amanatides & Woo 1987, "A Fast Voxel Traversal Algorithm for Ray Tracing".
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import drjit as dr
import numpy as np

from drpt.kernel.camera import Ray
from drpt.kernel.cells import DIGIT_BITS, LINKS, rows_of
from drpt.kernel.meet import Ball, meet_sphere
from drpt.kernel.vec import gather_row, greater, lesser, types_of, vec3

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

    from drjit.auto import Array3f, Array3u, Bool, Float, UInt32
    from numpy.typing import NDArray

    from drpt.kernel.cells import Cells
    from drpt.kernel.sphere_tree import Visit

    Array = NDArray[np.float64]
    Ints = NDArray[np.intp]

AFAR = 2.0**-20
"""By which a walk starts before the grid, and a ray may miss it, relative to the distance there."""
_EXPONENT = 0x7F800000
"""Bits that the exponent of a floating-point number has."""


class _Walk(NamedTuple):
    """Where a walk is: at a row of a cell, which the ray enters at ``t``; and what it has found.

    ``sides`` are how far it is along the ray to the next side of the cell along each axis.
    """

    t: Float
    row: UInt32
    cell: UInt32
    sides: Array3f
    end: Float
    found: UInt32


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
        rows = rows_of(cells, spheres, numbers - numbers[0])
        self._words = upload(rows.words)
        self._first = int(numbers[0])
        self._numbers = upload(numbers[rows.spheres].astype(np.uint32))
        self._spheres = upload(spheres[rows.spheres])
        self._low, self._high, self._width, self._per_width = (
            types.Array3f(*(dr.opaque(types.Float32, float(x)) for x in corner))
            for corner in (cells.low, cells.high, cells.width, 1 / cells.width)
        )
        self._last, self._strides = (
            types.Array3u(*(dr.opaque(types.UInt32, int(x)) for x in counts))
            for counts in (cells.counts - 1, cells.strides)
        )

    def walk(
        self,
        ray: Ray,
        active: Bool,
        end: Float,
        found: UInt32,
        visit: Visit,
        but: UInt32 | None = None,
    ) -> tuple[Float, UInt32]:
        """Visit the spheres that may be met before an ``end``, which the visits may bring nearer.

        ``visit(number, met, t, end, found)`` gets a sphere's number, whether and where the ray
        meets it, and what an earlier visit has returned; the walk is over where the end is before
        the origin. The sphere with the number ``but`` is not visited.

        Distances are measured from where the ray enters the grid, so that from afar the cells are
        where the spheres are.
        """
        types = types_of(end)
        near, far = self._span(ray)
        active = active & (near <= lesser(far * (1 + AFAR), end)) & (near < dr.inf)
        start = dr.select(active, near * (1 - AFAR), 0)
        ray = Ray(dr.fma(ray.direction, start, ray.origin), ray.direction)
        _, leaves = self._span(ray)
        cell, sides, widths, strides = self._enter(ray)
        digits = None if but is None else self._digits(but)

        def step(*state: Any) -> tuple[Any, ...]:
            walk = _Walk(*state)
            close, link = self._look(walk.row, ray, digits)

            def meet(end: Float, found: UInt32) -> tuple[Float, UInt32]:
                sphere = gather_row(self._spheres, walk.row, 4, close)
                met, t = meet_sphere(ray, Ball(vec3(*sphere[:3]), sphere[3]))
                number = dr.gather(types.UInt32, self._numbers, walk.row, close)
                return visit(number, met, t + start, end, found)

            end, found = dr.if_stmt((walk.end, walk.found), close, meet, lambda *state: state)
            crosses = link == 0
            t = lesser(lesser(walk.sides.x, walk.sides.y), walk.sides.z)
            # Over an edge at once: what lies near it is in the cells before and after it, too.
            over = crosses & (walk.sides == t)
            cell = walk.cell + dr.sum(dr.select(over, strides, types.Array3u(0)))
            row = dr.select(crosses, cell, link)
            sides = dr.select(over, walk.sides + widths, walk.sides)
            t = dr.select(crosses, t, walk.t)
            return tuple(_Walk(t, row, cell, sides, end, found))

        def goes_on(*state: Any) -> Bool:
            walk = _Walk(*state)
            return active & (walk.t < lesser(leaves, walk.end - start))

        first: tuple[Any, ...] = _Walk(types.Float32(0), cell, cell, sides, end, found)
        last = _Walk(*dr.while_loop(tuple(first), goes_on, step))
        return last.end, last.found

    def _span(self, ray: Ray) -> tuple[Float, Float]:
        """Where a ray enters and leaves the grid, or the second before the first; at 0 inside."""
        near: Any = types_of(ray.origin.x).Float32(0)
        far: Any = types_of(ray.origin.x).Float32(dr.inf)
        for axis in range(3):
            inverse = dr.rcp(ray.direction[axis])
            low, high = (
                (corner[axis] - ray.origin[axis]) * inverse for corner in (self._low, self._high)
            )
            near = greater(dr.select(inverse > 0, low, high), near)
            far = lesser(dr.select(inverse > 0, high, low), far)
        return near, far

    def _enter(self, ray: Ray) -> tuple[UInt32, Array3f, Array3f, Array3u]:
        """The cell where a ray starts, and for each axis how it goes on from there.

        That is how far it is along the ray to the first side of a cell, and from there to the next
        one, and by how much the number of the cell changes.
        """
        types = types_of(ray.origin.x)
        place = dr.floor((ray.origin - self._low) * self._per_width)
        place = dr.maximum(0, dr.minimum(place, types.Array3f(self._last)))
        upward = ray.direction > 0
        side = dr.fma(place + dr.select(upward, 1, 0), self._width, self._low)
        inverse = dr.rcp(ray.direction)
        away = dr.select(ray.direction == 0, dr.inf, (side - ray.origin) * inverse)
        strides = dr.select(upward, self._strides, -self._strides)
        cell = dr.dot(types.Array3u(place) + 1, self._strides)
        return cell, away, dr.abs(self._width * inverse), strides

    def _digits(self, number: UInt32) -> Array3u:
        """What the coordinates of a sphere end with in its rows; of none, if it is not in there."""
        mark = dr.minimum(number - self._first, LINKS - 1)
        return types_of(number).Array3u(mark, mark >> DIGIT_BITS, mark >> 2 * DIGIT_BITS)

    def _look(self, row: UInt32, ray: Ray, but: Array3u | None) -> tuple[Bool, UInt32]:
        """Whether a row's sphere is close to the line of a ray, and the next row of the cell.

        Spheres whose coordinates end with the digits ``but`` are not.
        """
        types = types_of(ray.origin.x)
        x, y, z, word = gather_row(self._words, row, 4)
        bits = (x, y, z, (word >> 1) & _EXPONENT)
        numbers: Any = [dr.reinterpret_array(types.Float32, number) for number in bits]
        spoke = ray.origin - vec3(*numbers[:3])
        aside = dr.fma(ray.direction, -dr.dot(spoke, ray.direction), spoke)
        close = dr.squared_norm(aside) < numbers[3]
        if but is not None:
            differ = (x ^ but.x) | (y ^ but.y) | (z ^ but.z)
            close &= (differ & (2**DIGIT_BITS - 1)) != 0
        return close, word & (LINKS - 1)
