"""The primitives of each shape of a scene, relative to an origin (host)."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

from drpt.kernel.facets import area_vectors, has_area
from drpt.scene import Mesh, Sphere

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from drpt.scene import Shape

    Array: TypeAlias = NDArray[np.float64]
    Indices: TypeAlias = NDArray[np.intp]

NO_TRIANGLES = np.empty((0, 3, 3))
NO_VECTORS = np.empty((0, 3))
ORIGIN = np.zeros(3)
FEW_PARTS = 16
"""Triangles of no more parts than this are taken from each; those of more are copied first."""
NO_FACES = np.empty((0, 3), np.int32)


class Part(NamedTuple):
    """The primitives of a shape: a sphere's row (1, 4), or a mesh' polygons.

    Polygons are triangles (n, 3, 3), with ``normals`` at their corners where the mesh has some, and
    ``area_vectors`` (n, 3), twice as long as their areas; or a list of outlines (k, 3), once they
    are merged. ``is_cut`` tells whether some of the mesh is left out. ``zero`` is the point (3,)
    from which the numbers count that its corners are rounded to: the origin, or that of the scene.
    Triangles that are not cut have corners that are ``points`` (p, 3), by ``faces`` (n, 3).
    """

    number: int
    shape: Shape
    primitives: Array | list[Array]
    normals: Array = NO_TRIANGLES
    area_vectors: Array = NO_VECTORS
    is_cut: bool = False
    zero: Array = ORIGIN
    points: Array = NO_VECTORS
    faces: NDArray[np.int32] = NO_FACES

    @property
    def is_light(self) -> bool:
        """Whether its shape emits."""
        return self.shape.is_light

    @property
    def triangles(self) -> Array:
        """The polygons of a mesh that are not merged: triangles (n, 3, 3)."""
        return np.asarray(self.primitives)


class Triangles(NamedTuple):
    """The triangles of all meshes, in the order of their shapes.

    ``parts`` are those of the meshes, ``first`` (parts + 1,) the number of the first triangle of
    each, ``part`` (n,) the place of each triangle's part, ``vectors`` the `Part.area_vectors`,
    ``zeros`` (parts, 3) the `Part.zero` of each. Where there are many parts, ``together`` are the
    corners (n, 3, 3) of all.
    """

    parts: list[Part]
    first: Indices
    part: Indices
    vectors: Array
    zeros: Array
    together: Array | None

    @property
    def light(self) -> NDArray[np.bool_]:
        """Whether each triangle (n,) emits."""
        return np.array([part.is_light for part in self.parts], bool)[self.part]

    def reach(self, numbers: Indices, corners: Array) -> Array:
        """Largest coordinate (k,) of some triangles (k, 3, 3): their rounding is relative to it."""
        zeros = self.zeros[self.part[numbers]]
        both = np.maximum(np.abs(corners), np.abs(corners - zeros[:, None]))
        return np.asarray(both.max(axis=(1, 2), initial=0))

    def corners(self, numbers: Indices) -> Array:
        """Corners (k, 3, 3) of some triangles (k,)."""
        if self.together is not None:
            return self.together[numbers]
        corners = np.empty((len(numbers), 3, 3))
        for place, part in enumerate(self.parts):
            own = np.flatnonzero(self.part[numbers] == place)
            corners[own] = part.triangles[numbers[own] - self.first[place]]
        return corners


def all_triangles(parts: list[Part]) -> Triangles:
    """The triangles of the meshes among parts that are not merged yet."""
    meshes = [part for part in parts if isinstance(part.shape, Mesh)]
    counts = [len(part.primitives) for part in meshes]
    many = len(meshes) > FEW_PARTS
    return Triangles(
        meshes,
        np.cumsum([0, *counts]),
        np.repeat(np.arange(len(meshes)), counts),
        np.concatenate([NO_VECTORS, *(part.area_vectors for part in meshes)]),
        np.array([part.zero for part in meshes]).reshape(-1, 3),
        np.concatenate([part.triangles for part in meshes]) if many else None,
    )


def make_parts(shapes: tuple[Shape, ...], origin: Array) -> list[Part]:
    """The parts of all shapes; triangles without an area are left out."""
    return [_part(number, shape, origin) for number, shape in enumerate(shapes)]


def _part(number: int, shape: Shape, origin: Array) -> Part:
    if isinstance(shape, Sphere):
        return Part(number, shape, np.array([[*(shape.center - origin), shape.radius]]))
    points, faces = shape.vertices - origin, shape.faces
    corners = points[faces]
    vectors = area_vectors(corners)
    kept = has_area(vectors)
    if not kept.all():
        corners, vectors, faces = corners[kept], vectors[kept], faces[kept]
    normals = NO_TRIANGLES
    if shape.normals is not None and not shape.is_light:
        normals = shape.normals[faces]
    moved = origin.any() and _is_float32(shape.vertices)
    zero = -origin if moved else ORIGIN
    return Part(number, shape, corners, normals, vectors, False, zero, points, faces)


def _is_float32(numbers: Array) -> bool:
    """Whether numbers have been rounded to float32, as those of many mesh files are."""
    return bool((numbers.astype(np.float32) == numbers).all())


def origin_of(shapes: tuple[Shape, ...]) -> Array:
    """Centre of the shapes on a grid as coarse as their extent: 0 where they are near enough.

    Relative to it, float32 resolves the shapes however far they stand from the scene's own origin.
    """
    spheres = [(*shape.center, shape.radius) for shape in shapes if isinstance(shape, Sphere)]
    centers, radii = np.split(np.array(spheres).reshape(-1, 4), [3], axis=1)
    meshes = [shape.vertices for shape in shapes if isinstance(shape, Mesh)]
    low = np.vstack([centers - radii, *(mesh.min(axis=0) for mesh in meshes)]).min(axis=0)
    high = np.vstack([centers + radii, *(mesh.max(axis=0) for mesh in meshes)]).max(axis=0)
    extent = np.linalg.norm(high - low)
    if extent == 0:
        return np.asarray(low)
    grid = 2.0 ** np.ceil(np.log2(extent))
    return np.asarray(grid * np.round((low + high) / 2 / grid))
