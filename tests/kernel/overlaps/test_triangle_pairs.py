"""Pairs of triangles: which lies in the other."""

from __future__ import annotations

import numpy as np
import pytest

from drpt.kernel.overlaps.triangle_pairs import lies_inside

LARGE = [(0, 0, 0), (4, 0, 0), (0, 4, 0)]
ROOM = 0.01


@pytest.mark.parametrize(
    ("small", "lies_in"),
    [
        ([(1, 1, 0), (2, 1, 0), (1, 2, 0)], True),
        ([(1, 2, 0), (2, 1, 0), (1, 1, 0)], True),
        ([(0, 4, 0), (0, 0, 0), (4, 0, 0)], True),  # the same triangle
        ([(4, 0, 0), (0, 0, 0), (1, 1, 0)], False),  # they share an edge only
        ([(1, 0, 0), (2, 0, 0), (1, 1, 0)], False),  # on an edge
        ([(1, 0.005, 0), (2, 0.02, 0), (1, 1, 0)], False),  # nearer to an edge than the room
        ([(1, 1, 0), (3, 3, 0), (1, 2, 0)], False),
    ],
)
def test_a_triangle_lies_in_another_if_it_is_the_same_or_keeps_off_its_edges(
    small: list[tuple[float, ...]], lies_in: bool
) -> None:
    corners = np.array([[LARGE, small]], float)
    assert lies_inside(corners, np.array([ROOM])).tolist() == [lies_in]
