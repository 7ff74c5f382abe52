"""Random valid scenes: wild ones, where renderers break, and tame ones, whose mean can be measured.

All is drawn from a `random.Random`, so that a seed makes a scene again.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, TypeAlias, TypeVar

import numpy as np

import drpt
from drpt.scene.checks import MAX_LENGTH, MIN_LENGTH

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence
    from random import Random

    from numpy.typing import NDArray

    from drpt.scene import Material, Shape
    from tests.oracle.arrays import Floats

    Ball: TypeAlias = tuple[Floats, float]
    Paint: TypeAlias = Callable[[Random], Material]

SIZES = (1e-6, 1e6)
RADIANCES = (1e-30, 1e30)
EXPONENTS = (1e-2, 1e6)
FAR = 1e4
"""So many of its sizes a scene stands away from the origin, at the most."""
THIN = 1e-6
"""Width of a needle."""
FINEST = 1e-9
"""Size of a mesh relative to its coordinates, at least: float64 still tells its needles' corners
apart, far beyond what float32 does."""

LAMP_DISTANCE, LAMP_RADIUS = 5, 3
"""Of the six lamps around a tame scene, in distances of its farthest point from the origin."""

THINNEST = 1e-4
"""Of bodies, relative to their size: thinner ones are facets only."""
THINNEST_HOLLOW = 0.5
"""The same of those that hold others: they are not much larger than these."""
ROOM_MARGIN = 1.1
"""Between a room and what it holds."""
FLOOR = 3
"""Size of a floor in that of what stands on it."""
ROOMS = 0.25
"""Share of tame scenes without lamps that a room holds; and of those with lamps."""

Item = TypeVar("Item")


@dataclass(frozen=True)
class Structure:
    """How many shapes of each kind a scene has: that decides which kernel is compiled.

    ``triangles`` are those of each mesh; a hundred are too many to be constants of the kernel.
    The faces of ``bodies`` and of a ``room``, which holds all else, are constants always.
    """

    diffuse: int = 0
    phong: int = 0
    lights: int = 0
    flat_meshes: int = 0
    smooth_meshes: int = 0
    mesh_lights: int = 0
    triangles: int = 100
    bodies: int = 0
    room: bool = False


@dataclass(frozen=True)
class Body:
    """A convex body in the unit ball, some of its faces left out.

    ``vertices`` (n, 3) are around their mean, the origin. ``faces`` are the numbers of those around
    each face, first the two ends, of which a pyramid's second is a point. ``opening`` tells which
    are left out.
    """

    vertices: Floats
    faces: list[list[int]]
    opening: list[int]

    @property
    def inradius(self) -> float:
        """Distance of the nearest face's plane from the origin."""
        corners = [self.vertices[face[:3]] for face in self.faces if len(face) > 2]
        normals = [np.cross(b - a, c - a) for a, b, c in corners]
        return min(
            abs(float(corner @ normal)) / float(np.linalg.norm(normal))
            for (corner, *_), normal in zip(corners, normals, strict=True)
        )


if TYPE_CHECKING:
    Maker: TypeAlias = Callable[[Random, Structure, Floats, float], Shape]


def random_scene(random: Random, structure: Structure, picture: int) -> drpt.Scene:
    """Make a wild scene of any size anywhere; its picture has so many pixels a side."""
    size = log_uniform(random, *SIZES)
    away = choose(random, [0, 0, 1, log_uniform(random, 1, FAR)])
    place = away * size * unit_vector(random)
    balls: list[Ball] = []
    shapes: list[Shape] = []
    for make in _makers(structure):
        balls.append(_within_limits(*_random_ball(random, size, place, balls)))
        shapes.append(make(random, structure, *balls[-1]))
    for _ in range(structure.bodies):
        balls.append(_within_limits(*_random_ball(random, size, place, balls)))
        shapes += _random_bodies(random, *balls[-1], _random_material)
    if structure.room:
        center, radius = _within_limits(*_ball_around(balls))
        room = _random_body(random, THINNEST_HOLLOW)
        balls.append((center, ROOM_MARGIN * radius / room.inradius))
        shapes += _meshes(random, room, *balls[-1], _random_material)
    return drpt.Scene(_random_camera(random, choose(random, balls), picture), shapes)


def tame_scene(random: Random, picture: int) -> drpt.Scene:
    """Make a scene of any size with 1 to 6 shapes and six lamps around, seen from near one of them.

    Shapes meet each other at random, but are small against the lamps and far from them: the light
    that a sample finds is bounded, and its mean close to normal, in every mode. Some stand in a
    room, without the lamps or with them, and some of these are seen from outside.
    """
    size = log_uniform(random, *SIZES)
    shapes = [part for _ in range(random.randint(1, 6)) for part in _tame_shapes(random, size)]
    scene = drpt.Scene(_close_up(random, choose(random, shapes), picture), shapes)
    if random.random() < ROOMS:
        scene = _in_room(random, scene)
    scene = drpt.Scene(scene.camera, [*scene.shapes, *_lamps(random, _reach(scene))])
    return _in_room(random, scene) if random.random() < ROOMS else scene


