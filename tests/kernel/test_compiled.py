"""Compiled kernels in memory: how many there may be."""

from __future__ import annotations

from typing import TYPE_CHECKING

import drjit as dr
import numpy as np

import drpt
from drpt.kernel import compiled
from drpt.kernel.compiled import KERNELS_PER_USER, MAX_KERNELS, CompiledKernels
from tests.scenes import LAMP_AND_BALL, seen_by

if TYPE_CHECKING:
    import pytest

USERS = MAX_KERNELS // KERNELS_PER_USER


class Flushed:
    """Stands for Dr.Jit's function, and counts its calls."""

    def __init__(self) -> None:
        self.calls = 0

    def __call__(self) -> None:
        self.calls += 1


def test_all_go_once_too_many_have_used_them(monkeypatch: pytest.MonkeyPatch) -> None:
    flushed = Flushed()
    monkeypatch.setattr(dr, "flush_kernel_cache", flushed)
    kernels, users = CompiledKernels(), [object() for _ in range(USERS + 1)]
    for user in (*users[:USERS], *users[:USERS]):
        kernels.use(user)
    assert flushed.calls == 0
    kernels.use(users[USERS])
    assert flushed.calls == 1
    for user in users[: USERS - 1]:  # whose kernels are loaded again
        kernels.use(user)
    assert flushed.calls == 1
    kernels.use(users[USERS - 1])
    assert flushed.calls == 2


def test_no_launcher_compiles_more_kernels_than_are_counted() -> None:
    scene = seen_by(drpt.load_scene("cornell-box"), 4, 3)
    dr.flush_kernel_cache()
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        rendering = drpt.Rendering(scene, 128, mode="guided")
        list(rendering.passes())
        rendering.sample(2, 1, 0)
        rendering.vertices(2, 1, 4)
        kernels = {kernel["hash"] for kernel in dr.kernel_history((dr.KernelType.JIT,))}
    assert 2 < len(kernels) <= KERNELS_PER_USER


def test_a_render_goes_on_with_the_same_bits(monkeypatch: pytest.MonkeyPatch) -> None:
    scene, flushed = seen_by(LAMP_AND_BALL, 4, 3), Flushed()
    expected = drpt.render(scene, 8).image
    monkeypatch.setattr(compiled, "MAX_KERNELS", KERNELS_PER_USER)  # that of a single launcher
    flush = dr.flush_kernel_cache

    def counted() -> None:
        flushed()
        flush()

    monkeypatch.setattr(dr, "flush_kernel_cache", counted)
    one, other = drpt.Rendering(scene, 8), drpt.Rendering(scene, 8, mode="implicit")
    for rendering in (one, other, one):
        rendering.sample(1, 1, 0)
    list(one.passes())
    assert flushed.calls >= 2
    np.testing.assert_array_equal(one.result().image, expected)
