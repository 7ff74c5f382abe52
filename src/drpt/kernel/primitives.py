"""A scene as arrays of primitives, in the order that kernels rely on (host).

Primitives are numbered: flat facets, triangles with interpolated normals, spheres that reflect,
spheres that emit, triangles that emit. So "is a sphere" and "is a light" are ranges of numbers.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

from drpt.kernel.facets import (
    COPLANAR,
    area_normal,
    area_vectors,
    bounds,
    make_facet,
    merge_coplanar,
)
from drpt.kernel.overlaps import resolve_overlaps
from drpt.kernel.parts import NO_TRIANGLES, NO_VECTORS, make_parts, origin_of
from drpt.kernel.solids import make_solids
from drpt.kernel.spheres import SphereLayout, lay_out
from drpt.scene import Diffuse, Mesh, Sphere
from drpt.scene.materials import MATERIALS

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from drpt.kernel.facets import Facet
    from drpt.kernel.overlaps import Overlap
    from drpt.kernel.parts import Part
    from drpt.kernel.solids import Solid
    from drpt.scene import Material, Shape

    Array: TypeAlias = NDArray[np.float64]

FACET_LIMIT = 64
"""Up to so many facets that reflect are met one by one in the kernel.

Embree is as fast as 110, but kernels of so many take seconds to compile.
"""
LIGHT_FACET_LIMIT = 24
"""Likewise of those that emit, where Embree is as fast."""
MERGE_LIMIT = 4 * FACET_LIMIT
"""Meshes of more triangles than this are not searched for coplanar neighbours."""
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Of linear sRGB (ITU-R BT.709)."""


@dataclass(frozen=True)
class Primitives:
    """All that a scene's kernels are made from, in float64.

    Attributes
    ----------
    origin
        The point (3,) that everything else is relative to; 0 unless the scene is far from it.
    planes
        Row (normal, offset) of each triangle or polygon.
    facets, triangles
        Those that reflect: where they are few, as facets; else as the corners (n, 3, 3) of a mesh.
    light_facets
        Those that emit, where they are few.
    smooth_corners, smooth_normals
        Corners and their normals (n, 3, 3) of the triangles with interpolated normals.
    light_corners
        Corners (n, 3, 3) of the triangles that emit.
    spheres
        Row (centre, radius) of each sphere, those that emit last.
    sphere_lights
        How many spheres emit.
    reflectance
        Row (albedo, code) of the material of each primitive that reflects.
    radiance
        Of each light (n, 3).
    shape
        Number of each primitive's shape in the scene; of coincident lights, the first's.
    overlaps
        Pairs of shapes that overlap, the earlier of which is cut.
    is_cut
        Whether some triangles are pieces of a triangle that was cut.
    """

    origin: Array
    planes: Array
    facets: tuple[Facet, ...]
    triangles: Array
    light_facets: tuple[Facet, ...]
    smooth_corners: Array
    smooth_normals: Array
    light_corners: Array
    spheres: Array
    sphere_lights: int
    reflectance: Array
    radiance: Array
    shape: NDArray[np.intp]
    overlaps: tuple[Overlap, ...]
    is_cut: bool

    def __post_init__(self) -> None:
        """Make the arrays read-only: renders of the same shapes share them."""
        for value in vars(self).values():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False

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
    def diffuse(self) -> NDArray[np.bool_]:
        """Which of the reflecting primitives are diffuse."""
        return np.logical_or.reduce(
            [kind.has(self.reflectance[:, 3]) for kind in MATERIALS if kind.is_diffuse]
        )

    @property
    def kinds(self) -> tuple[type[Material], ...]:
        """Kinds of materials of the reflecting primitives."""
        return tuple(kind for kind in MATERIALS if kind.has(self.reflectance[:, 3]).any())

    @cached_property
    def facet_areas(self) -> Array:
        """Area of each facet, (n,)."""
        areas = np.array([np.linalg.norm(area_normal(facet.corners)) for facet in self.facets])
        areas.flags.writeable = False
        return areas

    def light_areas(self) -> Array:
        """Area of each light, (n,)."""
        radii = self.spheres[len(self.spheres) - self.sphere_lights :, 3]
        a, b, c = self.light_corners.swapaxes(0, 1)
        triangles = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
        return np.concatenate([4 * np.pi * radii**2, triangles])

    def light_balls(self) -> Array:
        """Centre and radius (n, 4) of a ball around each light."""
        spheres = self.spheres[len(self.spheres) - self.sphere_lights :]
        centers = self.light_corners.mean(axis=1)
        radii = np.linalg.norm(self.light_corners - centers[:, None], axis=2).max(axis=1)
        return np.concatenate([spheres, np.column_stack([centers, radii])])

    def blockers(self) -> list[bool]:
        """Whether each facet can stand between two points of the scene."""
        return [not bounds(facet, *self._balls()) for facet in self.facets]

    @cached_property
    def solids(self) -> tuple[Solid, ...]:
        """The convex bodies among the facets."""
        return make_solids([facet.corners for facet in self.facets], *self._balls())

    @cached_property
    def sphere_layout(self) -> SphereLayout:
        """How the spheres are met, numbered from 0 on."""
        return lay_out(self.spheres)

    @cached_property
    def interior(self) -> bool:
        """Whether a body or a sphere holds all of the scene."""
        return any(solid.encloses for solid in self.solids) or self._in_a_sphere()

    def extent(self, eye: Array) -> float:
        """Diagonal of the box around the scene and an eye (3,): a bound of all distances."""
        low, high = self._corners
        return float(np.linalg.norm(np.maximum(high, eye) - np.minimum(low, eye)))

    @cached_property
    def _corners(self) -> tuple[Array, Array]:
        """Lowest and highest corner (3,) of the box around the scene."""
        points, radii = self._balls()
        return (points - radii[:, None]).min(axis=0), (points + radii[:, None]).max(axis=0)

    def _in_a_sphere(self) -> bool:
        if not len(self.spheres):
            return False
        points, radii = self._balls()
        *center, radius = self.spheres[self.spheres[:, 3].argmax()]  # no smaller one holds it
        reach = np.linalg.norm(points - center, axis=1) + radii
        return bool((reach <= (1 + COPLANAR) * radius).all())

    def _balls(self) -> tuple[Array, Array]:
        """Centres (n, 3) and radii (n,) of balls whose convex hull is that of the scene."""
        outlines = [facet.corners for facet in self.facets]
        triangles = self.triangles.reshape(-1, 3)
        points = np.concatenate([*outlines, triangles, *self.light_corners, self.spheres[:, :3]])
        radii = np.zeros(len(points))
        radii[len(points) - len(self.spheres) :] = self.spheres[:, 3]
        return points, radii


