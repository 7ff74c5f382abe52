"""A scene on the device: three tables, of what rays meet, how it reflects, and what emits."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import drjit as dr
import numpy as np

from drpt.kernel.bsdfs import LOBES, Materials
from drpt.kernel.emitters import (
    Emitters,
    LightRow,
    LightRows,
    LightTree,
    SphereLights,
    TriangleLights,
    light_row,
)
from drpt.kernel.meet import Ball
from drpt.kernel.mesh import TriangleMesh
from drpt.kernel.primitives import LUMINANCE
from drpt.kernel.scene_geometry import SceneGeometry
from drpt.kernel.solids import edge_owners
from drpt.kernel.sphere_grid import SphereGrid
from drpt.kernel.sphere_tree import SphereTree
from drpt.scene.materials import MATERIALS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from types import ModuleType

    from numpy.typing import NDArray

    from drpt.kernel.facets import Facet
    from drpt.kernel.primitives import Primitives
    from drpt.kernel.scene_geometry import ManySpheres
    from drpt.kernel.solids import Solid

    Upload = Callable[[NDArray[Any]], Any]

LARGE = 1 / 16
"""A sphere is large if the origin is no farther from its surface, relative to its radius."""


@dataclass
class DeviceScene:
    """The three tables of a scene."""

    types: ModuleType
    geometry: SceneGeometry
    materials: Materials
    emitters: Emitters

    def seen_from(self, eye: NDArray[np.float64], primitives: Primitives) -> DeviceScene:
        """The same scene, prepared for rays that start at its primitives or at an eye (3,)."""
        return replace(self, geometry=self.geometry.seen_from(eye, primitives))


def upload(primitives: Primitives, types: ModuleType) -> DeviceScene:
    """Put the primitives on the device, as arrays of the backend ``types``."""
    array = partial(to_device, types=types)
    return DeviceScene(
        types=types,
        geometry=_geometry(primitives, types, array),
        materials=_materials(primitives),
        emitters=_emitters(primitives, types, array),
    )


def _geometry(primitives: Primitives, types: ModuleType, array: Upload) -> SceneGeometry:
    first, lights = primitives.first_sphere, len(primitives.radiance)
    planes, lit_planes = primitives.planes[:first], primitives.planes[first:]
    shapes = np.concatenate([planes, primitives.spheres, lit_planes])
    materials = np.concatenate([primitives.reflectance, np.zeros((lights, 4))])
    solids = primitives.solids
    loose = tuple(_loose(primitives, solids))
    reach = _reach(primitives, [number for number, *_ in loose])
    in_light_mesh = primitives.light_corners[len(primitives.light_facets) :]
    smooth = np.concatenate([primitives.smooth_corners, primitives.smooth_normals], axis=1)
    return SceneGeometry(
        types=types,
        first_smooth=primitives.first_smooth,
        first_sphere=first,
        first_light=primitives.first_light,
        first_light_triangle=primitives.first_light + primitives.sphere_lights,
        sphere_count=len(primitives.spheres),
        solids=solids,
        loose_facets=loose,
        mesh=TriangleMesh(primitives.triangles, types) if len(primitives.triangles) else None,
        reach=array(reach) if reach.any() else None,
        light_facets=primitives.light_facets,
        light_mesh=TriangleMesh(in_light_mesh, types) if len(in_light_mesh) else None,
        balls=tuple(
            (first + i, _ball(primitives.spheres[i], types))
            for i in primitives.sphere_layout.single.tolist()
        ),
        many_spheres=_many_spheres(primitives, types, array),
        surfaces=array(np.column_stack([shapes, materials])),
        smooth=array(smooth),
    )


def _materials(primitives: Primitives) -> Materials:
    """The kinds of a scene; where nothing reflects, one kind, which is black."""
    kinds = primitives.kinds or MATERIALS[:1]
    return Materials(tuple(lobe for lobe in LOBES if lobe.material in kinds))


def _emitters(primitives: Primitives, types: ModuleType, array: Upload) -> Emitters:
    spheres, triangles = primitives.sphere_lights, len(primitives.light_corners)
    first = primitives.first_sphere
    shapes = np.concatenate(
        [primitives.spheres[len(primitives.spheres) - spheres :], primitives.planes[first:]]
    )
    lights = np.column_stack([shapes, primitives.radiance, primitives.light_areas()])
    only = _uniform(lights[0], types) if len(lights) == 1 else None
    rows = LightRows(types, array(lights), only)
    kinds = (
        SphereLights(rows, spheres),
        TriangleLights(rows, spheres, triangles, array(primitives.light_corners)),
    )
    present = tuple(kind for kind in kinds if kind.count)
    return Emitters(rows, present, _light_tree(primitives, types, array))


def _many_spheres(primitives: Primitives, types: ModuleType, array: Upload) -> ManySpheres | None:
    _, many, cells = primitives.sphere_layout
    spheres, numbers = primitives.spheres[many], primitives.first_sphere + many
    if not len(many):
        return None
    if cells is None:
        return SphereTree(spheres, numbers, array)
    return SphereGrid(cells, spheres, numbers, types, array)


def _light_tree(primitives: Primitives, types: ModuleType, array: Upload) -> LightTree | None:
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
    return light_row([dr.opaque(types.Float32, float(value)) for value in row], types)


def _ball(row: NDArray[np.float64], types: ModuleType) -> Ball:
    x, y, z, radius = (dr.opaque(types.Float32, float(value)) for value in row)
    distance = np.linalg.norm(row[:3])
    large = abs(distance - row[3]) < LARGE * row[3]
    power = float((distance - row[3]) * (distance + row[3]))
    return Ball(types.Array3f(x, y, z), radius, dr.opaque(types.Float32, power) if large else None)
