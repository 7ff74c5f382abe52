"""Facets cut into patches: cells of a rectangular grid in the plane of each (host)."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from drpt.kernel.facets import Facet

    Array: TypeAlias = NDArray[np.float64]

PATCHES = 256
"""About so many patches have the size of all facets together; a small facet is one of its own."""
COLUMNS = 8
"""A facet has so many columns of patches at the most, along its longest edge.

The numbers of the patches of a row follow each other; those of the next row begin so much later.
"""
ROWS = 16
"""A facet has so many rows of patches at the most."""
MOST_ROWS = 96
"""All facets together."""
ROOM = 2.0**-16
"""By which a grid is wider than its facet, relative to the coordinates: edges may be rounded."""


class Patches(NamedTuple):
    """Patches of some facets, numbered from `COLUMNS` on; many numbers before and amid are free.

    Attributes
    ----------
    facet
        To which one each patch (n,) belongs, -1 for none.
    corner, right, up
        Lowest corner and edges (n, 3) of each patch; 0 for none.
    frames
        Rows (4,) for each facet, two of them: the products of the first with a point (x, y, z, 1)
        is the column of its patch, of the second its row among all rows.
    """

    facet: NDArray[np.intp]
    corner: Array
    right: Array
    up: Array
    frames: Array

    @property
    def there(self) -> NDArray[np.intp]:
        """Numbers (k,) of the patches that there are."""
        return np.flatnonzero(self.facet >= 0)

    @property
    def area(self) -> Array:
        """Area (n,) of each patch."""
        return np.asarray(np.linalg.norm(np.cross(self.right, self.up), axis=1))


class _Grid(NamedTuple):
    """The rectangle around a facet from ``corner``, cut into cells that span ``right`` and ``up``.

    There are so many ``columns`` and ``rows`` of them, the first of which is row ``first`` of all.
    """

    corner: Array
    right: Array
    up: Array
    columns: int
    rows: int
    first: int

    def frame(self) -> Array:
        """The rows of `Patches.frames`."""
        right, up = (edge / (edge @ edge) for edge in (self.right, self.up))
        return np.array([[*right, -right @ self.corner], [*up, self.first - up @ self.corner]])


def make_patches(facets: Sequence[Facet]) -> Patches:
    """Cut facets into patches of about the same size."""
    grids = _make_grids([facet.corners for facet in facets], [_axes(facet) for facet in facets])
    total = COLUMNS * (grids[-1].first + grids[-1].rows)
    of_facet, (corner, right, up) = np.full(total, -1), np.zeros((3, total, 3))
    for facet, grid in enumerate(grids):
        row, column = np.divmod(np.arange(grid.rows * grid.columns), grid.columns)
        numbers = COLUMNS * (grid.first + row) + column
        of_facet[numbers], right[numbers], up[numbers] = facet, grid.right, grid.up
        corner[numbers] = grid.corner + column[:, None] * grid.right + row[:, None] * grid.up
    return Patches(of_facet, corner, right, up, np.array([grid.frame() for grid in grids]))


def _make_grids(outlines: list[Array], axes: list[Array]) -> list[_Grid]:
    """Grids of about the same cells, the rows of which follow those of the grid before."""
    extents = np.array([np.ptp(o @ a.T, axis=0) for o, a in zip(outlines, axes, strict=True)])
    size = np.sqrt(extents.prod(axis=1).sum() / PATCHES)
    while (counts := _cells(extents, size))[:, 1].sum() > max(MOST_ROWS, len(outlines)):
        size *= np.sqrt(2)
    ends = 1 + np.cumsum(counts[:, 1])
    numbers = np.column_stack([counts, ends - counts[:, 1]]).tolist()
    return [_grid(o, a, *n) for o, a, n in zip(outlines, axes, numbers, strict=True)]


def _cells(extents: Array, size: float) -> NDArray[np.intp]:
    return np.clip(np.round(extents / size), 1, (COLUMNS, ROWS)).astype(np.intp)


def _axes(facet: Facet) -> Array:
    """Directions (2, 3) of the longest edge, and across it in the plane."""
    edges = np.roll(facet.corners, -1, axis=0) - facet.corners
    along = edges[np.linalg.norm(edges, axis=1).argmax()]
    along = along / np.linalg.norm(along)
    return np.array([along, np.cross(facet.normal, along)])


def _grid(outline: Array, axes: Array, columns: int, rows: int, first: int) -> _Grid:
    room = ROOM * np.abs(outline).max()
    local = outline @ axes.T
    low, high = local.min(axis=0) - room, local.max(axis=0) + room
    right, up = axes * ((high - low) / (columns, rows))[:, None]
    corner = outline[0] + (low - local[0]) @ axes
    return _Grid(corner, right, up, columns, rows, first)