def make_primitives(shapes: tuple[Shape, ...]) -> Primitives:
    """Primitives of the shapes of a scene."""
    origin = origin_of(shapes)
    parts, overlaps = resolve_overlaps(make_parts(shapes, origin))
    dull = [part for part in parts if not part.is_light]
    meshes = [part for part in dull if isinstance(part.shape, Mesh)]
    smooth = [part for part in meshes if len(part.normals)]
    spheres = [part for part in dull if isinstance(part.shape, Sphere)]
    flat, facets = _unrolled([part for part in meshes if not len(part.normals)], smooth)
    lit = [part for part in parts if part.is_light]
    lit_spheres = _lights([part for part in lit if isinstance(part.shape, Sphere)], 4)
    lit_triangles = _lights([part for part in lit if isinstance(part.shape, Mesh)], 3, 3)
    corners = np.concatenate([NO_TRIANGLES, *map(_triangles, (*flat, *smooth))])
    vectors = [_area_vectors(part) for part in (*flat, *smooth)]
    light_corners = lit_triangles.primitives
    few_lights = len(light_corners) <= LIGHT_FACET_LIMIT
    return Primitives(
        origin=origin,
        planes=_planes(
            np.concatenate([corners, light_corners]),
            np.concatenate([NO_VECTORS, *vectors, area_vectors(light_corners)]),
        ),
        facets=facets,
        triangles=corners[len(facets) :],
        light_facets=tuple(map(make_facet, light_corners)) if few_lights else (),
        smooth_corners=_joined(smooth, 3, 3),
        smooth_normals=np.concatenate([NO_TRIANGLES, *(part.normals for part in smooth)]),
        light_corners=light_corners,
        spheres=np.concatenate([_joined(spheres, 4), lit_spheres.primitives]),
        sphere_lights=len(lit_spheres.primitives),
        reflectance=_rows([*flat, *smooth, *spheres], _reflectance, 4),
        radiance=np.concatenate([lit_spheres.radiance, lit_triangles.radiance]),
        shape=np.concatenate(
            [_numbers([*flat, *smooth, *spheres]), lit_spheres.shape, lit_triangles.shape]
        ),
        overlaps=overlaps,
        is_cut=any(part.is_cut for part in parts),
    )


