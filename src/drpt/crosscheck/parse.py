"""Mitsuba's scenes in drpt."""

from __future__ import annotations

import warnings
from collections import defaultdict
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from drpt.crosscheck.elements import Element, parsed
from drpt.crosscheck.geometry import SQUARE, disk, mesh_arrays, polygon, uniform_scale
from drpt.crosscheck.mesh_checks import checked_mesh
from drpt.crosscheck.sensors import camera
from drpt.crosscheck.surfaces import Surface, object_surface, surface
from drpt.crosscheck.variant import load_mitsuba
from drpt.crosscheck.xml_checks import check_file
from drpt.scene import Mesh, Scene, SceneError, Sphere

if TYPE_CHECKING:
    from collections.abc import Iterator
    from os import PathLike

    from drpt.scene import Shape
    from drpt.scene.meshes import MeshArrays

UNSEEN = ("bsdf", "film", "integrator", "reconstructionfilter", "sampler", "sensor", "texture")
"""Elements of a scene that show nothing by themselves."""
COMMON = ("to_world", "flip_normals", "silhouette_sampling_weight")
FILE = (*COMMON, "filename", "face_normals", "flip_tex_coords")
PROPERTIES = {
    "sphere": (*COMMON, "center", "radius"),
    "rectangle": (*COMMON, "face_normals"),
    "disk": COMMON,
    "cube": (*COMMON, "face_normals"),
    "obj": FILE,
    "ply": FILE,
}
"""The shapes that drpt takes, and their properties."""
MAX_NAMED = 8
"""Shapes that a warning names."""


class _Loaded(NamedTuple):
    """A shape, its surface in Mitsuba, and its element or its name."""

    shape: Shape
    surface: Surface
    origin: Element | str

    @property
    def name(self) -> str:
        """Its name in messages; finding an element's line takes a search of the file."""
        return self.origin if isinstance(self.origin, str) else self.origin.name

    def differences(self) -> Iterator[str]:
        """Yield what is not the same in drpt."""
        if self.surface.is_light:
            if any(self.surface.reflects.albedo):
                yield "it emits and reflects in Mitsuba, but only emits in drpt"
            if isinstance(self.shape, Mesh) and self.shape.normals is not None:
                yield "it emits by its normals in Mitsuba, but by its triangles' sides in drpt"
        elif not self.surface.two_sided and not self.surface.is_black:
            yield "it is black from behind in Mitsuba, but not in drpt"


def from_mitsuba(source: str | PathLike[str] | dict[str, Any]) -> Scene:
    """Load a scene of Mitsuba 3, in the variant that is set or else in ``llvm_ad_rgb``.

    What drpt has can be loaded: the shapes ``sphere``, ``cube``, ``rectangle``, ``disk`` (a regular
    polygon of 128 corners with the disk's area), ``obj`` and ``ply``; in dicts also the meshes that
    :func:`drpt.crosscheck.to_mitsuba_dict` makes; the surfaces ``diffuse``, ``drpt_phong`` and
    ``twosided``; ``area`` emitters; ``perspective`` sensors, of which the first counts. Colours are
    ``rgb``, numbers, or spectra as Mitsuba converts them to RGB.

    Left out is what belongs to rendering: integrator, sampler, reconstruction filter (drpt's is a
    box) and clip planes.

    Files are checked before Mitsuba reads them. Polygons of OBJ files for which a fan is wrong are
    cut into other triangles than Mitsuba's. Elements may be nested 100 deep, and up to 1000 files
    may be included.

    Parameters
    ----------
    source
        The path of an XML file, or a dict as ``mitsuba.load_dict`` takes it.

    Warns
    -----
    UserWarning
        The pictures may differ, for these reasons; the warning names the shapes. Without
        ``twosided``, a surface is black from behind in Mitsuba, and reflects on both sides in drpt.
        A light that reflects in Mitsuba is black in drpt. A light with interpolated normals emits
        by these in Mitsuba, and by its triangles' sides in drpt. A polygon of an OBJ file
        intersects itself, or is far from planar.

    Raises
    ------
    drpt.SceneError
        It cannot be parsed, or drpt has nothing like an element. The error names it and its place:
        ``scene.xml:12`` in a file, ``wall.bsdf`` in a dict.
    ValueError
        The variant that is set does not compute in RGB.
    drpt.kernel.backend.BackendError
        No usable libLLVM was found.
    """
    with parsed(load_mitsuba(), source) as scene:
        loaded = _shapes(scene)
        sensor = scene.first("sensor")
        if sensor is None:
            raise scene.refuse("it has no sensor")
        with scene.blamed():
            result = Scene(camera(sensor), [item.shape for item in loaded])
    _warn(loaded)
    return result


