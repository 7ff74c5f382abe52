"""How the spheres of a scene are met: one by one, in the cells of a grid, or by a tree (host)."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from drpt.kernel.cells import Cells, cut

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

SPHERE_LIMIT = 32
"""Up to so many spheres are met one by one in the kernel, where a grid is as fast."""
STANDOUTS = 8
"""Up to so many that stand out are met one by one, so that those in a hierarchy are all small."""
STANDING_OUT = 8
"""So many times as large as the middle one is a sphere that stands out."""
CROWD = 7
"""Up to so many spheres in the cells where they lie, a grid is as fast as a tree.

Small spheres that are spread evenly have two.
"""


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
    if len(spheres) <= SPHERE_LIMIT:
        return SphereLayout(numbers, numbers[:0], None)
    single = radii > STANDING_OUT * np.median(radii)
    if single.sum() > STANDOUTS:
        single[:] = False
    many = numbers[~single]
    cells = cut(spheres[many])
    if cells is not None and cells.crowd > CROWD:
        cells = None
    return SphereLayout(numbers[single], many, cells)