class _Lights(NamedTuple):
    """Primitives of one kind that emit, their radiance (n, 3), and the numbers of their shapes."""

    primitives: Array
    radiance: Array
    shape: NDArray[np.intp]


def _unrolled(flat: list[Part], smooth: list[Part]) -> tuple[list[Part], tuple[Facet, ...]]:
    """The flat parts, coplanar triangles merged, and all facets, if those are few enough."""
    if sum(len(part.primitives) for part in (*flat, *smooth)) > MERGE_LIMIT:
        return flat, ()
    merged = [part._replace(primitives=merge_coplanar(part.primitives)) for part in flat]
    polygons = [polygon for part in (*merged, *smooth) for polygon in part.primitives]
    if len(polygons) > FACET_LIMIT:
        return flat, ()
    return merged, tuple(map(make_facet, polygons))


def _lights(parts: list[Part], *shape: int) -> _Lights:
    """Primitives (n, *shape) that emit; coincident ones are one, with the sum of their radiance."""
    primitives = _joined(parts, *shape)
    radiance = _rows(parts, lambda shape: shape.radiance or (), 3)
    first, owner = _coincident(primitives.reshape(-1, *(shape if len(shape) > 1 else (1, *shape))))
    total = np.zeros((len(first), 3))
    np.add.at(total, owner, radiance)
    order = np.argsort(first)
    kept = first[order]
    return _Lights(primitives[kept], total[order], _numbers(parts)[kept])


def _coincident(corners: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First of each group of polygons (n, corners, 3) that are the same from some corner on.

    Returns its number, and the group of each polygon.
    """
    count = corners.shape[1]
    _, points = np.unique(corners.reshape(-1, corners.shape[2]), axis=0, return_inverse=True)
    points = points.reshape(-1, count)
    turns = (points.argmin(axis=1)[:, None] + np.arange(count)) % count
    turned = np.take_along_axis(points, turns, axis=1)
    _, first, group = np.unique(turned, axis=0, return_index=True, return_inverse=True)
    return first, group.reshape(-1)


def _reflectance(shape: Shape) -> tuple[float, ...]:
    """Row (albedo, code); a shape that neither emits nor has a material is black."""
    material = shape.material or Diffuse(0)
    return (*material.albedo, material.code)


def _joined(parts: list[Part], *shape: int) -> Array:
    """Primitives of all parts, (n, *shape)."""
    return np.concatenate([np.empty((0, *shape)), *(part.primitives for part in parts)])


def _triangles(part: Part) -> Array:
    """A triangle in the plane of each polygon, (n, 3, 3)."""
    if isinstance(part.primitives, list):
        return np.array([outline[:3] for outline in part.primitives]).reshape(-1, 3, 3)
    return part.primitives


def _rows(parts: list[Part], row: Callable[[Shape], tuple[float, ...]], width: int) -> Array:
    """The row of each part's shape, once for each of its primitives, (n, width)."""
    rows = np.array([row(part.shape) for part in parts]).reshape(-1, width)
    return np.repeat(rows, [len(part.primitives) for part in parts], axis=0)


def _numbers(parts: list[Part]) -> NDArray[np.intp]:
    """The number of each part's shape, once for each of its primitives."""
    numbers = np.array([part.number for part in parts], np.intp)
    return np.repeat(numbers, [len(part.primitives) for part in parts])


def _area_vectors(part: Part) -> Array:
    """The area vector of the triangle in the plane of each polygon, (n, 3)."""
    if isinstance(part.primitives, list):
        return area_vectors(_triangles(part))
    return part.area_vectors


def _planes(corners: Array, vectors: Array) -> Array:
    """Row (normal, offset) of the plane of each triangle (n, 3, 3), by its area vector (n, 3)."""
    normals = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.column_stack([normals, np.einsum("ij,ij->i", normals, corners[:, 0])])
