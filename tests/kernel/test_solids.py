"""Convex bodies: which facets form one, and rays that meet them, against facets one by one."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING

import drjit as dr
import numpy as np
import pytest

import drpt
from drpt.kernel.camera import Ray
from drpt.kernel.estimator import Mode
from drpt.kernel.intersect import SPAWN_OFFSET, closest_hit, occluded
from drpt.kernel.launch import forget, make_launcher
from drpt.kernel.primitives import make_primitives
from drpt.kernel.solids import FOLD, THINNEST, find_bodies, make_solids
from tests.conftest import TYPES, to_host
from tests.oracle.arrays import normalize, sample_uniform_sphere

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    from drpt.scene import Shape
    from tests.oracle.arrays import Floats

CORNERS = np.array([*product((0.0, 1.0), repeat=3)])
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
NO_BALLS = (np.empty((0, 3)), np.empty(0))
# Share of rays, out of 2^14 random ones, that may pass an edge or a corner on its other side.
DOUBTFUL = 2e-4
# Distances along a ray, relative: 16 ulps, over the cosine of 1e-2 at which few rays fall in.
DISTANCE = 1e-4


def box(*, leave_out: Sequence[int] = (), top: Floats | None = None) -> list[Floats]:
    """Outlines of a unit cube's faces; ``top`` replaces its corners at x = 1."""
    corners = CORNERS.copy()
    if top is not None:
        corners[4:] = top
    return [corners[list(quad)] for i, quad in enumerate(QUADS) if i not in leave_out]


def facets_of(outlines: list[Floats]) -> list[list[int | None]]:
    return [[side.facet for side in sides] for sides in find_bodies(outlines)]


@pytest.mark.parametrize(
    ("outlines", "expected"),
    [
        (box(), [[0, 1, 2, 3, 4, 5]]),
        (box(leave_out=[3]), [[0, 1, 2, 3, 4, None]]),
        (box(leave_out=[0, 1]), [[0, 1, 2, 3, None, None]]),
        ([*box(), *(3 + outline for outline in box(leave_out=[0]))],
         [[0, 1, 2, 3, 4, 5], [6, 7, 8, 9, 10, None]]),
        (box(top=CORNERS[4:] * (1, 0.5, 0.5)), [[0, 1, 2, 3, 4, 5]]),
        (box(leave_out=[0, 2]), []),  # a rim that is not flat
        (box(leave_out=[0, 1, 2, 3, 4]), []),  # a single polygon
        ([*box(), *(np.add(outline, (1, 0, 0)) for outline in box())], []),  # share a face
        ([*box(), *(np.add(outline, (1, 1, 0)) for outline in box())], []),  # share an edge
        (box() + box(), []),  # coincide
        (box(top=CORNERS[4:] * (THINNEST / 2, 1, 1)), []),  # thin
        ([*box(leave_out=[0]), CORNERS[[0, 1, 3]] * 0.5], [[0, 1, 2, 3, 4, None]]),  # half shut
    ],
)  # fmt: skip
def test_facets_that_bound_a_convex_region_are_a_body(
    outlines: list[Floats], expected: list[list[int | None]]
) -> None:
    assert facets_of(outlines) == expected
    assert facets_of([outline[::-1] for outline in outlines]) == expected


@pytest.mark.parametrize(("height", "bodies"), [(2 * FOLD, 1), (-0.1, 0), (FOLD / 2, 0), (0, 0)])
def test_a_body_is_folded_outward_at_its_edges(height: float, bodies: int) -> None:
    """A cube whose wall at x = 1 stands in two halves that lean outward by so much."""
    (low, mid, high), x = (0.0, 0.5, 1.0), 1 + height
    halves = [
        [(1.0, low, 0), (x, mid, 0), (x, mid, 1), (1, low, 1)],
        [(x, mid, 0.0), (1, high, 0), (1, high, 1), (x, mid, 1)],
    ]
    ends = [[(0, 0, z), (0, 1, z), (1, 1, z), (x, mid, z), (1, 0, z)] for z in (0.0, 1.0)]
    rest = box(leave_out=[1, 4, 5])
    assert len(facets_of([*rest, *map(np.array, (*halves, *ends))])) == bodies


