"""Patches of facets, and paths that are guided from one to another."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING
from unittest.mock import patch

import drjit as dr
import numpy as np
import pytest

import drpt
from drpt.gallery.rendering import rel_mse
from drpt.kernel import launch
from drpt.kernel.device_scene import to_device as upload
from drpt.kernel.guiding import training
from drpt.kernel.guiding.directions import GuidedDirections
from drpt.kernel.guiding.guide import SLOTS, Guide, share_out
from drpt.kernel.intersect import Hit
from drpt.kernel.launch import forget, make_launcher
from drpt.kernel.patches import COLUMNS, MOST_ROWS, Patches, make_patches
from drpt.kernel.primitives import FACET_LIMIT, make_primitives
from tests.conftest import TYPES, to_device, to_host, unit_square
from tests.measuring import assert_agree, measure, with_picture

if TYPE_CHECKING:
    from contextlib import AbstractContextManager

    from drpt.kernel.facets import Facet
    from drpt.scene import Shape
    from tests.oracle.arrays import Floats

BOX = drpt.load_scene("cornell-box")
GLOSSY = drpt.load_scene("cornell-box-glossy")
ROUNDED = 1e-4  # of a patch's size: where a point is in its plane, in float32
DETECTABLE = 0.005  # relative, of the mean of a small picture
SAME = 2e-6  # relative, of densities in float32


def facets_of(shapes: tuple[Shape, ...]) -> tuple[Facet, ...]:
    return make_primitives(shapes).facets


def strip(length: float, width: float, at: float) -> drpt.Mesh:
    corners = [[0, at, 0], [length, at, 0], [length, at + width, 0], [0, at + width, 0]]
    return drpt.Mesh(corners, [[0, 1, 2], [0, 2, 3]], material=drpt.Diffuse(0.5))


STRIPS = tuple(strip(100, 1e-3, 2 * k) for k in range(60))
TRIANGLE = drpt.Mesh([[0, 0, 0], [3, 0, 1], [1, 2, 5]], [[0, 1, 2]], material=drpt.Diffuse(0.5))
KINDS = {"cornell-box": BOX.shapes, "strips": STRIPS, "triangle": (TRIANGLE,)}


def weights_in(facet: Facet, rng: np.random.Generator, count: int) -> Floats:
    """Points (count, 3) of a facet, anywhere between its corners."""
    weights = rng.dirichlet(np.ones(len(facet.corners)), count)
    return np.asarray(weights @ facet.corners)


@pytest.mark.parametrize("kind", KINDS)
def test_every_point_of_a_facet_is_in_a_patch_of_it(kind: str) -> None:
    facets = facets_of(KINDS[kind])
    patches, rng = make_patches(facets), np.random.default_rng(0)
    for number, (facet, frame) in enumerate(zip(facets, patches.frames, strict=True)):
        points = weights_in(facet, rng, 200)
        x, y = (row[:3] @ points.T + row[3] for row in frame)
        patch_of = (np.floor(y) * COLUMNS + np.floor(x)).astype(int)
        assert (patches.facet[patch_of] == number).all()
        assert ((x >= 0) & (x < COLUMNS)).all()
        corner, right, up = patches.corner[patch_of], patches.right[patch_of], patches.up[patch_of]
        again = corner + (x % 1)[:, None] * right + (y % 1)[:, None] * up
        np.testing.assert_allclose(again, points, rtol=0, atol=1e-9 * np.abs(points).max())


@pytest.mark.parametrize("kind", KINDS)
def test_patches_fit_their_words(kind: str) -> None:
    patches = make_patches(facets_of(KINDS[kind]))
    assert len(patches.facet) <= COLUMNS * (1 + max(MOST_ROWS, FACET_LIMIT)) <= 1024
    assert SLOTS <= 1024
    assert (patches.facet[:COLUMNS] == -1).all()
    assert (patches.area[patches.there] > 0).all()


def test_patches_are_about_of_one_size() -> None:
    patches = make_patches(facets_of(BOX.shapes))
    area = patches.area[patches.there]
    assert 200 < len(area) < 320
    assert area.max() / area.min() < 4


@pytest.mark.parametrize("count", [1, 7, 1024])
def test_shares_are_whole_and_in_proportion(count: int) -> None:
    weights = np.random.default_rng(1).exponential(size=(5, 40)) ** 3
    weights[3] = 0
    shares = share_out(weights, count)
    assert shares.sum(axis=1).tolist() == [count, count, count, 0, count]
    assert (shares >= 0).all()
    exact = count * weights / np.maximum(weights.sum(axis=1, keepdims=True), 1e-9)
    assert np.abs(shares - exact).max() <= 1


@pytest.fixture
def patches() -> Patches:
    return make_patches(facets_of(BOX.shapes))


@pytest.fixture
def guide(patches: Patches) -> Guide:
    """Of random knowledge; patch number 2 of the facets is known nothing of."""
    light = np.random.default_rng(2).exponential(size=2 * (len(patches.there),)) ** 2
    light[2] = 0
    return Guide(patches, light, TYPES, lambda values: upload(values, TYPES))


def existing(patches: Patches) -> list[int]:
    return list(patches.there[[0, 2, 50, -1]])


def test_densities_integrate_to_one(guide: Guide, patches: Patches) -> None:
    goals = dr.arange(TYPES.UInt32, len(patches.facet))
    for start in existing(patches):
        density = to_host(guide.density(TYPES.UInt32(start), goals))
        assert density @ patches.area == pytest.approx(1, rel=SAME)


def test_nothing_is_known_off_the_facets(guide: Guide, patches: Patches) -> None:
    goals = dr.arange(TYPES.UInt32, len(patches.facet))
    assert (to_host(guide.density(TYPES.UInt32(0), goals)) == 0).all()
    everywhere = dr.arange(TYPES.UInt32, len(patches.facet))
    to_none = to_host(guide.density(everywhere, TYPES.UInt32(0)))
    assert (to_none == 0).all()


def test_points_follow_their_density(guide: Guide, patches: Patches) -> None:
    """Every slot is met as often, and the points of a patch fill it evenly."""
    count = 64 * SLOTS
    u = unit_square(count)
    u.x = (dr.arange(TYPES.Float32, count) + 0.5) / count
    eye = np.array([278.0, 273.0, -100.0])
    for start in existing(patches):
        number = dr.full(TYPES.UInt32, start, count)
        way, facet = guide.aim(number, to_device(eye[None]), u, TYPES.Bool(True))
        goal = patches_of(patches, eye, to_host(way), np.array(facet))
        met = np.bincount(goal[0], minlength=len(patches.facet)) / count
        density = to_host(guide.density(number[0], dr.arange(TYPES.UInt32, len(patches.facet))))
        np.testing.assert_allclose(met, density * patches.area, rtol=0, atol=1.5 / 64 / SLOTS)
        assert goal[1].mean(axis=1) == pytest.approx([0.5, 0.5], abs=0.01)


def patches_of(patches: Patches, eye: Floats, way: Floats, facet: Floats) -> tuple[Floats, Floats]:
    """The patch in which each way from the eye meets its facet, and where in it, (2, n)."""
    frame = patches.frames[facet]
    normal = np.cross(frame[:, 0, :3], frame[:, 1, :3])
    first = np.array([np.flatnonzero(patches.facet == f)[0] for f in facet])
    distance = ((patches.corner[first] - eye) * normal).sum(axis=1) / (way * normal).sum(axis=1)
    points = eye + distance[:, None] * way
    x, y = (np.einsum("ni,ni->n", frame[:, k, :3], points) + frame[:, k, 3] for k in range(2))
    return (np.floor(y) * COLUMNS + np.floor(x)).astype(int), np.stack([x % 1, y % 1])


def test_hits_are_in_the_patch_that_was_aimed_at(guide: Guide, patches: Patches) -> None:
    facets = facets_of(BOX.shapes)
    for number, facet in enumerate(facets):
        points = weights_in(facet, np.random.default_rng(number), 100)
        x, y = (row[:3] @ points.T + row[3] for row in patches.frames[number])
        inside = (np.minimum(x % 1, 1 - x % 1) > ROUNDED) & (np.minimum(y % 1, 1 - y % 1) > ROUNDED)
        expected = (np.floor(y) * COLUMNS + np.floor(x)).astype(int)
        found = np.array(guide.patch_of(hit_at(points, number)))
        assert (found == expected)[inside].all()
    assert (np.array(guide.patch_of(hit_at(points, len(facets)))) == 0).all()


def hit_at(points: Floats, primitive: int) -> Hit:
    p = to_device(points)
    number = dr.full(TYPES.UInt32, primitive, len(points))
    yes = dr.full(TYPES.Bool, True, len(points))
    return Hit(yes, p.x, number, p, p, p, yes, TYPES.Array4f(0))


def test_a_hit_far_outside_its_facet_is_in_no_patch(guide: Guide) -> None:
    points = np.array([[1e9, 1e9, 1e9], [-1e9, -1e9, -1e9], [np.nan, 0, 0], [np.inf, 0, 0]])
    assert (np.array(guide.patch_of(hit_at(points, 0))) == 0).all()


@pytest.mark.parametrize(
    ("scene", "bounces"),
    [(BOX, 3), (GLOSSY, 3), pytest.param(GLOSSY, 6, marks=pytest.mark.slow)],
    ids=["diffuse", "glossy", "in a loop"],
)
@pytest.mark.parametrize("wrong", ["random", "of one patch", "none"])
def test_wrong_knowledge_makes_noise_alone(scene: drpt.Scene, bounces: int, wrong: str) -> None:
    def guess(*_: object) -> Floats:
        count = len(make_patches(facets_of(scene.shapes)).there)
        light = np.random.default_rng(3).exponential(size=(count, count)) ** 4
        kept = {"random": 1, "of one patch": np.arange(count) == count // 2, "none": 0}
        return np.asarray(light * kept[wrong])

    small = with_picture(scene, 24, 24)
    with patch.object(training, "_exchange", guess), always_guided():
        guided = measure(small, 2**22, bounces, "guided")
    assert_agree(guided, measure(small, 2**22, bounces, "mis"), DETECTABLE)


def always_guided() -> AbstractContextManager[object]:
    """Let no guide be left out, whatever it is expected to bring."""
    return patch.object(launch, "best_shares", lambda _, shares, __: shares)


@pytest.mark.parametrize(("scene", "plain"), [(BOX, "explicit"), (GLOSSY, "mis")])
def test_guided_paths_are_less_noisy(scene: drpt.Scene, plain: str) -> None:
    small = with_picture(scene, 48, 48)
    truth = drpt.render(small, 4096, 3, plain, seed=1)
    plain_error, error = (
        rel_mse(drpt.render(small, 64, 3, mode, seed=2).image, truth) for mode in (plain, "guided")
    )
    assert error < plain_error / 1.8


def test_without_facets_it_is_mis() -> None:
    scene = with_picture(drpt.load_scene("spheres"), 16, 16)
    shapes = tuple(shape for shape in scene.shapes if isinstance(shape, drpt.Sphere))
    balls = replace(scene, shapes=shapes)
    guided, mis = (drpt.render(balls, 16, 3, mode).image for mode in ("guided", "mis"))
    np.testing.assert_array_equal(guided, mis)


def test_with_one_bounce_it_is_mis() -> None:
    small = with_picture(BOX, 16, 16)
    guided, mis = (drpt.render(small, 16, 1, mode).image for mode in ("guided", "mis"))
    np.testing.assert_array_equal(guided, mis)


@pytest.mark.parametrize("scene", [BOX, GLOSSY], ids=["diffuse", "glossy"])
def test_a_colour_compiles_nothing(scene: drpt.Scene) -> None:
    """Though the share of the guide depends on it."""
    small = with_picture(scene, 16, 16)
    assert isinstance(small.shapes[1].material, drpt.Diffuse)
    dark = replace(small.shapes[1], material=drpt.Diffuse(0.4))
    darker = replace(small, shapes=(small.shapes[0], dark, *small.shapes[2:]))
    made = [
        make_launcher(TYPES, s, 6, drpt.Mode.GUIDED, "sobol", jitter=True) for s in (small, darker)
    ]
    light, dim = (launcher.tracer.directions for launcher in made)
    assert isinstance(light, GuidedDirections)
    assert isinstance(dim, GuidedDirections)
    assert (dim.shares.table.numpy() != light.shares.table.numpy()).any()
    first, second = map(kernel_of, made)
    assert first == second


def kernel_of(launcher: launch.Launcher) -> str:
    """Hash of the kernel of a launch."""
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        launcher.launch(range(4), range(1), 1, 0)
        kernels = dr.kernel_history((dr.KernelType.JIT,))
    return str(max(kernels, key=lambda kernel: int(kernel["operation_count"]))["hash"])


@pytest.mark.slow
def test_a_white_room_is_no_noisier_with_many_bounces() -> None:
    """A constant share of a half has 6 times the error there."""
    cube = [[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    halves = [half for a, b, c, d in quads for half in ((a, b, c), (a, c, d))]
    walls = drpt.Mesh(cube, halves, material=drpt.Diffuse(0.95))
    lamp = drpt.Sphere((0.5, 0.8, 0.5), 0.1, radiance=10)
    camera = drpt.Camera((0.5, 0.5, 0.05), (0.5, 0.45, 1), (0, 1, 0), 70, 32, 32)
    scene = drpt.Scene(camera, [walls, lamp])
    truth = drpt.render(scene, 4096, 16, "mis", seed=1)
    mis, guided = (
        rel_mse(drpt.render(scene, 64, 16, mode, seed=2).image, truth) for mode in ("mis", "guided")
    )
    assert guided < 1.1 * mis


def test_knowledge_is_the_same_each_time() -> None:
    first = drpt.render(with_picture(BOX, 16, 16), 4, 3, "guided").image
    forget()
    again = drpt.render(with_picture(BOX, 16, 16), 4, 3, "guided").image
    np.testing.assert_array_equal(again, first)


def test_knowledge_is_looked_for_where_it_is_used() -> None:
    with patch.object(launch, "learn", side_effect=AssertionError):
        for mode, bounces in (("mis", 3), ("guided", 1)):
            make_launcher(TYPES, BOX, bounces, drpt.Mode(mode), "sobol", jitter=True)
        with pytest.raises(AssertionError):
            make_launcher(TYPES, BOX, 2, drpt.Mode.GUIDED, "sobol", jitter=True)
