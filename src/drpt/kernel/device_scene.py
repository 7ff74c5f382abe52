"""A scene on the device: geometry as constants of the kernel, all that radiates as arrays."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import drjit as dr
import numpy as np

from drpt.kernel.light_tree import LightTree
from drpt.kernel.meet import Ball
from drpt.kernel.mesh import TriangleMesh
from drpt.kernel.primitives import LUMINANCE
from drpt.kernel.solids import edge_owners
from drpt.kernel.sphere_grid import SphereGrid
from drpt.kernel.sphere_tree import SphereTree
from drpt.kernel.vec import gather_row

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from types import ModuleType

    from drjit.auto import Array3f, Array4f, Float, UInt32
    from numpy.typing import NDArray

    from drpt.kernel.facets import Facet
    from drpt.kernel.intersect import ManySpheres
    from drpt.kernel.primitives import Primitives
    from drpt.kernel.solids import Solid

AFAR = 2.0**16
"""Distance, in radii, from which a sphere counts as far away.

There a distance is rounded by 1/256 of the radius.
"""
LARGE = 1 / 16
"""A sphere is large if the origin is no farther from its surface, relative to its radius."""
NEAR = 16
"""Largest distance of a ray's origin, in radii, for which a sphere is treated as large.

The power of the origin is rounded by 2⁻²⁴ of its squared distance.
"""


class SurfaceRow(NamedTuple):
    """Geometry of a primitive, (normal, offset) or (centre, radius), and how it reflects.

    Lights are black.
    """

    geometry: Array4f
    albedo: Array3f
    exponent: Float


class LightRow(NamedTuple):
    """The same geometry of a light, its radiance and area."""

    geometry: Array4f
    radiance: Array3f
    area: Float


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
    balls
        Of the spheres that are met one by one: number, and what is the same for all lanes.
    many_spheres
        The others.
    surfaces
        Rows of 8 by primitive, see `SurfaceRow`.
    smooth
        18 by smooth triangle: its corners, then the normals there.
    lights
        Rows of 8 by light, see `LightRow`.
    only_light
        The row of a light that is the only one: the same for all lanes, which need not gather it.
    light_tree
        Which light is chosen, where there are several.
    light_corners
        Rows of 9 by emitting triangle.
    afar
        Whether rays may start far away from spheres, see `AFAR`.
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
    balls: tuple[tuple[int, Ball], ...]
    many_spheres: ManySpheres | None
    surfaces: Float
    smooth: Float
    lights: Float
    only_light: LightRow | None
    light_tree: LightTree | None
    light_corners: Float
    light_count: int
    sphere_lights: int
    afar: bool = False

    def seen_from(self, eye: NDArray[np.float64], primitives: Primitives) -> DeviceScene:
        """The same scene, prepared for rays that start at its primitives or at an eye (3,)."""
        if not len(primitives.spheres):
            return self
        extent, radii = primitives.extent(eye), primitives.spheres[:, 3]
        afar = bool(extent > AFAR * radii.min())
        many = copy(self.many_spheres)
        if many is not None:
            many.afar = afar

        def seen(number: int, ball: Ball) -> tuple[int, Ball]:
            near = extent <= NEAR * radii[number - self.first_sphere]
            return number, replace(ball, power=ball.power if near else None, afar=afar)

        balls = tuple(seen(number, ball) for number, ball in self.balls)
        return replace(self, balls=balls, many_spheres=many, afar=afar)

    def surface_row(self, primitive: UInt32, active: Any = True) -> SurfaceRow:
        """The row of a primitive; zeros for lanes that are not active."""
        return SurfaceRow(*_row(gather_row(self.surfaces, primitive, 8, active), self.types))

    def light_row(self, light: UInt32) -> LightRow:
        """The row of a light."""
        if self.only_light:
            return self.only_light
        return LightRow(*_row(gather_row(self.lights, light, 8), self.types))


def _row(numbers: Sequence[Float], types: ModuleType) -> tuple[Array4f, Array3f, Float]:
    return types.Array4f(*numbers[:4]), types.Array3f(*numbers[4:7]), numbers[7]


def upload(primitives: Primitives, types: ModuleType) -> DeviceScene:
    """Put the primitives on the device, as arrays of the backend ``types``."""
    array = partial(to_device, types=types)
    triangles = primitives.triangles
    in_light_mesh = primitives.light_corners[len(primitives.light_facets) :]
    first = primitives.first_sphere
    planes, lit_planes = primitives.planes[:first], primitives.planes[first:]
    solids = primitives.solids
    loose = tuple(_loose(primitives, solids))
    reach = _reach(primitives, [number for number, *_ in loose])
    geometry = np.concatenate([planes, primitives.spheres, lit_planes])
    black = np.zeros((len(primitives.radiance), 4))
    surfaces = np.column_stack([geometry, np.concatenate([primitives.reflectance, black])])
    lights = np.column_stack(
        [geometry[len(geometry) - len(black) :], primitives.radiance, primitives.light_areas()]
    )
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
        balls=tuple(
            (first + i, _ball(primitives.spheres[i], types))
            for i in primitives.sphere_layout.single.tolist()
        ),
        many_spheres=_many_spheres(primitives, types, array),
        surfaces=array(surfaces),
        smooth=array(
            np.concatenate([primitives.smooth_corners, primitives.smooth_normals], axis=1)
        ),
        lights=array(lights),
        only_light=_uniform(lights[0], types) if len(lights) == 1 else None,
        light_tree=_light_tree(primitives, types, array),
        light_corners=array(primitives.light_corners),
        light_count=len(primitives.radiance),
        sphere_lights=primitives.sphere_lights,
    )


def _many_spheres(
    primitives: Primitives, types: ModuleType, array: Callable[[NDArray[Any]], Any]
) -> ManySpheres | None:
    _, many, cells = primitives.sphere_layout
    spheres, numbers = primitives.spheres[many], primitives.first_sphere + many
    if not len(many):
        return None
    if cells is None:
        return SphereTree(spheres, numbers, array)
    return SphereGrid(cells, spheres, numbers, types, array)


def _light_tree(
    primitives: Primitives, types: ModuleType, array: Callable[[NDArray[np.float64]], Float]
) -> LightTree | None:
    if len(primitives.radiance) < 2:
        return None
    power = primitives.light_areas() * (primitives.radiance @ LUMINANCE)
    power[: primitives.sphere_lights] /= 4  # of a sphere's area, so much faces a receiver
    return LightTree(primitives.light_balls(), power, types, array)


def _loose(primitives: Primitives, solids: tuple[Solid, ...]) -> Iterator[tuple[int, Facet, bool]]:
    taken = {number for solid in solids for number in solid.facets}
    for number, (facet, blocks) in enumerate(
        zip(primitives.facets, primitives.blockers(), strict=True)
    ):
        if number not in taken:
            yield number, facet, blocks


def _reach(primitives: Primitives, loose: list[int]) -> NDArray[np.float64]:
    """Largest coordinates of triangles whose seams are wider than the rounding of a point on them.

    If triangles are cut, their pieces have seams without sharing whole edges.
    """
    reach = np.zeros(len(primitives.facets))
    for numbers in edge_owners([primitives.facets[i].corners for i in loose]).values():
        if len(numbers) > 1 or primitives.is_cut:
            for i in (loose[number] for number in numbers):
                reach[i] = np.abs(primitives.facets[i].corners).max()
    return np.concatenate([reach, np.abs(primitives.triangles).max(axis=(1, 2), initial=0)])


def to_device(values: NDArray[Any], types: ModuleType) -> Any:
    """Numbers on the device, one row after the other, in memory of Dr.Jit's own.

    They are of 32 bits there: unsigned if they are so on the host, else floating-point. Rows are
    gathered in one piece from aligned memory only, and element by element from other: where NumPy's
    memory happens to lie would decide which kernel is compiled.
    """
    words = values.dtype == np.uint32
    kind = types.UInt32 if words else types.Float32
    mapped = kind((values if words else values.astype(np.float32)).ravel())
    if not len(mapped):
        return mapped
    copy = mapped * dr.opaque(kind, 1)
    dr.eval(copy)
    return copy


def _uniform(row: NDArray[np.float64], types: ModuleType) -> LightRow:
    """A row of numbers that are inputs of the kernel, the same for all lanes."""
    return LightRow(*_row([dr.opaque(types.Float32, float(value)) for value in row], types))


def _ball(row: NDArray[np.float64], types: ModuleType) -> Ball:
    x, y, z, radius = (dr.opaque(types.Float32, float(value)) for value in row)
    distance = np.linalg.norm(row[:3])
    large = abs(distance - row[3]) < LARGE * row[3]
    power = float((distance - row[3]) * (distance + row[3]))
    return Ball(types.Array3f(x, y, z), radius, dr.opaque(types.Float32, power) if large else None)