def test_a_room_that_holds_all_encloses_it_and_casts_no_shadow() -> None:
    inner = [0.25 + 0.5 * outline for outline in box(leave_out=[2])]
    outlines = [*box(leave_out=[0]), *inner]
    points = np.concatenate(outlines)
    room, body = make_solids(outlines, points, np.zeros(len(points)))
    assert room.encloses
    assert not room.shading
    assert not body.encloses
    assert {face.facet for span in body.shading for face in (span.low, span.high) if face} == {
        *body.facets,
        None,
    }
    assert sorted(room.facets + body.facets) == [*range(10)]
    beyond = np.concatenate([points, [[0.5, 0.5, 0.99]]])
    radii = np.append(np.zeros(len(points)), 0.02)
    assert not make_solids(outlines, beyond, radii)[0].encloses


def test_the_open_side_on_which_all_stands_casts_no_shadow() -> None:
    floor = np.array([(-5.0, -5, 0), (5, -5, 0), (5, 5, 0), (-5, 5, 0)])
    lamp = np.array([(9.0, 9, 9), (9, 8, 9), (8, 8, 9), (-9, -9, 9)])
    outlines = [floor, lamp, *box(leave_out=[4])]
    points = np.concatenate(outlines)
    (body,) = make_solids(outlines, points, np.zeros(len(points)))
    assert sum(face is not None for span in body.spans for face in (span.low, span.high)) == 6
    assert sum(face is not None for span in body.shading for face in (span.low, span.high)) == 5


@pytest.mark.parametrize("name", ["cornell-box", "cornell-box-glossy"])
def test_the_cornell_box_is_three_bodies(name: str) -> None:
    primitives = make_primitives(drpt.load_scene(name).shapes)
    room, *boxes = primitives.solids
    assert room.encloses
    assert len(room.facets) == 6
    assert [len(body.facets) for body in boxes] == [5, 5]


MISS = 2**32 - 1
DULL = drpt.Diffuse(0.5)


def mesh(outlines: list[Floats], scale: float = 1, shift: float = 0) -> drpt.Mesh:
    corners = np.concatenate([outline[[0, 1, 2, 0, 2, 3]] for outline in outlines])
    faces = np.arange(len(corners)).reshape(-1, 3)
    return drpt.Mesh(shift + scale * corners, faces, material=DULL)


TILT = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
SCENES: dict[str, list[Shape]] = {
    "a cube": [mesh(box())],
    "a tilted cube": [mesh([outline @ TILT for outline in box()])],
    "a cube without a side": [mesh(box(leave_out=[3]))],
    "a tube": [mesh([outline @ TILT for outline in box(leave_out=[0, 1])])],
    "a frustum": [mesh(box(top=CORNERS[4:] * (1, 0.5, 0.5)))],
    "a room with a box and a light": [
        mesh([outline - (0.5, 0.5, 0.5) for outline in box(leave_out=[5])], 4),
        mesh(box(leave_out=[2]), 1, -1),
        drpt.Sphere((1, 1, 1), 0.2, radiance=1),
    ],
}


