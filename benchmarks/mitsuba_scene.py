"""Diffuse drpt scenes in Mitsuba 3, for comparisons of speed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from drpt.scene import Diffuse, Mesh, Scene, Sphere

if TYPE_CHECKING:
    from drpt.scene import Camera, Shape


def make_scene(mi: Any, scene: Scene, bounces: int) -> Any:
    """Put a scene into Mitsuba, with the path integrator that computes what drpt does.

    ``mi`` is the module with its variant set. Raises `ValueError` for a material that Mitsuba
    lacks.
    """
    integrator = {"type": "path", "max_depth": bounces + 1, "rr_depth": bounces + 2}
    shapes = {f"shape{i}": _shape(mi, shape) for i, shape in enumerate(scene.shapes)}
    sensor = _sensor(mi, scene.camera)
    return mi.load_dict({"type": "scene", "integrator": integrator, "sensor": sensor, **shapes})


def _sensor(mi: Any, camera: Camera) -> dict[str, Any]:
    view = mi.ScalarTransform4f().look_at(origin=camera.eye, target=camera.target, up=camera.up)
    film = {
        "type": "hdrfilm",
        "width": camera.width,
        "height": camera.height,
        "rfilter": {"type": "box"},
        "component_format": "float32",
        "pixel_format": "rgb",
    }
    return {
        "type": "perspective",
        "fov": camera.fov,
        "fov_axis": "y",
        "to_world": view,
        "film": film,
        "sampler": {"type": "independent"},
    }


def _shape(mi: Any, shape: Shape) -> Any:
    surface = {"emitter": _emitter(shape)} if shape.is_light else {"bsdf": _bsdf(shape)}
    if isinstance(shape, Sphere):
        return {"type": "sphere", "center": shape.center, "radius": shape.radius, **surface}
    return _mesh(mi, shape, surface)


def _mesh(mi: Any, mesh: Mesh, surface: dict[str, Any]) -> Any:
    properties = mi.Properties()
    for name, plugin in surface.items():
        properties[name] = mi.load_dict(plugin)
    copy = mi.Mesh("mesh", len(mesh.vertices), len(mesh.faces), props=properties)
    buffers = mi.traverse(copy)
    buffers["vertex_positions"] = mesh.vertices.astype(np.float32).ravel()
    buffers["faces"] = mesh.faces.astype(np.uint32).ravel()
    buffers.update()
    return copy


def _emitter(shape: Shape) -> dict[str, Any]:
    return {"type": "area", "radiance": {"type": "rgb", "value": shape.radiance}}


def _bsdf(shape: Shape) -> dict[str, Any]:
    if not isinstance(shape.material, Diffuse):
        raise ValueError(f"Mitsuba has no {shape.material}")
    reflectance = {"type": "rgb", "value": shape.material.albedo}
    return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": reflectance}}
