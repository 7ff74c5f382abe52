"""The primitives of each shape of a scene, relative to an origin (host)."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

from drpt.kernel.facets import area_vectors, has_area
from drpt.scene import Mesh, Sphere
from drpt.scene.bounds import bounds

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from drpt.scene import Shape

    Array: TypeAlias = NDArray[np.float64]
    Indices: TypeAlias = NDArray[np.intp]

NO_TRIANGLES = np.empty((0, 3, 3))
NO_VECTORS = np.empty((0, 3))
ORIGIN = np.zeros(3)
FEW_PARTS = 16
"""Up to this number of parts, corners are gathered part by part; else they are copied first."""
NO_FACES = np.empty((0, 3), np.int32)


class Part(NamedTuple):
    """The primitives of a shape.

    Attributes
    ----------
    number, shape
        The shape, and its number in the scene.
    primitives
        Row (1, 4) of a sphere, or triangles (n, 3, 3) of a mesh, or a list of outlines (k, 3) of
        polygons, once triangles are merged.
    normals
        Normals at the corners of the triangles, (n, 3, 3), if the mesh has any.
    area_vectors
        Normals (n, 3) of the triangles, twice as long as their areas.
    is_cut
        Whether overlapping shapes have cut the mesh.
    zero
        The point (3,) relative to which the corners are rounded: the origin of the kernels, or that
        of the scene if the mesh came in float32.
    points, faces
        Vertices (p, 3) and indices (n, 3) of the triangles of a mesh that is not cut.
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
        """Whether the shape emits."""
        return self.shape.is_light

    @property
    def triangles(self) -> Array:
        """The triangles (n, 3, 3) of a mesh, before any are merged."""
        return np.asarray(self.primitives)


class Triangles(NamedTuple):
    """The triangles of all meshes, in the order of their shapes.

    Attributes
    ----------
    parts
        The parts of the meshes.
    first
        Number of the first triangle of each part, and that of all triangles, (parts + 1,).
    part
        Index into ``parts`` of each triangle (n,).
    vectors
        `Part.area_vectors` of each triangle (n, 3).
    zeros
        `Part.zero` of each part (parts, 3).
    together
        Corners (n, 3, 3) of all triangles if there are more than `FEW_PARTS` parts.
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
        """Largest coordinate (k,) of some triangles (k, 3, 3); their rounding is relative to it."""
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

    def larger(self, pairs: Indices) -> tuple[Indices, Array]:
        """The larger triangle (k,) of each pair (k, 2), and its unit normal (k, 3)."""
        areas = np.linalg.norm(self.vectors[pairs], axis=2)
        rows, larger = np.arange(len(pairs)), areas.argmax(axis=1)
        numbers = pairs[rows, larger]
        return numbers, self.vectors[numbers] / areas[rows, larger, None]


def all_triangles(parts: list[Part]) -> Triangles:
    """The triangles of all meshes among the parts, before any are merged."""
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
    """Whether all numbers fit float32, as those of many mesh files do."""
    return bool((numbers.astype(np.float32) == numbers).all())


def origin_of(shapes: tuple[Shape, ...]) -> Array:
    """Centre (3,) of the shapes, rounded to a grid as coarse as their extent: 0 if they are near 0.

    Relative to it, float32 resolves the shapes however far they are from the scene's own origin.
    """
    low, high = bounds(shapes)
    extent = np.linalg.norm(high - low)
    if extent == 0:
        return np.asarray(low)
    grid = 2.0 ** np.ceil(np.log2(extent))
    return np.asarray(grid * np.round((low + high) / 2 / grid))
