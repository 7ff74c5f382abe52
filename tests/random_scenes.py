"""Random valid scenes: wild ones, where renderers break, and tame ones, whose mean can be measured.

All is drawn from a `random.Random`, so that a seed makes a scene again.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias, TypeVar

import numpy as np

import drpt
from drpt.scene.checks import MAX_LENGTH, MIN_LENGTH

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from random import Random

    from numpy.typing import NDArray

    from drpt.scene import Material, Shape
    from tests.oracle.arrays import Floats

    Ball: TypeAlias = tuple[Floats, float]

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
"""Of the six lamps around a tame scene, in sizes of the scene."""

Item = TypeVar("Item")


@dataclass(frozen=True)
class Structure:
    """How many shapes of each kind a scene has: that decides which kernel is compiled.

    ``triangles`` are those of each mesh; a hundred are too many to be constants of the kernel.
    """

    diffuse: int = 0
    phong: int = 0
    lights: int = 0
    flat_meshes: int = 0
    smooth_meshes: int = 0
    mesh_lights: int = 0
    triangles: int = 100


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
    return drpt.Scene(_random_camera(random, choose(random, balls), picture), shapes)


def tame_scene(random: Random, picture: int) -> drpt.Scene:
    """Make a scene of any size with 1 to 6 shapes and six lamps around, seen from near one of them.

    Shapes meet each other at random, but are small against the lamps and far from them: the light
    that a sample finds is bounded, and its mean close to normal, in every mode.
    """
    size = log_uniform(random, *SIZES)
    shapes = [_tame_shape(random, size) for _ in range(random.randint(1, 6))]
    camera = _close_up(random, choose(random, shapes), picture)
    return drpt.Scene(camera, [*shapes, *_lamps(random, size)])


def _lamps(random: Random, size: float) -> list[drpt.Sphere]:
    return [
        drpt.Sphere(
            side * LAMP_DISTANCE * size * axis, LAMP_RADIUS * size, radiance=random.uniform(1, 3)
        )
        for axis in np.eye(3)
        for side in (-1, 1)
    ]


def _close_up(random: Random, shape: Shape, picture: int) -> drpt.Camera:
    """From outside of a sphere, or from somewhere before or behind a mesh."""
    middle, extent, facing = _seen(random, shape)
    view = -3 * extent * facing
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


def _tame_shape(random: Random, size: float) -> Shape:
    center = size * any_direction(random) * random.random()
    radius = size * log_uniform(random, 1e-3, 0.3)
    material = _tame_material(random)
    kind = choose(random, ["sphere", "sphere", "triangle", "quad", "smooth"])
    if kind == "sphere":
        return drpt.Sphere(center, radius, material)
    a, b = normal_vector(random), normal_vector(random)
    corners = radius * np.array([-a - b, a - b, a + b, b - a]) / 2
    faces = [[0, 1, 2]] if kind == "triangle" else [[0, 1, 2], [0, 2, 3]]
    outward = np.cross(a, b) / np.linalg.norm(np.cross(a, b))
    normals = outward + 0.2 * corners / radius if kind == "smooth" else None
    return drpt.Mesh(center + corners, faces, normals, material)


def _tame_material(random: Random) -> Material:
    albedo = [random.uniform(0.2, 1) for _ in range(3)]
    exponent = log_uniform(random, 1, 20)
    return drpt.Diffuse(albedo) if random.random() < 0.5 else drpt.Phong(albedo, exponent)


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
