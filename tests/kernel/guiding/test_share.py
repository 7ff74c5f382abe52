"""The share of the directions that a guide chooses."""

from __future__ import annotations

from typing import TYPE_CHECKING

import drjit as dr
import numpy as np
import pytest

import drpt
from drpt.kernel.device_scene import to_device as upload
from drpt.kernel.guiding.share import (
    GREATEST,
    KNOWN,
    LEAST,
    MOST_VERTICES,
    STEP,
    GuideShares,
    known_part,
    make_shares,
    rounded,
)
from drpt.kernel.patches import COLUMNS, make_patches
from drpt.kernel.primitives import make_primitives
from tests.conftest import TYPES, to_host

if TYPE_CHECKING:
    from tests.oracle.arrays import Floats

BOX = drpt.load_scene("cornell-box")
WHITE, GREEN = 0.76, (0.16, 0.76, 0.16)


@pytest.mark.parametrize("albedo", [0.3, 0.76, 0.999])
def test_the_known_part_is_that_of_a_geometric_series(albedo: float) -> None:
    count = np.arange(1, 65)
    expected = (1 - albedo) / (1 - albedo**count)
    np.testing.assert_allclose(known_part(albedo, 64)[0], expected, rtol=1e-9)


def test_black_and_white_surfaces_have_their_limits() -> None:
    black, white = known_part([0.0, 1.0], 8)
    assert black.tolist() == [1] * 8
    assert white == pytest.approx(1 / np.arange(1, 9))


@pytest.mark.parametrize("albedos", [[1.0], [0.5], [0.99, 0.2], [1.0, 0.7, 0.01]])
def test_no_path_weighs_more_than_its_vertices(albedos: list[float]) -> None:
    """Throughput where the guide never chose the direction, over vertices of these albedos."""
    parts = known_part(albedos, 128)
    number = np.arange(128)
    kind = number % len(albedos)
    factor = np.array(albedos)[kind[1:]] / (1 - parts[kind[1:], number[1:]])
    assert factor.prod() <= 128 * (1 + 1e-9)


def shares(bounces: int) -> Floats:
    primitives = make_primitives(BOX.shapes)
    return make_shares(primitives, make_patches(primitives.facets), bounces)


def test_shares_follow_the_albedo_of_all_and_of_each() -> None:
    table = shares(64)
    primitives = make_primitives(BOX.shapes)
    mean = (4 * WHITE + np.mean(GREEN)) / 5
    patches = make_patches(primitives.facets)
    for row, facet in enumerate(patches.facet[::COLUMNS]):
        if facet < 0:
            assert not table[row].any()
            continue
        assert table[row, 1] == GREATEST
        own = known_part(primitives.reflectance[facet, :3].max(), 63)[0]
        assert (table[row, 1:] <= own).all()
        assert (np.diff(table[row, 1:]) <= 0).all()
        assert table[row, -1] == pytest.approx(KNOWN * (1 - mean), rel=0.25)
    assert not table[:, 0].any()


def test_a_white_surface_bounds_its_own_share_in_a_dark_room() -> None:
    tiles = [
        drpt.Mesh(
            [[x, 0, 0], [x + 1, 0, 0], [x + 1, 1, 0], [x, 1, 0]],
            [[0, 1, 2], [0, 2, 3]],
            material=drpt.Diffuse((1, 0, 0) if x == 0 else 0.1),
        )
        for x in range(9)
    ]
    primitives = make_primitives(drpt.Scene(BOX.camera, tiles).shapes)
    patches = make_patches(primitives.facets)
    table = make_shares(primitives, patches, 33)
    rows = patches.facet[::COLUMNS]
    assert table[rows == 0, -1] == pytest.approx(1 / 32)
    assert (table[rows == 1, -1] == GREATEST).all()


def test_the_table_is_no_larger_than_it_need_be() -> None:
    assert shares(2).shape[1] == 2
    assert shares(2**16).shape == shares(MOST_VERTICES).shape
    limits = shares(MOST_VERTICES)[:, -1]
    np.testing.assert_allclose(limits, shares(MOST_VERTICES - 50)[:, -1], atol=STEP)


def test_rounded_shares_leave_an_exact_rest() -> None:
    steps = rounded(np.random.default_rng(1).uniform(0, GREATEST, 1000))
    assert (np.float32(steps / STEP) % 1 == 0).all()
    assert ((steps == 0) | (steps >= LEAST)).all()
    share = np.float32(steps[steps > 0])
    last = np.float32(1 - 2.0**-24)
    assert ((last - share) / (1 - share) < 1).all()
    assert ((share - np.float32(2.0**-24)) / share < 1).all()


def test_kernels_find_the_share_of_a_patch() -> None:
    table = np.arange(12.0).reshape(3, 4)
    on_device = GuideShares(upload(table, TYPES), 4)
    patch = TYPES.UInt32([0, COLUMNS, COLUMNS + 5, 2 * COLUMNS])
    assert to_host(on_device.of(patch, 2)).tolist() == [2, 6, 6, 10]
    assert to_host(on_device.of(patch, 99)).tolist() == [3, 7, 7, 11]
    assert to_host(on_device.of(patch, -1)).tolist() == [0, 4, 4, 8]
    each = dr.arange(TYPES.UInt32, 4)
    assert to_host(on_device.of(patch, each)).tolist() == [0, 5, 6, 11]
    assert to_host(on_device.of(patch, each - 1)).tolist() == [3, 4, 5, 10]