def _shapes(scene: Element) -> list[_Loaded]:
    loaded = []
    for name, child in scene.children.items():
        if not isinstance(child, Element):
            loaded.append(_object(scene, name, child))
        elif child.kind not in UNSEEN:
            loaded.append(_shape(child))
    return loaded


def _warn(loaded: list[_Loaded]) -> None:
    different = defaultdict(list)
    for item in loaded:
        for difference in item.differences():
            different[difference].append(item)
    for difference, items in different.items():
        names = [item.name for item in items[:MAX_NAMED]]
        if len(items) > MAX_NAMED:
            names.append(f"and {len(items) - MAX_NAMED} more shapes")
        warnings.warn(f"{', '.join(names)}: {difference}", stacklevel=3)


def _object(scene: Element, name: str, mesh: Any) -> _Loaded:
    if not isinstance(mesh, scene.mi.Mesh):
        raise scene.refuse(f"{name!r} is an object of Mitsuba's; it must be a dict or a Mesh")
    try:
        shown = object_surface(scene.mi, mesh)
        return _Loaded(Mesh(*mesh_arrays(scene.mi, mesh), **shown.parameters()), shown, name)
    except SceneError as error:
        raise error.in_file(name) from None


def _shape(element: Element) -> _Loaded:
    if element.kind != "shape" or element.type not in PROPERTIES:
        known = ", ".join(PROPERTIES)
        raise element.refuse(f"drpt has nothing like it; a scene's shapes must be {known}")
    element.allow(*PROPERTIES[element.type])
    shown = surface(element)
    with element.blamed():
        if not np.linalg.det(element.matrix()[:3, :3]):
            raise SceneError("its to_world flattens it")
        if element.type == "sphere":
            return _Loaded(_sphere(element, shown), shown, element)
        return _Loaded(Mesh(*_mesh(element), **shown.parameters()), shown, element)


def _mesh(element: Element) -> MeshArrays:
    """Return a mesh in the world, as Mitsuba makes it; what it does not show is made here."""
    corners = {"rectangle": SQUARE, "disk": disk()}.get(element.type)
    if corners is not None:
        return polygon(corners, element.matrix(), element.flag("flip_normals"))
    mi = element.mi
    properties = mi.Properties(element.type)
    for name in PROPERTIES[element.type]:
        if (value := element.get(name, None)) is not None:
            properties[name] = value
    create = mi.PluginManager.instance().create_object
    if element.type not in ("obj", "ply"):
        return mesh_arrays(mi, create(properties))
    path = check_file(mi.file_resolver(), element.text("filename", ""))
    with checked_mesh(element.type, path, flat=element.flag("face_normals")) as file:
        properties["filename"] = str(file)
        return mesh_arrays(mi, create(properties))


def _sphere(element: Element, shown: Surface) -> Sphere:
    to_world = element.matrix()
    scale = uniform_scale(to_world[:3, :3])
    if scale is None:
        raise SceneError("its to_world makes it an ellipsoid; it must scale all directions alike")
    inward = element.flag("flip_normals") != (np.linalg.det(to_world[:3, :3]) < 0)
    if inward and shown.is_light:
        raise SceneError("it emits inward; a sphere of drpt's emits outward")
    center = to_world @ [*element.point("center"), 1]
    return Sphere(center[:3], scale * element.number("radius", 1.0), **shown.parameters())
