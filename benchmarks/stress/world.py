"""Shapes in drpt and in Mitsuba: closest hits of rays that the host chooses; meshes to shoot at."""

from __future__ import annotations

from itertools import chain, pairwise, product
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import drjit as dr
import numpy as np

from benchmarks.stress.pictures import camera_at
from drpt import Diffuse, Mesh, Mode, Scene, Sphere
from drpt.crosscheck import to_mitsuba
from drpt.crosscheck.variant import load_mitsuba
from drpt.kernel.camera import Ray
from drpt.kernel.intersect import closest_hit
from drpt.kernel.launch import make_launcher
from drpt.kernel.primitives import make_primitives
from tests.conftest import TYPES, to_host
from tests.oracle.arrays import dot, normalize, sample_uniform_sphere

if TYPE_CHECKING:
    from drpt.scene import Shape
    from tests.oracle.arrays import Bools, Floats, Ints

DULL = Diffuse(0.5)


class Found(NamedTuple):
    """Hits on the host.

    Whether they are of a surface that ``reflects``, and of which ``sphere``, counted from 0, in a
    world without meshes; where new rays start, and the normal on that side.
    """

    reflects: Bools
    sphere: Ints
    point: Floats
    normal: Floats


class Drpt:
    """Shapes whose kernel has its origin at that of the scene, and the rays that meet them."""

    def __init__(self, *shapes: Shape) -> None:
        scene = Scene(camera_at((0, 0, 9), (0, 0, 0)), shapes)
        launcher = make_launcher(TYPES, scene, 1, Mode.MIS, "independent", jitter=False)
        self.scene, self.features = launcher.tracer.scene.geometry, launcher.tracer.features
        if make_primitives(scene.shapes).origin.any():
            raise ValueError("shapes: they are so far aside that the kernel's origin moves along")

    def closest(self, origins: Floats, directions: Floats) -> Found:
        """Closest hits of rays (n, 3), rounded to float32."""
        types = self.scene.types
        ray = Ray(self._vectors(origins), self._vectors(directions))
        hit = closest_hit(self.scene, self.features, ray, types.Bool(True))
        dr.eval(hit)
        n = len(origins)
        valid, primitive = (np.broadcast_to(np.array(x), n) for x in (hit.valid, hit.primitive))
        return Found(
            valid & (primitive < self.scene.first_light),
            primitive.astype(np.int64),
            to_host(hit.point),
            to_host(hit.normal),
        )

    def _vectors(self, values: Floats) -> Any:
        types = self.scene.types
        columns = np.ascontiguousarray(values.astype(np.float32).T)
        return types.Array3f(*(types.Float32(column) for column in columns))


class Mitsuba:
    """The same shapes in Mitsuba."""

    def __init__(self, *shapes: Shape) -> None:
        self.mi = load_mitsuba()
        self.scene = to_mitsuba(Scene(camera_at((0, 0, 9), (0, 0, 0)), shapes))

    def closest(self, origins: Floats, directions: Floats) -> Found:
        """Closest hits of rays (n, 3), rounded to float32."""
        mi = self.mi
        ray = mi.Ray3f(mi.Point3f(origins.T.astype("f")), mi.Vector3f(directions.T.astype("f")))
        hit = self.scene.ray_intersect(ray)
        number = mi.UInt32(0)
        for shape in self.scene.shapes():
            number[hit.shape == mi.ShapePtr(shape)] = int(shape.id().removeprefix("shape"))
        normal = mi.Vector3f(dr.select(dr.dot(hit.n, ray.d) < 0, hit.n, -hit.n))
        return Found(
            np.asarray(hit.is_valid() & ~hit.shape.is_emitter(), bool),
            np.asarray(number, np.int64),
            to_host(hit.spawn_ray(normal).o),
            to_host(normal),
        )


World: TypeAlias = type[Drpt | Mitsuba]


def beside(size: float, offset: float) -> tuple[Floats, Sphere]:
    """A place so many sizes from the origin, and a light that keeps the kernel's origin there."""
    center = offset * size * np.array([0.6, -0.64, 0.48])
    return center, Sphere(-1.1 * center - 4 * size, 0.1 * (4 + offset) * size, radiance=1)


