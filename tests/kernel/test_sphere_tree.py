"""The tree of many spheres: its order, and its boxes."""

from __future__ import annotations

import numpy as np
import pytest

from drpt.kernel.sphere_tree import arrange, boxes_around


@pytest.mark.parametrize("count", [1, 2, 64, 1024])
def test_an_order_has_every_point_once_and_halves_apart(count: int) -> None:
    points = np.random.default_rng(1).random((count, 3)) * (1, 99, 0.1)
    order = arrange(points)
    assert sorted(order) == [*range(count)]
    if count > 1:
        left, right = np.split(points[order], 2)
        assert left[:, 1].max() < right[:, 1].min()  # the longest side is cut at the median


def test_boxes_hold_what_is_below_them() -> None:
    rng = np.random.default_rng(2)
    spheres = np.column_stack([rng.normal(size=(16, 3)), rng.random(16)])
    spheres[13:] = np.nan
    boxes = boxes_around(spheres)
    assert len(boxes) == 32
    for node in range(1, 16):
        below = boxes[[2 * node, 2 * node + 1]]
        assert (boxes[node, :3] == below[:, :3].min(axis=0)).all()
        assert (boxes[node, 3:] == below[:, 3:].max(axis=0)).all()
    inside = spheres[:13]
    assert (boxes[16:29, :3] < inside[:, :3] - inside[:, 3:]).all()
    assert (boxes[16:29, 3:] > inside[:, :3] + inside[:, 3:]).all()
    assert (boxes[29:, :3] > boxes[29:, 3:]).all()
