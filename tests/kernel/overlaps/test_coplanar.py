"""Random sheets in one plane against the float64 oracle: the later shape is seen, without seams."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

import drpt
from tests.kernel.test_intersect import World, dull
from tests.oracle import geometry
from tests.oracle.arrays import normalize

if TYPE_CHECKING:
    from tests.oracle.arrays import Floats, Ints

RAYS = 2000
# A ray is compared only if rays to points at this distance from its target, in units of the sheets,
# should hit the same shape: seams may be off by 1e-6.
DOUBT = 1e-4
# The oracle computes distances to surfaces in one plane that differ by this rounding.
ROUNDING = 1e-9
LAYOUTS = "polygons", "bodies", "Embree"


class Place:
    """A random rotation, scale and translation; points may be rounded to float32."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.scale = 10 ** rng.uniform(-3, 4)
        self.turn = (
            np.linalg.qr(rng.standard_normal((3, 3)))[0] if rng.random() < 0.7 else np.eye(3)
        )
        self.move = rng.uniform(-3, 3, 3)
        self.rounded = rng.random() < 0.3

    def __call__(self, points: Floats) -> Floats:
        placed = self.scale * (np.asarray(points) @ self.turn.T + self.move)
        return placed.astype(np.float32).astype(np.float64) if self.rounded else placed

    def exact(self, points: Floats) -> Floats:
        return np.asarray(self.scale * (points @ self.turn.T + self.move))


def sheets(rng: np.random.Generator, place: Place) -> list[drpt.Mesh]:
    """Fans of triangles in the plane z = 0, convex ones and others, that face either way."""
    found = []
    for index in range(rng.integers(2, 6)):
        corners = rng.integers(3, 8)
        angles = np.sort(rng.uniform(0, 2 * np.pi, corners))
        radius = rng.uniform(0.3, 1.2)
        flat = rng.uniform(-0.7, 0.7, 2) + radius * np.stack([np.cos(angles), np.sin(angles)], 1)
        last = np.arange(2, corners)
        faces = np.stack([0 * last, last - 1, last], axis=1)[:, :: rng.choice([-1, 1])]
        points = np.column_stack([flat, 0 * angles])
        found.append(drpt.Mesh(place(points), faces, material=dull(index)))
    return found


def others(rng: np.random.Generator, place: Place, layout: str) -> list[drpt.Mesh]:
    """A closed box beneath the sheets whose top is in their plane, or many triangles below it."""
    if layout == "polygons":
        return []
    if layout == "Embree":
        corners = rng.uniform(-1, 1, (100, 1, 3)) - [0, 0, 5] + 0.1 * rng.normal(size=(100, 3, 3))
        soup = place(corners.reshape(-1, 3))
        return [drpt.Mesh(soup, np.arange(300).reshape(-1, 3), material=dull(9))]
    box = np.array([[x, y, z] for x in (-0.8, 0.9) for y in (-0.7, 0.6) for z in (-1.0, 0)])
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = [[q[0], q[i], q[i + 1]] for q in quads for i in (1, 2)]
    return [drpt.Mesh(place(box), faces, material=dull(9))]


def latest(shapes: list[drpt.Mesh], origins: Floats, directions: Floats) -> Ints:
    """The last of the nearest shapes along each ray, -1 for none."""
    t = np.array([geometry.closest_hit([shape], origins, directions).t for shape in shapes])
    last = len(shapes) - 1 - (t <= (1 + ROUNDING) * t.min(axis=0))[::-1].argmax(axis=0)
    return np.where(t.min(axis=0) < np.inf, last, -1)


def exact(shapes: list[drpt.Mesh], place: Place) -> list[drpt.Mesh]:
    """The same shapes with the sheets exactly in one plane."""
    copies = []
    for shape in shapes:
        local = (shape.vertices / place.scale - place.move) @ place.turn
        local[np.abs(local[:, 2]) < 1e-4, 2] = 0
        copies.append(drpt.Mesh(place.exact(local), shape.faces, material=shape.material))
    return copies


