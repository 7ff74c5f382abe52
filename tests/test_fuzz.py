"""Thousands of random valid scenes: no mode finds light that is infinite, no number or negative.

A scene's numbers are inputs of its kernel, so scenes of one structure share that; only facets,
which are constants, take a compilation each.
"""

from __future__ import annotations

from dataclasses import replace
from random import Random
from typing import NamedTuple
from warnings import catch_warnings

import numpy as np
import pytest

import drpt
from drpt.kernel.primitives import make_primitives
from drpt.render import SAMPLERS
from drpt.scene.saving import to_toml
from tests.random_scenes import Structure, random_scene

MODES = tuple(drpt.Mode)
PICTURE = 16
SPP = 16
SCENES = 60
"""Of each structure in each mode."""
FACETED_SCENES = 8
"""Of each structure of facets: its kernels take a second each."""


class Kind(NamedTuple):
    """Scenes of one structure, and how often light bounces in them."""

    structure: Structure
    bounces: int


KINDS = {
    "ball and lamp": Kind(Structure(diffuse=1, lights=1), 8),
    "glossy ball and lamp": Kind(Structure(phong=1, lights=1), 2),
    "balls and lamps": Kind(Structure(diffuse=1, phong=1, lights=3), 2),
    "lamps alone": Kind(Structure(lights=3), 1),
    "more balls than a kernel unrolls": Kind(Structure(diffuse=40, phong=20, lights=10), 1),
    "smooth mesh and lamp": Kind(Structure(smooth_meshes=1, lights=1), 2),
    "mesh that emits": Kind(Structure(phong=1, mesh_lights=1), 2),
    "something of all": Kind(Structure(1, 1, 1, 1, 1, 1), 1),
}
FACETED = {
    "something of all": Kind(Structure(1, 1, 1, 1, 1, 1, triangles=7), 1),
    "facets and facets that emit": Kind(Structure(flat_meshes=1, mesh_lights=1, triangles=2), 2),
    "smooth facets": Kind(Structure(smooth_meshes=1, lights=1, triangles=2), 1),
    "bodies and lamp": Kind(Structure(lights=1, bodies=2), 2),
    "room": Kind(Structure(diffuse=1, phong=1, lights=2, room=True), 3),
    "room with bodies": Kind(Structure(phong=1, lights=1, bodies=2, room=True), 2),
    "room with facets that emit": Kind(
        Structure(smooth_meshes=1, mesh_lights=1, triangles=2, bodies=1, room=True), 1
    ),
}
BODIES = ("bodies and lamp", "room", "room with bodies", "room with facets that emit")
MET_AS_BODIES = 0.9
"""Share of the scenes of these in which a body is found; the others' are thin or far away."""
QUICK = ("ball and lamp", "smooth mesh and lamp")


@pytest.mark.parametrize(
    "mode", [pytest.param(m, marks=() if m == "mis" else pytest.mark.slow) for m in MODES]
)
@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=() if n in QUICK else pytest.mark.slow) for n in KINDS]
)
def test_no_scene_has_samples_that_are_not_finite(name: str, mode: drpt.Mode) -> None:
    sampler = SAMPLERS[(MODES.index(mode) + len(name)) % 2]
    for seed in range(SCENES):
        assert_finite(KINDS[name], seed, mode, sampler)


@pytest.mark.slow
@pytest.mark.parametrize("name", FACETED)
def test_no_scene_of_facets_has_samples_that_are_not_finite(name: str) -> None:
    for seed in range(FACETED_SCENES):
        assert_finite(FACETED[name], seed, MODES[seed % len(MODES)], SAMPLERS[seed % 2])


def test_a_room_with_bodies_has_samples_that_are_finite() -> None:
    assert_finite(FACETED["room with bodies"], 0, drpt.Mode.MIS, "sobol")


def test_most_scenes_with_bodies_have_some_that_are_met_as_such() -> None:
    structures = [FACETED[name].structure for name in BODIES]
    scenes = [
        random_scene(Random(n), s, PICTURE) for s in structures for n in range(FACETED_SCENES)
    ]
    solids = [make_primitives(scene.shapes).solids for scene in scenes]
    assert np.mean([len(found) > 0 for found in solids]) >= MET_AS_BODIES
    assert any(body.encloses for found in solids for body in found)


def assert_finite(kind: Kind, seed: int, mode: drpt.Mode, sampler: str) -> None:
    scene = random_scene(Random(seed), kind.structure, PICTURE)
    with catch_warnings(action="ignore", category=RuntimeWarning):  # what fails below says more
        result = drpt.render(scene, SPP, kind.bounces, mode, sampler=sampler, seed=seed)
    problem = (
        f"{result.non_finite} of {result.paths} samples are not finite, the least value is "
        f"{result.image.min()}: drpt.render(scene, {SPP}, {kind.bounces}, {str(mode)!r}, "
        f"sampler={sampler!r}, seed={seed}) of the scene\n{to_toml(scene)}"
    )
    assert result.non_finite == 0, problem
    assert np.isfinite(result.image).all(), problem
    assert (result.image >= 0).all(), problem


def test_what_is_not_finite_is_told_with_the_scene(monkeypatch: pytest.MonkeyPatch) -> None:
    render = drpt.render

    def fail(*given: object, **options: object) -> drpt.Result:
        return replace(render(*given, **options), non_finite=3)  # type: ignore[arg-type]

    monkeypatch.setattr(drpt, "render", fail)
    with pytest.raises(AssertionError, match=r"(?s)3 of 4096 samples .*'mis'.*\[camera\]"):
        assert_finite(KINDS["lamps alone"], 0, drpt.Mode.MIS, "sobol")
