"""How the spheres of a scene are met: one by one, in the cells of a grid, or by a tree (host)."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from drpt.kernel.cells import Cells, cut

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

SPHERE_LIMIT = 24
"""Up to so many spheres are met one by one in the kernel, where a grid is as fast.

That is of small ones, which are 2 in a cell; for each one more it takes as many spheres again.
"""
CROWDED_LIMIT = 64
"""Up to so many are at the most: kernels of more take longer to compile than most renders."""
STANDOUTS = 8
"""Up to so many that stand out are met one by one, so that those in a hierarchy are all small."""
STANDING_OUT = 8
"""So many times as large as the middle one is a sphere that stands out."""
CROWD = 12
"""Up to so many spheres in the cells where they lie, a grid is as fast as a tree."""


class SphereLayout(NamedTuple):
    """Numbers of the spheres that are met one by one, and of the others; the cells of these.

    Without cells, the others stand in a tree.
    """

    single: NDArray[np.intp]
    many: NDArray[np.intp]
    cells: Cells | None


def lay_out(spheres: Array) -> SphereLayout:
    """How rows (n, 4) of (centre, radius) are met."""
    numbers, radii = np.arange(len(spheres)), spheres[:, 3]
    one_by_one = SphereLayout(numbers, numbers[:0], None)
    if len(spheres) <= SPHERE_LIMIT:
        return one_by_one
    single = radii > STANDING_OUT * np.median(radii)
    if single.sum() > STANDOUTS:
        single[:] = False
    many = numbers[~single]
    cells = cut(spheres[many])
    crowd = np.inf if cells is None else cells.crowd
    if len(many) <= min(CROWDED_LIMIT, SPHERE_LIMIT * max(1, crowd - 1)):
        return one_by_one
    return SphereLayout(numbers[single], many, cells if crowd <= CROWD else None)
