"""The grid of many spheres: its cells, their rows, and when there is one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from drpt.kernel.cells import LINKS, LONGEST, SLACK, Cells, cut, rows_of
from drpt.kernel.spheres import CROWD, CROWDED_LIMIT, SPHERE_LIMIT, STANDOUTS, lay_out

if TYPE_CHECKING:
    from tests.oracle.arrays import Floats


def scattered(count: int, radius: float, sides: tuple[float, float, float] = (1, 1, 1)) -> Floats:
    """Spheres (count, 4) with radii up to this one, in a box of these sides."""
    rng = np.random.default_rng(count)
    centers = rng.uniform(-1, 1, (count, 3)) * sides
    return np.column_stack([centers, radius * rng.uniform(0.1, 1, count)])


def cells_of(spheres: Floats) -> Cells:
    cells = cut(spheres)
    assert cells is not None
    return cells


@pytest.mark.parametrize("sides", [(1, 1, 1), (9, 1, 0.1), (1, 0, 0), (1e-20, 3e-20, 0)])
def test_spheres_lie_in_all_cells_that_they_reach(sides: tuple[float, float, float]) -> None:
    spheres = scattered(200, 0.02 * max(sides), sides)
    cells = cells_of(spheres)
    pairs = set(zip(cells.cell.tolist(), cells.sphere.tolist(), strict=True))
    assert len(pairs) == len(cells.cell)
    spheres = cells.local(spheres)
    for place in np.ndindex(*cells.counts):
        low = cells.low + place * cells.width
        nearest = np.clip(spheres[:, :3], low, low + cells.width)
        inside = np.linalg.norm(spheres[:, :3] - nearest, axis=1) <= spheres[:, 3]
        number = int((np.array(place) + 1) @ cells.strides)
        assert all((number, sphere) in pairs for sphere in np.flatnonzero(inside))


def test_no_sphere_lies_in_the_cells_on_the_sides() -> None:
    cells = cells_of(scattered(500, 0.1))
    x, y, z = cells.strides
    place = np.column_stack([cells.cell % y // x, cells.cell % z // y, cells.cell // z])
    assert (place >= 1).all()
    assert (place <= cells.counts).all()
    assert cells.total == (cells.counts + 2).prod()


def test_cells_are_cubes_as_many_as_spheres() -> None:
    cells = cells_of(scattered(5000, 0.001, (4, 2, 1)))
    assert cells.width == pytest.approx(cells.width.mean(), rel=0.05)
    assert 1 < cells.counts.prod() / 5000 < 2


def test_rows_of_a_cell_are_linked() -> None:
    spheres = scattered(300, 0.2)
    cells, numbers = cells_of(spheres), 7 + np.arange(300) * 55_000
    rows = rows_of(cells, spheres, numbers)
    for cell in range(cells.total):
        expected = numbers[cells.sphere[cells.cell == cell]].tolist()
        if not expected:
            assert not rows.words[cell].any()
            continue
        found: list[int] = []
        row = cell
        while row or not found:
            x, y, z = rows.words[row, :3].tolist()
            found.append(7 + x % 256 + y % 256 * 256 + z % 256 * 256**2)
            assert rows.numbers[row] == found[-1]
            sphere = spheres[numbers == found[-1]]
            assert (rows.spheres[row] == sphere).all()
            row = int(rows.words[row, 3]) % LINKS
        assert found == expected


@pytest.mark.parametrize("around", [0, 1, 1000])
@pytest.mark.parametrize("radius", [1e-9, 0.001, 0.5, 1, 2**0.5, 2, 3, 1e9])
def test_words_tell_balls_in_which_spheres_lie(radius: float, around: float) -> None:
    spheres = scattered(40, 1) * (radius, radius, radius, radius / 10)
    spheres[:, :3] += around * radius
    cells = cells_of(spheres)
    rows = rows_of(cells, spheres, 0xABCDEF * np.arange(40) // 40)
    used = rows.words[:, 3] > 0
    centers = rows.words[used, :3].copy().view(np.float32).astype(float)
    above = (rows.words[used, 3] // LINKS * 2**23).view(np.float32).astype(float)
    sphere = cells.local(rows.spheres[used])
    moved = np.linalg.norm(centers - sphere[:, :3], axis=1)
    assert (moved > 0).sum() > 30
    assert (above >= (1 + SLACK) * np.square(moved + sphere[:, 3])).all()
    reach = sphere[:, 3] + 2.0**-15 * np.linalg.norm(sphere[:, :3], axis=1)
    assert (above <= 2.01 * (1 + SLACK) * np.square(reach)).all()


def test_spheres_that_all_lie_in_each_other_have_no_cells() -> None:
    spheres = scattered(1000, 1)
    spheres[:, 3] += 1
    assert cut(spheres) is None


@pytest.mark.parametrize("side", [1, 1e-9])
def test_spheres_that_are_far_for_their_size_have_no_cells(side: float) -> None:
    spheres = scattered(100, 0.1 * side, (side, side, side))
    spheres[:, 0] += 1e8 * side
    assert cut(spheres) is not None
    spheres[:, 0] += 1e10 * side
    assert cut(spheres) is None


def test_an_axis_has_so_many_cells_at_the_most() -> None:
    assert cells_of(scattered(2000, 1e-6, (1, 0, 0))).counts.max() == LONGEST


@pytest.mark.parametrize(
    ("count", "radius", "alone"),
    [
        (1, 0.01, True),
        (SPHERE_LIMIT, 0.01, True),
        (CROWDED_LIMIT, 0.01, False),
        (CROWDED_LIMIT, 0.4, True),
        (CROWDED_LIMIT, 2, True),
        (CROWDED_LIMIT + 1, 0.4, False),
        (CROWDED_LIMIT + 1, 2, False),
    ],
)
def test_few_spheres_are_met_one_by_one(count: int, radius: float, alone: bool) -> None:
    layout = lay_out(scattered(count, radius))
    assert layout.single.tolist() == [*range(count)] * alone
    assert len(layout.single) + len(layout.many) == count
    assert alone or (layout.cells is None) is (radius > 1)


@pytest.mark.parametrize("large", [1, STANDOUTS])
def test_large_spheres_stand_out(large: int) -> None:
    spheres = scattered(200, 0.01)
    spheres[10 : 10 + large, 3] = 3
    layout = lay_out(spheres)
    assert layout.single.tolist() == [*range(10, 10 + large)]
    assert sorted([*layout.single, *layout.many]) == [*range(200)]
    assert layout.cells is not None


def test_too_many_do_not_stand_out() -> None:
    spheres = scattered(200, 0.01)
    spheres[: STANDOUTS + 1, 3] = 3
    assert lay_out(spheres).many.tolist() == [*range(200)]


def test_crowds_have_no_grid() -> None:
    spheres = scattered(1000, 0.001)
    even = lay_out(spheres).cells
    assert even is not None
    assert even.crowd < CROWD / 2
    spheres[:500, :3] *= 1e-3
    assert lay_out(spheres).cells is None