def _in_room(random: Random, scene: drpt.Scene) -> drpt.Scene:
    """The same scene in a room; half the cameras look from outside, into the room if it is open."""
    room = _random_body(random, THINNEST_HOLLOW)
    radius = ROOM_MARGIN * _reach(scene) / room.inradius
    walls = _meshes(random, room, np.zeros(3), radius, _tame_material)
    camera = scene.camera
    if random.random() < 0.5:
        face = room.opening[0] if room.opening else 0
        outward = room.vertices[room.faces[face]].mean(axis=0)
        eye = 2 * radius * outward / np.linalg.norm(outward)
        up = np.eye(3)[np.abs(eye).argmin()]
        camera = replace(camera, eye=eye, target=(0, 0, 0), up=up)
    return drpt.Scene(camera, [*scene.shapes, *walls])


def _reach(scene: drpt.Scene) -> float:
    """Distance from the origin to the farthest point of a scene, its camera included."""
    points = [np.linalg.norm(scene.camera.eye)]
    for shape in scene.shapes:
        if isinstance(shape, drpt.Sphere):
            points.append(np.linalg.norm(shape.center) + shape.radius)
        else:
            points.append(np.linalg.norm(shape.vertices, axis=1).max())
    return float(max(points))


def _lamps(random: Random, reach: float) -> list[drpt.Sphere]:
    return [
        drpt.Sphere(
            side * LAMP_DISTANCE * reach * axis, LAMP_RADIUS * reach, radiance=random.uniform(1, 3)
        )
        for axis in np.eye(3)
        for side in (-1, 1)
    ]


def _close_up(random: Random, shape: Shape, picture: int) -> drpt.Camera:
    """From outside of a sphere, or from somewhere before or behind a mesh."""
    middle, extent, facing = _seen(random, shape)
    view = -max(3 * extent, 2 * MIN_LENGTH) * facing
    up = np.eye(3)[np.abs(view).argmin()]
    return drpt.Camera(middle - view, middle, up, 20, picture, picture)


def _seen(random: Random, shape: Shape) -> tuple[Floats, float, Floats]:
    direction = any_direction(random)
    if isinstance(shape, drpt.Sphere):
        return np.array(shape.center), shape.radius, direction
    middle = shape.vertices.mean(axis=0)
    a, b, c = shape.vertices[:3] - middle
    normal = np.cross(b - a, c - a)
    facing = choose(random, [-1, 1]) * normal / np.linalg.norm(normal) + 0.7 * direction
    extent = float(np.linalg.norm(shape.vertices - middle, axis=1).max())
    return middle, extent, facing / np.linalg.norm(facing)


def _tame_shapes(random: Random, size: float) -> list[Shape]:
    """A shape, or a body and what stands with it."""
    center = size * any_direction(random) * random.random()
    radius = size * log_uniform(random, 1e-3, 0.3)
    kind = choose(random, ["sphere", "sphere", "triangle", "quad", "smooth", "body"])
    if kind == "body":
        return _random_bodies(random, center, radius, _tame_material)
    material = _tame_material(random)
    if kind == "sphere":
        return [drpt.Sphere(center, radius, material)]
    a, b = normal_vector(random), normal_vector(random)
    corners = radius * np.array([-a - b, a - b, a + b, b - a]) / 2
    faces = [[0, 1, 2]] if kind == "triangle" else [[0, 1, 2], [0, 2, 3]]
    outward = np.cross(a, b) / np.linalg.norm(np.cross(a, b))
    normals = outward + 0.2 * corners / radius if kind == "smooth" else None
    return [drpt.Mesh(center + corners, faces, normals, material)]


def _tame_material(random: Random) -> Material:
    albedo = [random.uniform(0.2, 1) for _ in range(3)]
    exponent = log_uniform(random, 1, 20)
    return drpt.Diffuse(albedo) if random.random() < 0.5 else drpt.Phong(albedo, exponent)


def _random_bodies(random: Random, center: Floats, radius: float, paint: Paint) -> list[Shape]:
    """A body within a ball; sometimes another one in it, or a floor under it.

    The floor has the material of the face that lies on it.
    """
    extra = choose(random, ["none", "inner", "floor"])
    body = _random_body(random, THINNEST_HOLLOW if extra == "inner" else THINNEST)
    shapes = _meshes(random, body, center, radius, paint)
    if extra == "inner":
        inner = _random_body(random, THINNEST)
        shapes += _meshes(random, inner, center, radius * body.inradius, paint)
    if extra == "floor":
        corners = body.vertices[body.faces[0]]
        middle = corners.mean(axis=0)
        corners = center + radius * (middle + FLOOR * (corners - middle))
        floor = _fans([range(len(corners))])
        shapes.append(drpt.Mesh(corners, floor, material=shapes[0].material))
    return shapes


