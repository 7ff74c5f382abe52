"""Differences of convex polygons: areas, borders, and widened edges."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt
import pytest

from drpt.kernel.facets import area_normal, unit_normal
from drpt.kernel.overlaps import clipping
from drpt.kernel.overlaps.batches import Polygons

Floats: TypeAlias = npt.NDArray[np.float64]

ROUNDING = 1e-12  # of areas, relative to those that are cut
SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])


def subtract(polygon: Floats, others: list[Floats], overlap: float) -> list[Floats]:
    of = np.zeros(len(others), np.intp)
    pieces = clipping.subtract(
        Polygons.of([polygon]),
        Polygons.of(others),
        of,
        np.array([overlap]),
    )
    assert not pieces.owners.any()
    return outlines(pieces.polygons)


def outlines(polygons: Polygons) -> list[Floats]:
    return [c[:size] for c, size in zip(polygons.corners, polygons.sizes, strict=True)]


def widen(polygon: Floats, width: float) -> Floats:
    normals, widths = unit_normal(polygon)[None], np.array([width])
    wider = Polygons.of([polygon]).widened(normals, widths, clipping.LONGEST_MITRE)
    return outlines(wider)[0]


def fan(polygon: Floats) -> Floats:
    return Polygons.of([polygon]).fans()[0]


def area(polygon: Floats) -> float:
    return float(np.linalg.norm(area_normal(polygon)))


def total(polygons: list[Floats]) -> float:
    return sum(map(area, polygons))


def scaled(polygon: Floats, factor: float, move: object = (0, 0, 0)) -> Floats:
    middle = polygon.mean(axis=0)
    return np.asarray(middle + factor * (polygon - middle) + np.asarray(move))


@pytest.mark.parametrize("turned", [False, True])
def test_a_hole_leaves_four_pieces_around_it(turned: bool) -> None:
    hole = scaled(SQUARE, 0.5)[:: -1 if turned else 1]
    pieces = subtract(SQUARE, [hole], 0)
    assert len(pieces) == 4
    assert total(pieces) == pytest.approx(0.75, rel=ROUNDING)
    assert all((area_normal(piece) > [-1, -1, 0]).all() for piece in pieces)


def test_what_is_covered_leaves_nothing_and_what_is_beside_is_whole() -> None:
    assert subtract(SQUARE, [scaled(SQUARE, 2)], 1e-6) == []
    assert subtract(SQUARE, [SQUARE], 1e-6) == []
    assert subtract(SQUARE, [SQUARE[[0, 1, 3]], SQUARE[[1, 2, 3]]], 1e-6) == []
    (whole,) = subtract(SQUARE, [SQUARE + np.array([1, 0, 0])], 0)
    assert (whole == SQUARE).all()


def test_pieces_reach_under_the_border_of_what_covers_but_not_between_its_parts() -> None:
    width, hole = 1e-3, scaled(SQUARE, 0.5)
    pieces = subtract(SQUARE, [hole[[0, 1, 3]], hole[[1, 2, 3]]], width)
    assert total(pieces) == pytest.approx(1 - (0.5 - 2 * width) ** 2, rel=ROUNDING)


@pytest.mark.parametrize("seed", range(8))
def test_areas_of_pieces_sum_up(seed: int) -> None:
    """Random points of the polygon outside of the others lie in exactly one piece each."""
    rng = np.random.default_rng(seed)
    axes = np.linalg.qr(rng.standard_normal((3, 3)))[0]

    def polygon() -> Floats:
        angles = np.sort(rng.uniform(0, 2 * np.pi, rng.integers(3, 7)))
        flat = np.stack([np.cos(angles), np.sin(angles)], axis=1) * rng.uniform(0.3, 1)
        return np.asarray((flat + rng.uniform(-0.5, 0.5, 2)) @ axes[:2])

    whole, others = polygon(), [polygon() for _ in range(4)]
    pieces = subtract(whole, others, 0)
    points = rng.uniform(-1.5, 1.5, (4000, 2)) @ axes[:2]
    free = inside(whole, points) & ~np.any([inside(other, points) for other in others], axis=0)
    assert (np.sum([inside(piece, points) for piece in pieces], axis=0) == free).all()
    assert 0 < total(pieces) <= area(whole) * (1 + ROUNDING)


def inside(polygon: Floats, points: Floats) -> npt.NDArray[np.bool_]:
    normal, ahead = area_normal(polygon), np.roll(polygon, -1, axis=0) - polygon
    spokes = points[:, None] - polygon
    return np.asarray((np.cross(ahead, spokes) @ normal >= 0).all(axis=1))


def test_widened_edges_are_so_much_farther_out() -> None:
    wide = widen(SQUARE, 0.01)
    assert wide == pytest.approx(scaled(SQUARE, 1.02), rel=ROUNDING)


def test_sharp_corners_do_not_go_far() -> None:
    needle = np.array([[0.0, 0, 0], [1, -1e-9, 0], [1, 1e-9, 0]])
    assert np.linalg.norm(widen(needle, 0.01) - needle, axis=1).max() <= 0.04 * (1 + ROUNDING)


def test_a_fan_has_the_area_of_its_polygon() -> None:
    assert total(list(fan(SQUARE))) == pytest.approx(1, rel=ROUNDING)
