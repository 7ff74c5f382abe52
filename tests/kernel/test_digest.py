"""A digest tells apart all that kernels tell apart, and nothing else."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import drpt
from drpt.kernel.digest import digest
from drpt.kernel.launch import forget
from tests.scenes import BALL, LAMP, LAMP_AND_BALL, scene_of

X, Y = np.mgrid[:12, :12].reshape(2, -1).astype(float)
CORNER = np.arange(144).reshape(12, 12)
FACES = np.stack([CORNER[:-1, :-1], CORNER[1:, :-1], CORNER[:-1, 1:]], axis=-1).reshape(-1, 3)
BALLS = [replace(BALL, center=(3 * k, k % 7, 0), radius=0.5) for k in range(100)]


def sheet(height: float) -> drpt.Mesh:
    """More triangles than are met one by one; one of their corners is as high as told."""
    z = X * Y
    z[70] = height
    return drpt.Mesh(np.stack([X, Y, z], axis=1), FACES, material=drpt.Diffuse(0.5))


def digest_of(scene: drpt.Scene, mode: str = "mis") -> str:
    forget()
    return digest(drpt.Rendering(scene, 4, 2, mode).launcher)


@pytest.mark.parametrize(
    ("scene", "mode"),
    [
        (LAMP_AND_BALL, "mis"),
        (drpt.load_scene("cornell-box"), "guided"),
        (drpt.load_scene("many-lights"), "mis"),
        (scene_of(sheet(40.0), LAMP), "mis"),
        (scene_of(*BALLS, LAMP), "mis"),
    ],
    ids=["spheres", "guide", "lights", "mesh", "grid"],
)
def test_preparing_a_scene_again_changes_nothing(scene: drpt.Scene, mode: str) -> None:
    assert digest_of(scene, mode) == digest_of(scene, mode)


ULP = 2.0**-23
ONE_ULP_APART: list[tuple[Any, Any]] = [
    (scene_of(BALL, LAMP), scene_of(replace(BALL, radius=1 + ULP), LAMP)),
    (scene_of(BALL, LAMP), scene_of(BALL, replace(LAMP, radiance=(3, 2, 1 + ULP)))),
    (scene_of(sheet(1.0), LAMP), scene_of(sheet(1 + ULP), LAMP)),
    (scene_of(*BALLS, LAMP), scene_of(replace(BALLS[0], radius=0.5 + ULP), *BALLS[1:], LAMP)),
]


@pytest.mark.parametrize(
    ("one", "other"), ONE_ULP_APART, ids=["geometry", "radiance", "mesh", "grid"]
)
def test_a_single_bit_counts(one: drpt.Scene, other: drpt.Scene) -> None:
    assert digest_of(one) != digest_of(other)


def test_the_camera_counts() -> None:
    moved = replace(LAMP_AND_BALL, camera=replace(LAMP_AND_BALL.camera, eye=(0, 1, 5 + 4 * ULP)))
    assert digest_of(moved) != digest_of(LAMP_AND_BALL)


def test_the_bits_that_kernels_do_not_get_count_for_nothing() -> None:
    """Another library may round them otherwise."""
    assert digest(1.0, np.array([0.5])) == digest(1 + 1e-12, np.array([0.5 - 1e-12]))
    assert digest(1.0, np.array([0.5])) != digest(1 + ULP, np.array([0.5]))


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (([1.0, 2.0], [3.0]), ([1.0], [2.0, 3.0])),
        ((np.zeros((2, 3)),), (np.zeros((3, 2)),)),
        ((np.zeros(2, np.uint32),), (np.zeros(2, np.float32),)),
        ((None,), ("None",)),
    ],
)
def test_numbers_count_in_their_places(one: tuple[Any, ...], other: tuple[Any, ...]) -> None:
    assert digest(*one) != digest(*other)