def grazing(rng: np.random.Generator, normal: Floats) -> Floats:
    """Directions (n, 3) above a surface by 1e-7 to 1 radians."""
    along = normalize(np.cross(normal, sample_uniform_sphere(rng, len(normal))))
    height = 10 ** rng.uniform(-7, 0, (len(normal), 1))
    return normalize(along + height * normal)


def icosphere(levels: int, center: Floats, radius: float) -> Mesh:
    """An icosahedron on a sphere, its triangles split into four so many times."""
    golden = (1 + 5**0.5) / 2
    signs = [*product((-1, 1), (-golden, golden))]
    vertices = normalize(np.array([np.roll([0, a, b], k) for k in range(3) for a, b in signs]))
    edge = min(np.linalg.norm(vertices[1:] - vertices[0], axis=1)) * 1.001
    near = np.linalg.norm(vertices[:, None] - vertices, axis=-1) < edge
    triples = np.array([*product(range(12), repeat=3)])
    a, b, c = triples.T
    corners = vertices[triples[(a < b) & (b < c) & near[a, b] & near[b, c] & near[a, c]]]
    for _ in range(levels):
        a, b, c = corners.swapaxes(0, 1)
        ab, bc, ca = normalize(a + b), normalize(b + c), normalize(c + a)
        parts = [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        corners = np.concatenate([np.stack(part, axis=1) for part in parts])
    return outward(corners, center, radius)


def outward(corners: Floats, center: Floats, radius: float) -> Mesh:
    """A mesh of triangles (n, 3, 3) around the origin, all turned outward, scaled and moved."""
    turns = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    corners = np.where(
        (dot(turns, corners.sum(axis=1)) < 0)[:, None, None], corners[:, ::-1], corners
    )
    unique, index = np.unique(corners.reshape(-1, 3).round(12), axis=0, return_inverse=True)
    return Mesh(center + radius * unique, index.reshape(-1, 3), material=DULL)


NEEDLES = (-1.0, -1 + 1e-6, -0.5, 0.0, 1e-6, 0.5, 1 - 1e-6, 1.0)
"""Cuts of a cube into strips a millionth as wide as long."""


def cube(center: Floats, radius: float, cuts: tuple[float, ...] = (-1.0, 1.0)) -> Mesh:
    """A cube, ``radius`` from its centre to its faces, which are cut along both of their axes."""
    strips = [*pairwise(cuts)]
    squares = [[(a, c), (b, c), (b, d), (a, d)] for (a, b), (c, d) in product(strips, repeat=2)]
    flat = np.array(squares)[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 2)
    faces = [
        np.roll(np.dstack([flat, np.full(flat.shape[:2], side)]), axis, axis=2)
        for side in (-1.0, 1.0)
        for axis in range(3)
    ]
    return outward(np.concatenate(faces), center, radius)


def prism(center: Floats, radius: float, angle: float) -> Mesh:
    """A closed prism of three walls around a point; two of them meet at that angle.

    The third is ``radius`` away from the point, as the ends are; the edge is so on the other side.
    """
    half = 2 * np.tan(angle / 2)
    low = np.array([(-1.0, 0, -1), (1, -half, -1), (1, half, -1)])
    corners = np.concatenate([low, low * (1, 1, -1)])
    ends = [(0, 1, 2), (3, 4, 5)]
    walls = [[(i, j, j + 3), (i, j + 3, i + 3)] for i, j in ((0, 1), (1, 2), (2, 0))]
    return outward(corners[[*ends, *chain(*walls)]], center, radius)


def wedge(angle: float) -> Mesh:
    """A closed room above z = 0 for |x|, |y| < 1, its ceiling at that angle from x = −1 on."""
    height = 2 * np.tan(angle)
    low = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    high = [(1, -1, height), (1, 1, height)]
    faces = [(0, 3, 2), (0, 2, 1), (0, 4, 5), (0, 5, 3), (1, 2, 5), (1, 5, 4), (0, 1, 4), (3, 5, 2)]
    return Mesh([*low, *high], faces, material=DULL)