class World:
    """Shapes on the device, as bodies or as facets one by one."""

    def __init__(self, shapes: list[Shape]) -> None:
        camera = drpt.Camera((0, 0, 9), (0, 0, 0), (0, 1, 0), 40, 8, 8)
        lamp = drpt.Sphere((9, 9, -9), 0.5, radiance=1)
        self.shapes = shapes if shapes[-1].is_light else [*shapes, lamp]
        scene = drpt.Scene(camera, self.shapes)
        launcher = make_launcher(TYPES, scene, 1, Mode.MIS, "independent", jitter=False)
        self.scene, self.features = launcher.tracer.scene.geometry, launcher.tracer.features

    def closest(self, origins: Floats, directions: Floats) -> dict[str, Floats]:
        hit = closest_hit(
            self.scene,
            self.features,
            Ray(vectors(origins), vectors(directions)),
            TYPES.Bool(True),
        )
        dr.eval(hit)
        n = len(origins)
        valid = np.broadcast_to(np.array(hit.valid), n)
        return {
            "primitive": np.where(valid, np.broadcast_to(np.array(hit.primitive), n), MISS),
            "distance": np.where(valid, np.broadcast_to(to_host(hit.distance), n), np.inf),
            "point": to_host(hit.point),
            "normal": np.where(valid[:, None], to_host(hit.normal), 0),
        }

    def occluded(self, origins: Floats, directions: Floats, distance: Floats) -> Floats:
        blocked = occluded(
            self.scene,
            Ray(vectors(origins), vectors(directions)),
            TYPES.Float32(distance.astype(np.float32)),
            TYPES.UInt32(0),
            TYPES.Bool(True),
        )
        return np.broadcast_to(np.array(blocked), len(origins))


def vectors(values: Floats) -> Any:
    columns = np.ascontiguousarray(values.astype(np.float32).T)
    return TYPES.Array3f(*(TYPES.Float32(column) for column in columns))


