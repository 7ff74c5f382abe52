"""The box around shapes, against corners that are known."""

from __future__ import annotations

import pytest

import drpt
from drpt.scene.bounds import bounds

SPHERE = drpt.Sphere((1, 2, 3), 0.5, radiance=1)
MESH = drpt.Mesh([(0, -1, 0), (4, 0, 0), (0, 2, 1)], [(0, 1, 2)], radiance=1)


@pytest.mark.parametrize(
    ("shapes", "low", "high"),
    [
        ([SPHERE], [0.5, 1.5, 2.5], [1.5, 2.5, 3.5]),
        ([MESH], [0, -1, 0], [4, 2, 1]),
        ([SPHERE, MESH], [0, -1, 0], [4, 2.5, 3.5]),
    ],
)
def test_the_box_holds_all_shapes(
    shapes: list[drpt.Sphere | drpt.Mesh], low: list[float], high: list[float]
) -> None:
    found = bounds(shapes)
    assert [corner.tolist() for corner in found] == [low, high]