def rays(rng: np.random.Generator, place: Place) -> tuple[Floats, Floats, Floats]:
    """Origins above the sheets, and targets on them, also where they are before they are placed."""
    above = np.column_stack([rng.uniform(-2, 2, (RAYS, 2)), rng.uniform(0.5, 3, RAYS)])
    on = np.column_stack([rng.uniform(-1.5, 1.5, (RAYS, 2)), np.zeros(RAYS)])
    return place.exact(above), place.exact(on), on


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize(
    "seed", [pytest.param(s, marks=pytest.mark.slow if s else ()) for s in range(6)]
)
def test_the_later_shape_is_seen(layout: str, seed: int) -> None:
    rng = np.random.default_rng([seed, LAYOUTS.index(layout)])
    place = Place(rng)
    shapes = sheets(rng, place)
    for other in others(rng, place, layout):
        shapes.insert(int(rng.integers(len(shapes) + 1)), other)
    lamp = drpt.Sphere(place.exact(np.array([0, 0, 9.0])), place.scale, radiance=1)
    world = World(*shapes, lamp)
    assert world.primitives.overlaps
    origins, targets, local = rays(rng, place)
    origins = world.rounded(origins)
    truth = exact(shapes, place)
    expected = latest(truth, origins, normalize(targets - origins))
    sure = np.ones(RAYS, bool)
    for step in DOUBT * np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]]):
        beside = place.exact(local + step)
        sure &= latest(truth, origins, normalize(beside - origins)) == expected
    found = world.closest(origins, normalize(targets - origins))
    assert sure.mean() > 0.95
    assert (np.where(found.valid, found.shape, -1) == expected)[sure].all()


@pytest.mark.parametrize("layout", ["polygons", "Embree"])
def test_no_ray_slips_through_seams(layout: str) -> None:
    """Rays to the borders of pieces, of what covers them, and of triangles that are not cut."""
    rng = np.random.default_rng(5)
    place = Place(rng)
    place.scale, place.rounded = 1.0, False
    steps = np.linspace(-1.0, 1, 5)
    grid = np.array([[x, y, 0] for x in steps for y in steps])
    corner = np.array([5 * i + j for i in range(4) for j in range(4)])
    faces = np.concatenate([corner[:, None] + [0, 5, 6], corner[:, None] + [0, 6, 1]])
    floor = drpt.Mesh(place(grid), faces, material=dull(0))
    covers = []
    for index in range(1, 4):  # the last one shares borders with triangles of the floor
        angle, reach = (0.0, 0.5) if index == 3 else (rng.uniform(0, 6), rng.uniform(0.2, 0.4))
        turned = angle + np.pi / 4 + np.pi / 2 * np.arange(4)
        flat = reach * np.sqrt(2) * np.stack([np.cos(turned), np.sin(turned), 0 * turned], axis=1)
        flat += [*rng.uniform(-0.3, 0.3, 2), 0] if index < 3 else [-0.5, -0.5, 0]
        covers.append(drpt.Mesh(place(flat), [(0, 1, 2), (0, 2, 3)], material=dull(index)))
    far = others(rng, place, layout)
    world = World(floor, *covers, *far, drpt.Sphere(place(np.array([0, 0, 9.0])), 1, radiance=1))
    pieces = [facet.corners for facet in world.primitives.facets] or [*world.primitives.triangles]
    flat_pieces = [
        outline
        for outline, shape in zip(pieces, world.primitives.shape.tolist(), strict=False)
        if shape < 4
    ]
    borders = np.concatenate([np.stack([o, np.roll(o, -1, axis=0)], axis=1) for o in flat_pieces])
    share = np.concatenate([[0, 1], rng.uniform(0, 1, 60)])[:, None, None]
    targets = (borders[:, 0] + share * (borders[:, 1] - borders[:, 0])).reshape(-1, 3)
    targets += world.primitives.origin
    local = (targets - place.move) @ place.turn
    targets, local = (x[np.abs(local[:, :2]).max(axis=1) < 1 - DOUBT] for x in (targets, local))
    origins = place.exact(np.column_stack([local[:, :2] * 0.5, np.full(len(local), 1.3)]))
    origins = world.rounded(origins)
    found = world.closest(origins, normalize(targets - origins))
    assert len(targets) > 3000
    assert found.valid.all()
    assert (found.shape < 4).all()