@pytest.fixture(params=SCENES)
def worlds(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> tuple[World, World]:
    """The same shapes as bodies and as facets."""
    shapes = SCENES[request.param]
    bodies = World(shapes)
    monkeypatch.setattr("drpt.kernel.primitives.make_solids", lambda *_: ())
    forget()
    facets = World(shapes)
    assert bodies.scene.solids
    assert not bodies.scene.loose_facets
    assert not facets.scene.solids
    return bodies, facets


def rays(around: float, count: int = 2**14) -> tuple[Floats, Floats]:
    """Random rays from within so far; some run along axes, and with either sign of zero."""
    rng = np.random.default_rng(5)
    origins = around * (rng.random((count, 3)) - 0.5) + 0.25
    directions = sample_uniform_sphere(rng, count)
    along = rng.integers(0, 3, count // 4)
    directions[: len(along)] = np.eye(3)[along] * rng.choice([-1.0, 1.0], (len(along), 1))
    directions[: len(along)] *= rng.choice([-1.0, 1.0], (len(along), 3))  # −0, too
    return origins, normalize(directions)


@pytest.mark.parametrize(
    "around", [3.0, *(pytest.param(x, marks=pytest.mark.slow) for x in (1.0, 6.0))]
)
def test_a_body_is_met_where_its_facets_are(worlds: tuple[World, World], around: float) -> None:
    found, expected = (world.closest(*rays(around)) for world in worlds)
    assert (expected["primitive"] != MISS).mean() > 0.01
    same = found["primitive"] == expected["primitive"]
    assert (~same).mean() <= DOUBTFUL
    hit = same & (found["primitive"] != MISS)
    assert found["distance"][hit] == pytest.approx(expected["distance"][hit], rel=DISTANCE)
    assert np.array_equal(found["normal"][hit], expected["normal"][hit])


def test_a_body_shades_what_its_facets_shade(worlds: tuple[World, World]) -> None:
    start, end = segments_of_the_scene(worlds[0])
    distance = np.linalg.norm(end - start, axis=1)
    way = (end - start) / distance[:, None]
    found, expected = (world.occluded(start, way, distance) for world in worlds)
    assert 0.01 < expected.mean() < 0.99
    assert (found != expected).mean() <= DOUBTFUL


def segments_of_the_scene(world: World, count: int = 2**14) -> tuple[Floats, Floats]:
    """Starts and ends (n, 3), random in the convex hull of the scene, many near its corners."""
    rng = np.random.default_rng(6)
    corners = np.array([place for shape in world.shapes for place in outline(shape)])
    weights = rng.dirichlet(np.full(len(corners), 0.1), 2 * count)
    start, end = (weights @ corners).reshape(2, count, 3)
    return start, end


def outline(shape: Shape) -> Floats:
    return np.array([shape.center]) if isinstance(shape, drpt.Sphere) else shape.vertices


def test_a_ray_stays_in_the_room_if_rounding_has_put_its_origin_outside() -> None:
    world = World(SCENES["a room with a box and a light"])
    points = np.array([(2 + 2e-7, 0.3, 0.1), (0.1, -2 - 2e-7, 0.2)])
    outward = normalize(points * (1, 1, 0))
    hit = world.closest(points, outward)
    assert (hit["primitive"] != MISS).all()
    assert np.abs(hit["distance"]).max() < 2 * SPAWN_OFFSET
    beyond = world.closest(points + 2 * SPAWN_OFFSET * outward, outward)
    assert (beyond["primitive"] == MISS).all()
    front = world.closest(np.array([(0.0, 0, 1.9)]), np.array([(0.0, 0, 1)]))
    assert (front["primitive"] == MISS).all()


@pytest.mark.parametrize(
    "mode", ["mis", *(pytest.param(m, marks=pytest.mark.slow) for m in ("implicit", "explicit"))]
)
@pytest.mark.parametrize("leave_out", [[], [5]])
def test_a_room_is_dark_outside(leave_out: list[int], mode: str) -> None:
    """A lamp inside, and a camera behind the wall."""
    camera = drpt.Camera((0.5, 0.5, -4), (0.5, 0.5, 0), (0, 1, 0), 20, 16, 16)
    lamp = drpt.Sphere((0.5, 0.5, 0.5), 0.1, radiance=10)
    scene = drpt.Scene(camera, [mesh(box(leave_out=leave_out)), lamp])
    assert not drpt.render(scene, 64, 4, mode).image.any()


@pytest.mark.parametrize(
    "size", [1e5, *(pytest.param(x, marks=pytest.mark.slow) for x in (10, 1e3))]
)
def test_a_large_body_is_as_exact_as_the_places_on_it(size: float) -> None:
    """Rays that leave a tilted block, whose face passes the origin, do not meet it again."""
    corners = size * (CORNERS - (0.5, 0.5, 1.0))
    outlines = [corners[list(quad)] @ TILT for quad in QUADS]
    far = drpt.Sphere((0, 0, 0), 4 * size, material=DULL)  # the origin of the kernel stays there
    world = World([mesh(outlines), far])
    up = np.array([0.0, 0, 1]) @ TILT
    rng = np.random.default_rng(9)
    origins = up + 0.5 * sample_uniform_sphere(rng, 2**14)
    first = world.closest(origins, normalize(-up + 0.4 * sample_uniform_sphere(rng, 2**14)))
    assert (first["primitive"] < 6).all()
    away = sample_uniform_sphere(rng, 2**14)
    away *= np.sign(away @ up)[:, None]
    again = world.closest(first["point"], away)
    assert (again["primitive"] >= 6).all()


@pytest.mark.parametrize(
    "mode", ["mis", *(pytest.param(m, marks=pytest.mark.slow) for m in ("implicit", "explicit"))]
)
def test_pictures_of_bodies_are_those_of_facets(mode: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same random numbers, so but few paths differ: those that pass edges by a rounding."""
    scene = drpt.load_scene("cornell-box")
    scene = replace(scene, camera=replace(scene.camera, width=64, height=64))
    bodies = drpt.render(scene, 16, 4, mode, sampler="independent").image
    monkeypatch.setattr("drpt.kernel.primitives.make_solids", lambda *_: ())
    forget()
    facets = drpt.render(scene, 16, 4, mode, sampler="independent").image
    close = np.isclose(bodies, facets, rtol=1e-3).all(axis=2)
    assert close.mean() > 0.99
