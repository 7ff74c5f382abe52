"""Pairs of close points and of boxes: those that comparing each with each finds."""

from __future__ import annotations

import numpy as np
import pytest

from drpt.kernel.overlaps.nearby import box_pairs, close_pairs


def pairs_of(array: np.ndarray) -> set[tuple[int, ...]]:
    return set(map(tuple, array.tolist()))


@pytest.mark.parametrize("count", [1, 2, 50, 400])
@pytest.mark.parametrize("seed", range(3))
def test_boxes_that_intersect_are_found(count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    low = rng.uniform(0, 1, (count, 3)) * [1, 1, 0 if seed else 1]
    high = low + 10 ** rng.uniform(-3, -0.5, (count, 1))
    groups = rng.integers(0, 3, count)
    expected = {
        (i, j)
        for i in range(count)
        for j in range(i + 1, count)
        if groups[i] != groups[j] and (low[i] <= high[j]).all() and (low[j] <= high[i]).all()
    }
    assert pairs_of(box_pairs(low, high, groups)) == expected


@pytest.mark.parametrize("dimensions", [3, 4])
@pytest.mark.parametrize("spread", [1e-6, 1e-2, 1.0])
def test_no_close_points_are_missed(dimensions: int, spread: float) -> None:
    """Also across the borders of cells, and where tolerances differ by many orders."""
    rng = np.random.default_rng(dimensions)
    centers = rng.uniform(-1, 1, (150, dimensions))
    tolerances = np.repeat(spread * 10 ** rng.uniform(-4, 0, 150), 2)
    points = np.repeat(centers, 2, axis=0)
    points[1::2] += rng.uniform(-2, 2, centers.shape) * tolerances[1::2, None]
    groups = rng.integers(0, 2, 300)
    apart = np.abs(points[:, None] - points).max(axis=2)
    close = (apart <= tolerances[:, None] + tolerances) & (groups[:, None] != groups)
    low, high = np.zeros((300, 3)), np.ones((300, 3))
    found = close_pairs(points, tolerances, groups, lambda some: (low[some], high[some]))
    assert pairs_of(np.argwhere(np.triu(close))) <= pairs_of(found)
    assert (groups[found[:, 0]] != groups[found[:, 1]]).all()
    if spread < 1:
        assert len(found) < 40 * close.sum()
