"""A scene as arrays of primitives, in the order that kernels rely on (host).

Primitives are numbered: flat facets, triangles with interpolated normals, spheres that reflect,
spheres that emit, triangles that emit. So "is a sphere" and "is a light" are ranges of numbers.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

from drpt.kernel.facets import Facet, bounds, has_area, make_facet, merge_coplanar
from drpt.scene import Diffuse, Mesh, Phong, Sphere

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from drpt.scene import Scene, Shape

    Array: TypeAlias = NDArray[np.float64]

UNROLL_LIMIT = 64
"""Up to so many facets, and so many spheres, are tested one by one in the kernel's own code."""
MERGE_LIMIT = 4 * UNROLL_LIMIT
"""Meshes of more triangles than this are not searched for coplanar neighbours."""
DIFFUSE = -1.0
"""Stands for the exponent of a diffuse surface."""
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Of linear sRGB (ITU-R BT.709)."""


@dataclass(frozen=True)
class Primitives:
    """All that a scene's kernels are made from, in float64.

    Attributes
    ----------
    origin
        The point (3,) that everything else is relative to; 0 unless the scene is far from it.
    facets
        Where they are few, the flat ones, the smooth ones and the lights; else none.
    triangles
        Where they are many, the same ones as corners (n, 3, 3); else none.
    planes
        Row (normal, offset) of each facet or triangle.
    smooth_corners, smooth_normals
        Corners and their normals (n, 3, 3) of the triangles with interpolated normals.
    light_corners
        Corners (n, 3, 3) of the triangles that emit.
    spheres
        Row (centre, radius) of each sphere, those that emit last.
    sphere_lights
        How many spheres emit.
    reflectance
        Row (albedo, exponent) of each primitive that reflects.
    radiance
        Of each light (n, 3).
    """

    origin: Array
    facets: tuple[Facet, ...]
    triangles: Array
    planes: Array
    smooth_corners: Array
    smooth_normals: Array
    light_corners: Array
    spheres: Array
    sphere_lights: int
    reflectance: Array
    radiance: Array

    @property
    def first_sphere(self) -> int:
        """Number of the first sphere; smooth triangles stand just before it."""
        return len(self.planes) - len(self.light_corners)

    @property
    def first_smooth(self) -> int:
        """Number of the first triangle with interpolated normals."""
        return self.first_sphere - len(self.smooth_corners)

    @property
    def first_light(self) -> int:
        """Number of the first primitive that emits."""
        return len(self.reflectance)

    @property
    def first_light_triangle(self) -> int:
        """Number of the first triangle that emits, after the last sphere."""
        return self.first_sphere + len(self.spheres)

    @property
    def diffuse(self) -> NDArray[np.bool_]:
        """Which of the reflecting primitives are diffuse; the others are Phong."""
        return np.asarray(self.reflectance[:, 3] == DIFFUSE)

    def light_areas(self) -> Array:
        """Area of each light, (n,)."""
        radii = self.spheres[len(self.spheres) - self.sphere_lights :, 3]
        a, b, c = self.light_corners.swapaxes(0, 1)
        triangles = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
        return np.concatenate([4 * np.pi * radii**2, triangles])

    def light_pmf(self) -> Array:
        """Probability of each light (n,), proportional to its power."""
        power = self.light_areas() * (self.radiance @ LUMINANCE)
        return np.asarray(power / power.sum())

    def blockers(self) -> list[bool]:
        """Whether each facet can stand between two points of the scene."""
        corners = [f.corners for f in self.facets]
        points = np.concatenate([*corners, self.spheres[:, :3]])
        radii = np.zeros(len(points))
        radii[len(points) - len(self.spheres) :] = self.spheres[:, 3]
        return [not bounds(facet, points, radii) for facet in self.facets]


def make_primitives(scene: Scene) -> Primitives:
    """Primitives of a scene."""
    origin = _origin(scene.shapes)
    meshes = [shape for shape in scene.shapes if isinstance(shape, Mesh)]
    spheres = [shape for shape in scene.shapes if isinstance(shape, Sphere)]
    merge = sum(len(mesh.faces) for mesh in meshes) <= MERGE_LIMIT
    flat = [_part(m, origin, merge=merge) for m in meshes if not m.is_light and m.normals is None]
    smooth = [_part(m, origin) for m in meshes if not m.is_light and m.normals is not None]
    lit = [_part(m, origin) for m in meshes if m.is_light]
    dull_spheres = [_Part(s, [_row(s, origin)]) for s in spheres if not s.is_light]
    lit_spheres = [_Part(s, [_row(s, origin)]) for s in spheres if s.is_light]
    polygons = _joined([*flat, *smooth, *lit])
    few = len(polygons) <= UNROLL_LIMIT
    return Primitives(
        origin=origin,
        facets=tuple(map(make_facet, polygons)) if few else (),
        triangles=_stack([] if few else polygons, 3, 3),
        planes=_planes(_stack([polygon[:3] for polygon in polygons], 3, 3)),
        smooth_corners=_stack(_joined(smooth), 3, 3),
        smooth_normals=_stack([n for part in smooth for n in part.normals], 3, 3),
        light_corners=_stack(_joined(lit), 3, 3),
        spheres=_stack(_joined([*dull_spheres, *lit_spheres]), 4),
        sphere_lights=len(lit_spheres),
        reflectance=_rows([*flat, *smooth, *dull_spheres], _reflectance, 4),
        radiance=_rows([*lit_spheres, *lit], lambda shape: shape.radiance or (), 3),
    )


class _Part(NamedTuple):
    """The primitives of a shape; the corner normals of each triangle where it has some."""

    shape: Shape
    primitives: list[Array]
    normals: list[Array] = []  # noqa: RUF012 - never changed


def _part(mesh: Mesh, origin: Array, *, merge: bool = False) -> _Part:
    corners = mesh.vertices[mesh.faces] - origin
    kept = has_area(corners)
    triangles = corners[kept]
    normals = [] if mesh.normals is None else list(mesh.normals[mesh.faces[kept]])
    return _Part(mesh, merge_coplanar(triangles) if merge else list(triangles), normals)


def _row(sphere: Sphere, origin: Array) -> Array:
    return np.array([*(sphere.center - origin), sphere.radius])


def _reflectance(shape: Shape) -> tuple[float, ...]:
    """Row (albedo, exponent); a shape that neither emits nor has a material is black."""
    material = shape.material or Diffuse(0)
    return (*material.albedo, material.exponent if isinstance(material, Phong) else DIFFUSE)


def _joined(parts: list[_Part]) -> list[Array]:
    return [primitive for part in parts for primitive in part.primitives]


def _rows(parts: list[_Part], row: Callable[[Shape], tuple[float, ...]], width: int) -> Array:
    """The row of each part's shape, once for each of its primitives, (n, width)."""
    counts = [len(part.primitives) for part in parts]
    return np.repeat(_stack([np.array(row(part.shape)) for part in parts], width), counts, axis=0)


def _stack(items: list[Array], *shape: int) -> Array:
    return np.stack(items) if items else np.empty((0, *shape))


def _planes(corners: Array) -> Array:
    """Row (normal, offset) of the plane of each triangle (n, 3, 3)."""
    a, b, c = corners.swapaxes(0, 1)
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return np.column_stack([normals, np.einsum("ij,ij->i", normals, a)])


def _origin(shapes: tuple[Shape, ...]) -> Array:
    """Centre of the shapes on a grid as coarse as their extent: 0 where they are near enough.

    Relative to it, float32 resolves the shapes however far they stand from the scene's own origin.
    """
    low = np.min([_box(shape)[0] for shape in shapes], axis=0)
    high = np.max([_box(shape)[1] for shape in shapes], axis=0)
    grid = 2.0 ** np.ceil(np.log2(np.linalg.norm(high - low)))
    return np.asarray(grid * np.round((low + high) / 2 / grid))


def _box(shape: Shape) -> tuple[Array, Array]:
    if isinstance(shape, Sphere):
        center = np.array(shape.center)
        return center - shape.radius, center + shape.radius
    return shape.vertices.min(axis=0), shape.vertices.max(axis=0)
