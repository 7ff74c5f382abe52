"""What kernels leave out changes no picture, and what they do not depend on compiles nothing.

Each skip of `benchmarks.skips` is undone: the kernel then has what its scene can do without. Both
trace the same samples, so that their pictures are the same to the last bit; except where points
are found by other arithmetic, and where paths share their camera rays.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from random import Random
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import drpt
from benchmarks.bench.scenes import resized, terrain
from benchmarks.skips import (
    SKIPS,
    Run,
    Skip,
    all_block,
    all_materials,
    features,
    many_spheres,
    run,
    spheres,
    undone,
)
from drpt.scene import builtin_names
from tests.random_scenes import tame_scene

if TYPE_CHECKING:
    from collections.abc import Callable
    from contextlib import AbstractContextManager

    from drpt.scene import Material, Shape

SIDE, SPP = 32, 8
# Such points are off by 1e-7 of the scene, which grows from bounce to bounce.
ROUNDING = 2e-4
ROUNDED = {"bodies as facets", "facets as triangles", "camera rays of covered pixels"}
# Paths that share camera rays are other samples: `test_launch` compares their means.
OTHER_SAMPLES = {"a camera ray for each path"}
# As many operations or fewer, for more lanes.
AS_MANY = {"shadow rays below the horizon", "camera rays of covered pixels"}
QUICK = {
    "Phong code",
    "interpolated normals",
    "choice of a light",
    "light code at bounces 0",
    "last ray",
    "shadows of the walls",
    "bodies as facets",
    "camera rays of covered pixels",
}


def of_table(skip: Skip) -> Any:
    return pytest.param(skip, id=skip.what, marks=[] if skip.what in QUICK else pytest.mark.slow)


@pytest.mark.parametrize("skip", [of_table(s) for s in SKIPS if s.what not in OTHER_SAMPLES])
def test_what_is_left_out_changes_no_picture(skip: Skip) -> None:
    plain, full = assert_same(skip, resized(skip.scene(), SIDE))
    assert full.operations > plain.operations or skip.what in AS_MANY


def test_the_table_has_what_the_tests_name() -> None:
    assert {skip.what for skip in SKIPS} >= QUICK | ROUNDED | OTHER_SAMPLES | AS_MANY


def assert_same(skip: Skip, scene: drpt.Scene) -> tuple[Run, Run]:
    """Assert it of the pictures as kernels are, and with the skip undone; returns both."""
    work = partial(drpt.render, scene, SPP, skip.bounces, skip.mode)
    plain = run(work)
    with undone(skip):
        full = run(work)
    tolerance = ROUNDING if skip.what in ROUNDED else 0
    assert full.result.image == pytest.approx(plain.result.image, rel=tolerance, abs=0)
    return plain, full


def with_everything(mode: drpt.Mode) -> Skip:
    """Code for all kinds of surfaces, and shadows of all facets."""
    shapes = ("spheres", "triangles", "interpolated_normals")

    def undo() -> list[AbstractContextManager[Any]]:
        return [*features(**dict.fromkeys(shapes, True))(), *all_materials(), *all_block()]

    return Skip("all kinds", many_spheres, 3, mode, undo)


@pytest.mark.slow
@pytest.mark.parametrize(("number", "name"), [*enumerate(builtin_names())])
def test_built_in_scenes_need_no_more(number: int, name: str) -> None:
    mode = tuple(drpt.Mode)[number % 6]
    assert_same(with_everything(mode), resized(drpt.load_scene(name), SIDE))


@pytest.mark.parametrize("seed", [5, *(pytest.param(n, marks=pytest.mark.slow) for n in range(5))])
def test_random_scenes_need_no_more(seed: int) -> None:
    mode = tuple(drpt.Mode)[seed % 6]
    assert_same(with_everything(mode), tame_scene(Random(seed), SIDE))


def test_code_for_what_a_scene_has_is_missed() -> None:
    """The comparison sees a skip that is none."""
    skip = Skip("spheres", spheres, 1, drpt.Mode.EXPLICIT, features(direct_light=False))
    with pytest.raises(AssertionError):
        assert_same(skip, resized(spheres(), SIDE))


def changed(
    scene: drpt.Scene, *, reflects: float = 1, emits: float = 1, size: float = 1
) -> drpt.Scene:
    """The same geometry; albedos and exponents, radiances and sphere lights times a factor."""

    def surface(material: Material) -> Material:
        r, g, b = material.albedo
        material = replace(material, albedo=(reflects * r, reflects * g, reflects * b))
        if isinstance(material, drpt.Phong):
            return replace(material, exponent=reflects * material.exponent)
        return material

    def change(shape: Shape) -> Shape:
        if shape.material is not None:
            return replace(shape, material=surface(shape.material))
        r, g, b = shape.radiance or (0, 0, 0)
        radiance = emits * r, emits * g, emits * b
        if isinstance(shape, drpt.Mesh):
            return replace(shape, radiance=radiance)
        return replace(shape, radiance=radiance, radius=size * shape.radius)

    return drpt.Scene(scene.camera, map(change, scene.shapes))


def small_terrain() -> drpt.Scene:
    return terrain(200)


@pytest.mark.parametrize(
    ("make", "bounces"),
    [
        pytest.param(small_terrain, 2, id="mesh"),
        pytest.param(many_spheres, 2, id="tree"),
        pytest.param(spheres, 5, id="regeneration", marks=pytest.mark.slow),
    ],
)
def test_numbers_of_a_scene_compile_nothing(make: Callable[[], drpt.Scene], bounces: int) -> None:
    scene = resized(make(), SIDE)
    plain = run(partial(drpt.render, scene, SPP, bounces))
    for change in ({"reflects": 0.5}, {"emits": 3}, {"size": 0.9}):
        other = run(partial(drpt.render, changed(scene, **change), SPP, bounces))
        assert other.kernel == plain.kernel
        assert not np.array_equal(other.result.image, plain.result.image)


def test_boxes_of_other_lights_samples_and_seeds_share_a_kernel() -> None:
    """Their lights differ in size and radiance; from 64 samples on, paths share camera rays."""
    kernels = {
        run(partial(drpt.render, resized(drpt.load_scene(name), SIDE), spp, 2, seed=seed)).kernel
        for name, spp, seed in (
            ("cornell-box", SPP, 0),
            ("cornell-box-medium-light", SPP, 0),
            ("cornell-box-small-light", 1, 0),
            ("cornell-box", 64, 0),
            ("cornell-box", SPP, 12345),
        )
    }
    assert len(kernels) == 1


def test_kernels_are_told_apart() -> None:
    one, two = (run(partial(drpt.render, resized(spheres(), SIDE), 1, n)) for n in (0, 1))
    assert one.kernel != two.kernel
