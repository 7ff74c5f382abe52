"""Many spheres: a complete binary tree of boxes, walked from near to far without a stack.

Source: Laine 2010, "Restart Trail for Stackless BVH Traversal"; here the nodes' numbers tell their
parents, so that a walk goes on at the sibling that it has passed over instead of at the root.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import drjit as dr
import numpy as np

from drpt.kernel.meet import Ball, meet_box, meet_sphere
from drpt.kernel.vec import gather_row, greater, lesser, types_of, vec3

if TYPE_CHECKING:
    from collections.abc import Callable

    from drjit.auto import Array3f, Bool, Float, UInt32
    from numpy.typing import NDArray

    from drpt.kernel.camera import Ray
    from drpt.kernel.scene_geometry import Visit

    Array = NDArray[np.float64]

WIDTH = 16
"""Numbers in the row of a node: the boxes of its children, or a sphere and its own number.

As a floating-point one, a sphere's number is exact up to 2²⁴.
"""
ROOM = 2.0**-20
"""By which boxes are larger than what is in them, relative to the largest coordinate: 8 ulps."""


def arrange(centers: Array) -> NDArray[np.intp]:
    """Order of points (n, 3), n a power of two, in which each aligned run of 2ᵏ stands together.

    Every group is split at its median, along its longest side, until there is one point in each;
    points that are not a number stand last.
    """
    order = np.arange(len(centers))[None]
    while order.shape[1] > 1:
        points = centers[order]
        side = np.fmax.reduce(points, axis=1) - np.fmin.reduce(points, axis=1)
        axis = np.nan_to_num(side, nan=-1).argmax(axis=1)
        keys = np.take_along_axis(points, axis[:, None, None], axis=2)[..., 0]
        within = np.argsort(keys, axis=1, kind="stable")
        order = np.take_along_axis(order, within, axis=1).reshape(-1, order.shape[1] // 2)
    return order[:, 0]


def boxes_around(spheres: Array) -> Array:
    """Lowest and highest corners (2n, 6) of the boxes around spheres (n, 4), n a power of two.

    The nodes of a complete binary tree: number 1 is the root, the children of i are 2i and 2i + 1,
    and the spheres are the last n. Number 0 is none, and the box of no sphere is inside out.
    """
    centers, radii = spheres[:, :3], spheres[:, 3:]
    room = radii + ROOM * np.nanmax(np.abs(centers) + radii)
    levels = [np.concatenate([centers - room, centers + room], axis=1)]
    levels[0][np.isnan(radii[:, 0])] = 3 * [np.inf] + 3 * [-np.inf]
    while len(levels[-1]) > 1:
        low, high = np.split(levels[-1].reshape(-1, 2, 6), 2, axis=2)
        levels.append(np.concatenate([low.min(axis=1), high.max(axis=1)], axis=1))
    return np.concatenate([np.zeros((1, 6)), *reversed(levels)])


class SphereTree:
    """Spheres (n, 4) as centres and radii, numbered by ``numbers`` (n,).

    ``upload`` brings numbers to the device, to memory from which rows are gathered in one piece.
    """

    def __init__(
        self, spheres: Array, numbers: NDArray[np.intp], upload: Callable[[Array], Float]
    ) -> None:
        self.afar = False
        self._leaves = 2 ** (len(spheres) - 1).bit_length()
        padded = np.full((self._leaves, 5), np.nan)
        padded[: len(spheres)] = np.column_stack([spheres, numbers])
        leaves = padded[arrange(padded[:, :3])]
        inner = boxes_around(leaves[:, :4]).reshape(-1, 12)
        self._rows = upload(np.concatenate([_widened(inner), _widened(leaves)]))

    def walk(
        self,
        ray: Ray,
        active: Bool,
        end: Float,
        found: UInt32,
        visit: Visit,
        but: UInt32 | None = None,
    ) -> tuple[Float, UInt32]:
        """As all `ManySpheres` do."""
        types = types_of(end)
        inverse = dr.rcp(ray.direction)

        def step(
            node: UInt32, trail: UInt32, end: Float, found: UInt32
        ) -> tuple[UInt32, UInt32, Float, UInt32]:
            is_leaf = node >= self._leaves
            row = gather_row(self._rows, node, WIDTH)
            met, t = meet_sphere(ray, Ball(vec3(*row[:3]), row[3], afar=self.afar))
            number = types.UInt32(row[4])
            counts = is_leaf if but is None else is_leaf & (number != but)
            end, found = visit(number, counts & met, t, end, found)
            left, right = (
                _meets_box(ray.origin, inverse, box, end) for box in (row[0:6], row[6:12])
            )
            nearer = dr.select(right < left, 1, 0)
            second = dr.select(greater(left, right) < dr.inf, 1, 0)
            descends = ~is_leaf & (lesser(left, right) < dr.inf)
            up = dr.tzcnt(trail)
            sibling = dr.select(trail == 0, 0, (node >> up) ^ 1)
            node = dr.select(descends, 2 * node + nearer, sibling)
            trail = dr.select(descends, 2 * trail + second, (trail >> up) ^ 1)
            return node, trail, end, found

        # The bit of a level tells in the trail whether the other child there is still to be seen.
        state = (types.UInt32(1), types.UInt32(0), end, found)
        goes_on = lambda node, _, end, __: active & (node > 0) & (end > 0)  # noqa: E731
        _, _, end, found = dr.while_loop(state, goes_on, step)
        return end, found


def _widened(rows: Array) -> Array:
    return np.pad(rows, ((0, 0), (0, WIDTH - rows.shape[1])))


def _meets_box(origin: Array3f, inverse: Array3f, box: list[Float], end: Float) -> Float:
    """Where rays meet a box between two corners (6,) before an end, or infinity."""
    enters, leaves = meet_box(origin, inverse, vec3(*box[:3]), vec3(*box[3:]), end)
    return dr.select(enters <= leaves * (1 + ROOM), enters, dr.inf)