def _random_body(random: Random, thinnest: float) -> Body:
    """A box, prism, pyramid or frustum, straight or skew, half of them open."""
    count = random.randint(3, 6)
    angles = 2 * np.pi * (np.arange(count) + 0.5) / count
    base = np.column_stack([np.cos(angles), np.sin(angles), np.full(count, -1)])
    taper = choose(random, [0, 1, 1, random.uniform(0.3, 1)])
    skew = choose(random, [0, random.uniform(-0.5, 0.5)])
    top = base[: count if taper else 1] * (taper, taper, -1) + (skew, 0, 0)
    ends = [[*reversed(range(count))], [*range(count, count + len(top))]]
    sides = [
        [*dict.fromkeys((i, j, count + j % len(top), count + i % len(top)))]
        for i, j in pairwise((*range(count), 0))
    ]
    vertices = np.concatenate([base, top])
    vertices -= vertices.mean(axis=0)
    vertices *= [random.uniform(0.5, 1) for _ in range(3)]
    vertices[:, random.randrange(3)] *= choose(random, [1, 1, log_uniform(random, thinnest, 1)])
    if random.random() < 0.7:
        vertices = vertices @ np.linalg.qr([normal_vector(random) for _ in range(3)])[0]
    vertices /= np.linalg.norm(vertices, axis=1).max()
    opening = choose(random, [[], [], [random.randrange(2, 2 + count)], [0], [0, 1]])
    return Body(vertices, [*ends, *sides], opening)


def _meshes(random: Random, body: Body, center: Floats, radius: float, paint: Paint) -> list[Shape]:
    """A body as one mesh, or as one mesh and material for each face; all share their vertices."""
    radius = max(radius, FINEST * float(np.abs(center).max()))
    kept = [face for i, face in enumerate(body.faces) if i not in body.opening and len(face) > 2]
    parts = choose(random, [[kept], [[face] for face in kept]])
    vertices = center + radius * body.vertices
    return [drpt.Mesh(vertices, _fans(part), material=paint(random)) for part in parts]


def _fans(polygons: Iterable[Sequence[int]]) -> list[tuple[int, int, int]]:
    """Triangles of convex polygons."""
    return [(a, b, c) for a, *others in polygons for b, c in pairwise(others)]


def _random_material(random: Random) -> Material:
    if random.random() < 0.5:
        return drpt.Diffuse(random_albedo(random))
    return random_phong(random)


def random_albedo(random: Random) -> list[float]:
    return [choose(random, [0, 1, random.random()]) for _ in range(3)]


def random_phong(random: Random) -> drpt.Phong:
    exponent = choose(random, [0, 1, EXPONENTS[1], log_uniform(random, *EXPONENTS)])
    return drpt.Phong(random_albedo(random), exponent)


def random_radiance(random: Random) -> list[float]:
    return [choose(random, [1, *RADIANCES, log_uniform(random, *RADIANCES)]) for _ in range(3)]


def log_uniform(random: Random, low: float, high: float) -> float:
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def choose(random: Random, items: Sequence[Item]) -> Item:
    return items[random.randrange(len(items))]


def normal_vector(random: Random) -> Floats:
    return np.array([random.gauss() for _ in range(3)])


def any_direction(random: Random) -> Floats:
    vector = normal_vector(random)
    return np.asarray(vector / np.linalg.norm(vector))


def unit_vector(random: Random) -> Floats:
    """Any direction, or one along an axis."""
    if random.random() < 0.3:
        return np.asarray(choose(random, [-1.0, 1.0]) * np.eye(3)[random.randrange(3)])
    return any_direction(random)


def _makers(structure: Structure) -> list[Maker]:
    return [
        *[_diffuse_sphere] * structure.diffuse,
        *[_phong_sphere] * structure.phong,
        *[_sphere_light] * structure.lights,
        *[_flat_mesh] * structure.flat_meshes,
        *[_smooth_mesh] * structure.smooth_meshes,
        *[_mesh_light] * structure.mesh_lights,
    ]


def _diffuse_sphere(random: Random, _: Structure, center: Floats, radius: float) -> drpt.Sphere:
    return drpt.Sphere(center, radius, drpt.Diffuse(random_albedo(random)))


def _phong_sphere(random: Random, _: Structure, center: Floats, radius: float) -> drpt.Sphere:
    return drpt.Sphere(center, radius, random_phong(random))


