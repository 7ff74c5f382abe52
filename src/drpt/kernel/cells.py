"""Cells of a grid, in which spheres lie (host)."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Ints = NDArray[np.intp]

DENSITY = 0.7
"""Spheres for each cell, about: with fewer there are more cells to cross, with more, to look at."""
LONGEST = 512
"""Cells along an axis at the most."""
SHARES = 8
"""Cells that a sphere lies in at the most, on average."""
ROOM = 2.0**-14
"""By which spheres are larger for their cells, relative to the grid.

That is twice what a ray's distances to cells' sides are off, as sums of up to `LONGEST` terms, if
it starts at the grid.
"""
SLACK = 1 / 16
"""By which squares of radii are larger, so that as many more squares of rounding are room for it.

That is (r + δ)² ≤ (1 + ε) r² + (1 + 1/ε) δ².
"""
FAR = 2.0**30
"""How far from the origin spheres are at the most, relative to the grid, for float64."""
LINKS = 2**24
"""Rows that a word has room to tell apart, beside an exponent."""
DIGIT_BITS = 8
"""Of each coordinate in a row, for a digit of the sphere's mark: 24 in all three."""
_MANTISSA_BITS, _EXPONENT_OF_1 = 23, 127
"""Of a floating-point number of 32 bits."""


class Cells(NamedTuple):
    """A box between two corners (3,), cut into ``counts`` (3,) cells; in which of them spheres lie.

    There is one more cell on each side, which is empty. ``cell`` and ``sphere`` are the numbers of
    each pair (n,) of a cell and a sphere in it, in the order of the cells. Corners are relative to
    the ``center`` (3,), whose coordinates have 32 bits.
    """

    center: Array
    low: Array
    high: Array
    counts: Ints
    cell: Ints
    sphere: Ints

    @property
    def width(self) -> Array:
        """Of a cell along each axis, (3,)."""
        return np.asarray((self.high - self.low) / self.counts)

    @property
    def strides(self) -> Ints:
        """By how much numbers of neighbours along each axis differ, (3,)."""
        return _strides(self.counts)

    @property
    def total(self) -> int:
        """How many cells there are, those on the sides included."""
        return int((self.counts + 2).prod())

    def local(self, spheres: Array) -> Array:
        """Spheres (n, 4) as the device knows them, relative to the centre."""
        return _of_32_bits(spheres) - np.append(self.center, 0)

    @property
    def crowd(self) -> float:
        """How many spheres lie in a cell where a sphere lies, on average."""
        numbers = np.bincount(self.cell)
        return float(np.square(numbers).sum() / numbers.sum())


def cut(spheres: Array) -> Cells | None:
    """Cells for spheres (n, 4); none where too many of them lie in many cells, or they are too far.

    Also where a word has no room for the numbers of all rows.
    """
    spheres = _of_32_bits(spheres)
    low, high = _corners(spheres)
    longest = (high - low).max()
    if np.abs([low, high]).max() > FAR * longest:
        return None
    center = _of_32_bits((low + high) / 2)
    centers, radii = spheres[:, :3] - center, spheres[:, 3:]
    low, high = low - center, high - center
    room = ROOM * longest
    low, high = low - 2 * room, high + 2 * room
    counts = _counts(high - low, len(spheres) / DENSITY)
    width = (high - low) / counts
    first = np.floor((centers - radii - room - low) / width).astype(np.intp)
    last = np.floor((centers + radii + room - low) / width).astype(np.intp)
    sizes = last - first + 1
    shares = sizes.prod(axis=1)
    if shares.sum() > SHARES * len(spheres) or (counts + 2).prod() + shares.sum() > LINKS:
        return None
    sphere = np.repeat(np.arange(len(spheres)), shares)
    number = np.arange(len(sphere)) - np.repeat(np.cumsum(shares) - shares, shares)
    x, y, _ = sizes[sphere].T
    offsets = np.column_stack([number % x, number // x % y, number // (x * y)])
    cell = (first[sphere] + offsets + 1) @ _strides(counts)
    order = np.argsort(cell, kind="stable")
    return Cells(center, low, high, counts, cell[order], sphere[order])


def _corners(spheres: Array) -> tuple[Array, Array]:
    """Of the box around spheres (n, 4)."""
    centers, radii = spheres[:, :3], spheres[:, 3:]
    return (centers - radii).min(axis=0), (centers + radii).max(axis=0)


def _of_32_bits(numbers: Array) -> Array:
    return numbers.astype(np.float32).astype(np.float64)


def _counts(extent: Array, cells: float) -> Ints:
    """How many cells along each axis, about cubes and so many in all, or fewer of a long box."""
    width = (extent.prod() / cells) ** (1 / 3)
    return np.clip(np.round(extent / width), 1, LONGEST).astype(np.intp)


def _strides(counts: Ints) -> Ints:
    return np.array([1, counts[0] + 2, (counts[0] + 2) * (counts[1] + 2)])


class Rows(NamedTuple):
    """What a grid has at hand of the spheres in its cells.

    ``words`` (n, 4) are the bits of a sphere's centre, the last of each coordinate a digit of its
    mark, and a word: the exponent of a power of two that is above the square of the radius around
    there, by `SLACK`, and the number of the row where there is another one in the same cell, or 0.
    Those of cells that have no sphere are 0. These centres are relative to the grid's; ``spheres``
    (n, 4) are the spheres as they are, and ``numbers`` (n,) theirs.

    A mark is a sphere's number, counted from the first one. There are fewer than `LINKS` of them,
    as there are more rows than that.
    """

    words: NDArray[np.uint32]
    spheres: Array
    numbers: NDArray[np.uint32]


def rows_of(cells: Cells, spheres: Array, numbers: Ints) -> Rows:
    """Rows of all cells, each with the first sphere in it, then those of the other ones."""
    first = np.diff(cells.cell, prepend=-1) > 0
    others = len(first) - first.sum()
    row = cells.cell.copy()
    row[~first] = cells.total + np.arange(others)
    link = np.append(np.where(first[1:], 0, row[1:]), 0)
    words = np.zeros((cells.total + others, 4), np.uint32)
    words[row] = _words(cells.local(spheres), numbers - numbers[0])[cells.sphere]
    words[row, 3] += link.astype(np.uint32)
    in_row = np.zeros(len(words), np.intp)
    in_row[row] = cells.sphere
    return Rows(words, spheres[in_row], numbers[in_row].astype(np.uint32))


def _words(spheres: Array, marks: Ints) -> NDArray[np.uint32]:
    """Words (n, 4) of spheres, as in a row without a link."""
    centers, radii = spheres[:, :3], spheres[:, 3]
    bits = np.float32(centers).view(np.uint32)
    digits = marks[:, None] >> DIGIT_BITS * np.arange(3)
    bits ^= ((bits ^ digits) % 2**DIGIT_BITS).astype(np.uint32)
    # A digit and rounding change a coordinate by less than a unit of the place before the digit.
    moved = 2.0 ** (DIGIT_BITS - _MANTISSA_BITS) * np.linalg.norm(centers, axis=1)
    _, exponents = np.frexp(np.square(radii + moved) * (1 + SLACK))
    return np.column_stack([bits, (exponents + _EXPONENT_OF_1) * LINKS]).astype(np.uint32)
