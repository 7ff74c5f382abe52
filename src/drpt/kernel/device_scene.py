"""A scene on the device: geometry as constants of the kernel, all that radiates as arrays."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import drjit as dr
import numpy as np

from drpt.kernel.light_tree import LightTree
from drpt.kernel.mesh import TriangleMesh
from drpt.kernel.primitives import LUMINANCE, SPHERE_LIMIT
from drpt.kernel.solids import edge_owners
from drpt.kernel.sphere_tree import SphereTree

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from types import ModuleType

    from drjit.auto import Array3f, Array4f, Float, UInt32
    from numpy.typing import NDArray

    from drpt.kernel.facets import Facet
    from drpt.kernel.primitives import Primitives
    from drpt.kernel.solids import Solid

LARGE = 1 / 16
"""A sphere is large if the origin is no farther from its surface, relative to its radius."""


@dataclass
class Ball:
    """A sphere whose centre and radius are inputs of the kernel, the same for all lanes.

    One that is large against its distance from the origin, such as the ground, also has the
    ``power`` of the origin, |c|² − r²: there the difference would lose all of its digits.
    """

    center: Array3f
    radius: Float
    power: Float | None = None


@dataclass
class DeviceScene:
    """Primitives as kernels see them; the numbers of primitives are those of `Primitives`.

    Attributes
    ----------
    solids
        Convex bodies of the facets that reflect.
    loose_facets
        Of the other facets: number, constants, and whether it can cast a shadow.
    mesh
        The triangles that reflect, where they are too many for facets.
    reach
        Largest coordinate of each facet that shares an edge, and of each triangle of a mesh;
        0 for other facets, None without such.
    light_facets, light_mesh
        The triangles that emit, as facets where they are few, else as a mesh.
    balls, sphere_tree
        Each sphere, where they are few; else all of them.
    geometry
        Rows of 4 by primitive: (normal, offset) or (centre, radius).
    reflectance
        Rows of 4 by primitive: (albedo, exponent).
    smooth
        18 by smooth triangle: its corners, then the normals there.
    lights
        Rows of 4 by light: (radiance, area).
    only_light
        The rows of a light that is the only one in ``geometry`` and ``lights``: the same for all
        lanes, which need not gather them.
    light_tree
        Which light is chosen, where there are several.
    light_corners
        Rows of 9 by emitting triangle.
    """

    types: ModuleType
    first_smooth: int
    first_sphere: int
    first_light: int
    sphere_count: int
    solids: tuple[Solid, ...]
    loose_facets: tuple[tuple[int, Facet, bool], ...]
    mesh: TriangleMesh | None
    reach: Float | None
    light_facets: tuple[Facet, ...]
    light_mesh: TriangleMesh | None
    balls: tuple[Ball, ...]
    sphere_tree: SphereTree | None
    geometry: Float
    reflectance: Float
    smooth: Float
    lights: Float
    only_light: tuple[Array4f, Array4f] | None
    light_tree: LightTree | None
    light_corners: Float
    light_count: int
    sphere_lights: int

    def geometry_row(self, primitive: UInt32, active: Any = True) -> Array4f:
        """Normal and offset, or centre and radius."""
        return dr.gather(self.types.Array4f, self.geometry, primitive, active)

    def light_geometry_row(self, light: UInt32) -> Array4f:
        """The same of a light."""
        if self.only_light:
            return self.only_light[0]
        return self.geometry_row(self.first_light + light)

    def light_row(self, light: UInt32) -> Array4f:
        """Radiance and area of a light."""
        if self.only_light:
            return self.only_light[1]
        return dr.gather(self.types.Array4f, self.lights, light)


def upload(primitives: Primitives, types: ModuleType) -> DeviceScene:
    """Put the primitives on the device, as arrays of the backend ``types``."""
    array = partial(to_device, types=types)
    triangles = primitives.triangles
    in_light_mesh = primitives.light_corners[len(primitives.light_facets) :]
    few_spheres = len(primitives.spheres) <= SPHERE_LIMIT
    first = primitives.first_sphere
    planes, lit_planes = primitives.planes[:first], primitives.planes[first:]
    solids = primitives.solids
    loose = tuple(_loose(primitives, solids))
    reach = _reach(primitives, [number for number, *_ in loose])
    geometry = np.concatenate([planes, primitives.spheres, lit_planes])
    lights = np.column_stack([primitives.radiance, primitives.light_areas()])
    return DeviceScene(
        types=types,
        first_smooth=primitives.first_smooth,
        first_sphere=first,
        first_light=primitives.first_light,
        sphere_count=len(primitives.spheres),
        solids=solids,
        loose_facets=loose,
        mesh=TriangleMesh(triangles, types) if len(triangles) else None,
        reach=array(reach) if reach.any() else None,
        light_facets=primitives.light_facets,
        light_mesh=TriangleMesh(in_light_mesh, types) if len(in_light_mesh) else None,
        balls=tuple(_ball(row, types) for row in primitives.spheres) if few_spheres else (),
        sphere_tree=None if few_spheres else SphereTree(primitives.spheres, first, types, array),
        geometry=array(geometry),
        reflectance=array(primitives.reflectance),
        smooth=array(
            np.concatenate([primitives.smooth_corners, primitives.smooth_normals], axis=1)
        ),
        lights=array(lights),
        only_light=(_uniform(geometry[-1], types), _uniform(lights[0], types))
        if len(lights) == 1
        else None,
        light_tree=_light_tree(primitives, types, array),
        light_corners=array(primitives.light_corners),
        light_count=len(primitives.radiance),
        sphere_lights=primitives.sphere_lights,
    )


def _light_tree(
    primitives: Primitives, types: ModuleType, upload: Callable[[NDArray[np.float64]], Float]
) -> LightTree | None:
    if len(primitives.radiance) < 2:
        return None
    power = primitives.light_areas() * (primitives.radiance @ LUMINANCE)
    power[: primitives.sphere_lights] /= 4  # of a sphere's area, so much faces a receiver
    return LightTree(primitives.light_balls(), power, types, upload)


def _loose(primitives: Primitives, solids: tuple[Solid, ...]) -> Iterator[tuple[int, Facet, bool]]:
    taken = {number for solid in solids for number in solid.facets}
    for number, (facet, blocks) in enumerate(
        zip(primitives.facets, primitives.blockers(), strict=True)
    ):
        if number not in taken:
            yield number, facet, blocks


def _reach(primitives: Primitives, loose: list[int]) -> NDArray[np.float64]:
    """How far triangles reach whose seams are wider than the rounding of a point on them."""
    reach = np.zeros(len(primitives.facets))
    for numbers in edge_owners([primitives.facets[i].corners for i in loose]).values():
        if len(numbers) > 1:
            for i in (loose[number] for number in numbers):
                reach[i] = np.abs(primitives.facets[i].corners).max()
    return np.concatenate([reach, np.abs(primitives.triangles).max(axis=(1, 2), initial=0)])


def to_device(values: NDArray[np.float64], types: ModuleType) -> Float:
    """Numbers on the device, one row after the other, in memory of Dr.Jit's own.

    Rows are gathered in one piece from aligned memory only, and element by element from other:
    where NumPy's memory happens to lie would decide which kernel is compiled.
    """
    mapped = types.Float32(values.astype(np.float32).ravel())
    if not len(mapped):
        return mapped
    copy = mapped * dr.opaque(types.Float32, 1)
    dr.eval(copy)
    return copy


def _uniform(row: NDArray[np.float64], types: ModuleType) -> Array4f:
    """Four numbers that are inputs of the kernel, the same for all lanes."""
    return types.Array4f(*(dr.opaque(types.Float32, float(value)) for value in row))


def _ball(row: NDArray[np.float64], types: ModuleType) -> Ball:
    x, y, z, radius = (dr.opaque(types.Float32, float(value)) for value in row)
    distance = np.linalg.norm(row[:3])
    large = abs(distance - row[3]) < LARGE * row[3]
    power = float((distance - row[3]) * (distance + row[3]))
    return Ball(types.Array3f(x, y, z), radius, dr.opaque(types.Float32, power) if large else None)