def _sphere_light(random: Random, _: Structure, center: Floats, radius: float) -> drpt.Sphere:
    return drpt.Sphere(center, radius, radiance=random_radiance(random))


def _flat_mesh(random: Random, structure: Structure, center: Floats, radius: float) -> drpt.Mesh:
    vertices, faces = _triangles(random, structure.triangles, center, radius)
    return drpt.Mesh(vertices, faces, material=drpt.Diffuse(random_albedo(random)))


def _smooth_mesh(random: Random, structure: Structure, center: Floats, radius: float) -> drpt.Mesh:
    vertices, faces = _triangles(random, structure.triangles, center, radius)
    return drpt.Mesh(vertices, faces, _normals(random, len(faces)), random_phong(random))


def _mesh_light(random: Random, structure: Structure, center: Floats, radius: float) -> drpt.Mesh:
    vertices, faces = _triangles(random, structure.triangles, center, radius)
    return drpt.Mesh(vertices, faces, radiance=random_radiance(random))


def _random_ball(random: Random, size: float, place: Floats, earlier: list[Ball]) -> Ball:
    """Centre and radius: anywhere, or the same as, in, around, on or beside an earlier one."""
    if not earlier or random.random() < 0.5:
        center = place + size * normal_vector(random)
        return center, choose(random, [size / 2, log_uniform(random, *SIZES)])
    center, radius = choose(random, earlier)
    factor, direction = log_uniform(random, 1e-3, 1e3), unit_vector(random)
    gap = choose(random, [-1, 1]) * log_uniform(random, 1e-7, 0.1)
    balls = [
        (center, radius),
        (center, radius * (1 + gap)),
        (center, radius * factor),
        (center + radius * direction, radius * factor),
        (center + radius * (1 + factor) * direction, radius * factor),  # touches it
        (center + radius * (1 - factor) * direction, radius * factor),  # from inside
        (center + radius * factor * direction, radius),
    ]
    return choose(random, balls)


def _ball_around(balls: list[Ball]) -> Ball:
    center = np.mean([center for center, _ in balls], axis=0)
    return center, max(float(np.linalg.norm(c - center)) + r for c, r in balls)


def _within_limits(center: Floats, radius: float) -> Ball:
    return center.clip(-MAX_LENGTH / 10, MAX_LENGTH / 10), min(
        max(radius, MIN_LENGTH), MAX_LENGTH / 100
    )


def _triangles(
    random: Random, count: int, middle: Floats, size: float
) -> tuple[Floats, NDArray[np.int64]]:
    """Vertices and faces of triangles anywhere; among them needles, points and the same twice."""
    size = max(size, FINEST * float(np.abs(middle).max()))
    different = [_triangle(random, number) for number in range(count - 1)]
    corners = np.array([*different, different[0]])
    return middle + size * corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)


def _triangle(random: Random, kind: int) -> Floats:
    """Corners (3, 3); of each kind, as many have an area in every mesh: one kernel fits them."""
    a, b, c = (normal_vector(random) for _ in range(3))
    thin, along = log_uniform(random, THIN, 1), random.uniform(-1, 2)
    kinds = [
        (a, b, c),
        (a, b, a + thin * c),
        (a, b, (1 - along) * a + along * b + thin * c),
        (a, a + thin * b, a + thin * c),
        (a, b, c),
        (a, b, b),
        (a, a, a),
    ]
    return np.array(kinds[kind % len(kinds)])


def _normals(random: Random, triangles: int) -> Floats:
    """Normals at the corners of triangles: any, or of each triangle all alike, or opposite."""
    normals = np.array([unit_vector(random) for _ in range(3 * triangles)])
    kind = choose(random, ["any", "alike", "opposite"])
    if kind != "any":
        normals = np.repeat(normals[::3], 3, axis=0)
    if kind == "opposite":
        normals[1::3] *= -1
    return normals


def _random_camera(random: Random, ball: Ball, picture: int) -> drpt.Camera:
    """Looks at a ball from anywhere, from on or in it, or out of its middle."""
    middle, radius = ball
    away = choose(random, [0, 0.5, 1, 1 + 1e-7, 3, 3, 3, 3, log_uniform(random, 1, 1e4)])
    eye = (middle + away * radius * unit_vector(random)).clip(-MAX_LENGTH, MAX_LENGTH)
    view = middle - eye
    if np.linalg.norm(view) < FINEST * max(1, np.abs(eye).max()):
        view = max(1, np.abs(eye).max()) * unit_vector(random)
    up = np.eye(3)[np.abs(view).argmin()]
    target = (eye + view).clip(-MAX_LENGTH, MAX_LENGTH)
    fov = choose(random, [40, 60, 175, log_uniform(random, 1e-3, 179)])
    return drpt.Camera(eye, target, up, fov, picture, picture)
