"""Path guiding: where paths that leave a patch of a surface are likely to find reflected light.

Of the directions in which a path goes on from a diffuse facet, one share follows the BRDF; the
others lead to a point of a patch, chosen by the light that patches are known to send each other.
With the densities p of the BRDF's directions and q of the patches' points, both per solid angle, a
path that arrives at a point has the weight f cos θ / ((1 − c) p + c q), however it was chosen; one
that was aimed at a point and meets another facet before is lost (Veach & Guibas 1995, the balance
heuristic for one sample). So what is known may be wrong: weights stay below 1 / (1 − c). Module
`guide_share` has the share c.

Source: Jensen 1995, "Importance Driven Path Tracing using the Photon Map", for the idea; patches
are those of radiosity.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import drjit as dr
import numpy as np

from drpt.kernel.patches import COLUMNS
from drpt.kernel.vec import gather_row, vec2, vec3

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

    from drjit.auto import Array2f, Array3f, Bool, Float, UInt32
    from numpy.typing import NDArray

    from drpt.kernel.intersect import Hit
    from drpt.kernel.patches import Patches

    Array = NDArray[np.float64]

SLOTS = 1024
"""A patch's chance to be chosen is a multiple of 1 / this, so that it is exact."""
NOWHERE = 0xFFFFFFFF
"""Number of no facet; that of no patch is 0."""
_BITS = 10
_MASK = 2**_BITS - 1


class Spot(NamedTuple):
    """A point of a patch, the facet that has it, and the patch's area."""

    point: Array3f
    facet: UInt32
    area: Float


class DevicePatches:
    """Patches as kernels see them, to find points of them.

    ``upload`` brings numbers to the device, to memory from which rows are gathered in one piece.
    """

    def __init__(
        self, patches: Patches, types: ModuleType, upload: Callable[[Array], Float]
    ) -> None:
        self.types = types
        corner = np.column_stack([patches.corner, patches.facet])
        right = np.column_stack([patches.right, patches.area])
        up = np.pad(patches.up, ((0, 0), (0, 5)))
        self._rows = upload(np.concatenate([corner, right, up], axis=1))

    def spot(self, patch: UInt32, u: Array2f, active: Any = True) -> Spot:
        """Area: a point of a patch, uniform."""
        types = self.types
        row = gather_row(self._rows, patch, 16, active)
        corner, right, up = row[:4], row[4:8], row[8:]
        point = [dr.fma(right[k], u.x, dr.fma(up[k], u.y, corner[k])) for k in range(3)]
        return Spot(vec3(*point), types.UInt32(corner[3]), right[3])


class Guide:
    """Where a path may go from each patch of a scene.

    Parameters
    ----------
    patches
        Patches of the scene's facets.
    light
        How much light arrives at each of the patches that there are from each other, (k, k).
    types, upload
        The backend, and what brings numbers there, to memory from which rows are gathered.
    """

    def __init__(
        self, patches: Patches, light: Array, types: ModuleType, upload: Callable[[Array], Float]
    ) -> None:
        self.patches = patches
        self.types = types
        self._facets, self._patches = len(patches.frames), len(patches.facet)
        there, area = patches.there, patches.area[patches.there]
        counts = share_out(_known(light, area), SLOTS)
        density = np.zeros((self._patches, self._patches), np.float32)
        density[np.ix_(there, there)] = counts / (SLOTS * area)
        self._density = types.Float32(density.ravel())
        slots = np.zeros((self._patches, SLOTS), np.uint32)
        slots[there] = _slots(counts, there)
        self._slots = types.UInt32(slots.ravel())
        self._frames = upload(patches.frames)
        self._goals = DevicePatches(patches, types, upload)

    def patch_of(self, hit: Hit) -> UInt32:
        """The patch of a hit; 0 where that is not on a facet."""
        types, p = self.types, hit.point
        on_facet = hit.valid & (hit.primitive < self._facets)
        f = gather_row(self._frames, hit.primitive, 8, on_facet)
        column, row = (
            dr.fma(r[0], p.x, dr.fma(r[1], p.y, dr.fma(r[2], p.z, r[3]))) for r in (f[:4], f[4:])
        )
        inside = (column >= 0) & (column < COLUMNS) & (row >= 0) & (row < self._patches // COLUMNS)
        patch = types.UInt32(dr.fma(dr.floor(row), COLUMNS, column))
        return dr.select(inside, patch, 0)

    def aim(
        self, patch: UInt32, point: Array3f, u: Array2f, active: Bool
    ) -> tuple[Array3f, UInt32]:
        """Area: the direction from a point of a patch to one of another, and the facet there."""
        types = self.types
        x = u.x * SLOTS
        word = dr.gather(types.UInt32, self._slots, patch * SLOTS + types.UInt32(x), active)
        goal, start, more = word & _MASK, (word >> _BITS) & _MASK, word >> (2 * _BITS)
        within = (x - types.Float32(start)) / (types.Float32(more) + 1)
        spot = self._goals.spot(goal, vec2(within, u.y), active)
        return dr.normalize(spot.point - point), spot.facet

    def density(self, patch: UInt32, goal: UInt32) -> Float:
        """Area: the density of the points that :meth:`aim` finds on another patch."""
        return dr.gather(self.types.Float32, self._density, patch * self._patches + goal)


def share_out(weights: Array, count: int) -> NDArray[np.intp]:
    """Whole numbers in proportion to each row of weights, with the sum ``count``, or 0."""
    total = weights.sum(axis=1, keepdims=True)
    shares = np.divide(np.cumsum(weights, axis=1), total, where=total > 0, out=0 * weights)
    return np.diff(np.round(shares * count).astype(np.intp), axis=1, prepend=0)


def _known(light: Array, area: Array) -> Array:
    """What is known of each patch; where that is nothing, what is known of all together."""
    everywhere = light.sum(axis=0)
    if not everywhere.any():
        everywhere = area
    return np.where(light.any(axis=1, keepdims=True), light, everywhere)


def _slots(counts: NDArray[np.intp], numbers: NDArray[np.intp]) -> NDArray[np.uint32]:
    """Rows of `SLOTS` words: a patch, its first slot in the row, and how many follow that."""
    row, patch = np.nonzero(counts)
    count = counts[row, patch]
    start = (np.cumsum(counts, axis=1) - counts)[row, patch]
    word = numbers[patch] | (start << _BITS) | ((count - 1) << (2 * _BITS))
    return np.repeat(word.astype(np.uint32), count).reshape(-1, SLOTS)
