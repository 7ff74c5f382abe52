"""drpt's scenes in Mitsuba."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from drpt.crosscheck.bsdfs import bsdf_of
from drpt.crosscheck.spectra import rgb
from drpt.crosscheck.variant import load_mitsuba
from drpt.kernel.overlaps import resolve_overlaps
from drpt.kernel.parts import make_parts, origin_of
from drpt.scene import Sphere
from drpt.scene.meshes import MeshArrays

if TYPE_CHECKING:
    from drpt.scene import Camera, Material, Scene, Shape

NEAR = 1e-6
"""Near clipping distance of Mitsuba's camera, which must have one, as a share of the far one."""


def to_mitsuba(scene: Scene, bounces: int = 3) -> Any:
    """Load a scene into Mitsuba, in the variant that is set or else in ``llvm_ad_rgb``.

    Its path integrator computes what :func:`drpt.render` does, with these differences:

    - With interpolated normals, Mitsuba takes the side of a direction from the shading normal
      alone; drpt counts a direction only where the geometric normal agrees. So Mitsuba lets light
      from behind a surface leak through it, and shades what is seen against its shading normal,
      where drpt is black.
    - Mitsuba computes in float32 relative to the scene's own origin. Its camera sees nothing that
      is nearer than `NEAR` times twice the distance of the scene's farthest point.
    - Mitsuba 3.9.1 loses digits in the solid angle of small and far sphere lights: at a radius /
      distance of 0.03 it is off by 1e-4 at the most, at 0.001 by up to 10 %; below 1.7e-4 the light
      is black. `drpt.crosscheck.domain` has a bound.
    - Shapes that overlap in one plane are cut for Mitsuba as for drpt's kernels. Where a light lies
      in the plane of an earlier surface that reflects, nothing is cut, and rounding decides which
      of them Mitsuba shows.

    Raises
    ------
    ValueError
        The variant that is set does not compute in RGB.
    drpt.kernel.backend.BackendError
        No usable libLLVM was found.
    """
    mi = load_mitsuba()
    return mi.load_dict({**_settings(mi, scene, bounces), **_seen_shapes(mi, scene)})


def to_mitsuba_dict(scene: Scene, bounces: int = 3) -> dict[str, Any]:
    """Return the dict that Mitsuba loads the scene from; meshes are in it as Mitsuba's objects.

    See :func:`to_mitsuba`. Phong surfaces are of the type ``drpt_phong``, which is registered in
    the variant that is set. Shapes are not cut: where they overlap in one plane, rounding decides
    which of them Mitsuba shows.
    """
    mi = load_mitsuba()
    shapes = {f"shape{i}": _shape(mi, shape) for i, shape in enumerate(scene.shapes)}
    return {**_settings(mi, scene, bounces), **shapes}


def _settings(mi: Any, scene: Scene, bounces: int) -> dict[str, Any]:
    """Return all of a scene but its shapes."""
    return {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": bounces + 1, "rr_depth": bounces + 2},
        "sensor": _sensor(mi, scene),
    }


def _seen_shapes(mi: Any, scene: Scene) -> dict[str, Any]:
    """Return Mitsuba's shapes by name, cut where they overlap as for drpt's kernels."""
    origin = origin_of(scene.shapes)
    parts = resolve_overlaps(make_parts(scene.shapes, origin)).parts
    shapes = {}
    for part in parts:
        if not part.is_cut:
            shapes[f"shape{part.number}"] = _shape(mi, part.shape)
        elif len(part.primitives):
            vertices = part.triangles.reshape(-1, 3) + origin
            faces = np.arange(len(vertices)).reshape(-1, 3)
            normals = part.normals.reshape(-1, 3) if len(part.normals) else None
            arrays = MeshArrays(vertices, faces, normals)
            shapes[f"shape{part.number}"] = _mesh(mi, part.shape, arrays)
    return shapes


def _sensor(mi: Any, scene: Scene) -> dict[str, Any]:
    far = 2 * _reach(scene)
    return {
        "type": "perspective",
        "fov": scene.camera.fov,
        "fov_axis": "y",
        "to_world": mi.ScalarTransform4f(_camera_to_world(scene.camera)),
        "near_clip": NEAR * far,
        "far_clip": far,
        "film": {
            "type": "hdrfilm",
            "width": scene.camera.width,
            "height": scene.camera.height,
            "rfilter": {"type": "box"},
            "component_format": "float32",
            "pixel_format": "rgb",
        },
        "sampler": {"type": "independent"},
    }


def _camera_to_world(camera: Camera) -> Any:
    """Return the matrix (4, 4) of Mitsuba's camera, which looks along +z and has left as +x."""
    right, down, forward = camera.axes()
    return np.vstack([np.column_stack([-right, -down, forward, camera.eye]), [0, 0, 0, 1]])


def _reach(scene: Scene) -> float:
    """Return how far the camera's eye is from the farthest point of the scene."""
    eye = np.array(scene.camera.eye)
    return max(
        float(np.linalg.norm(shape.center - eye) + shape.radius)
        if isinstance(shape, Sphere)
        else float(np.linalg.norm(shape.vertices - eye, axis=1).max())
        for shape in scene.shapes
    )


def _shape(mi: Any, shape: Shape) -> Any:
    if isinstance(shape, Sphere):
        return {"type": "sphere", "center": shape.center, "radius": shape.radius, **surface(shape)}
    normals = None if shape.is_light else shape.normals
    return _mesh(mi, shape, MeshArrays(shape.vertices, shape.faces, normals))


def surface(shape: Shape) -> dict[str, Any]:
    """Return what a shape reflects and emits, as the children of Mitsuba's shape."""
    bsdf = {"bsdf": _bsdf(shape.material)}
    if not shape.is_light:
        return bsdf
    return {**bsdf, "emitter": {"type": "area", "radiance": rgb(shape.radiance)}}


def _mesh(mi: Any, shape: Shape, arrays: MeshArrays) -> Any:
    """Return a mesh of Mitsuba's; a light emits by its geometry's side, not by its normals'."""
    properties = mi.Properties()
    for name, plugin in surface(shape).items():
        properties[name] = mi.load_dict(plugin)
    vertices, faces, normals = arrays
    properties["face_normals"] = normals is None
    sizes = len(vertices), len(faces)
    copy = mi.Mesh("mesh", *sizes, props=properties, has_vertex_normals=normals is not None)
    buffers = mi.traverse(copy)
    buffers["vertex_positions"] = vertices.astype(np.float32).ravel()
    buffers["faces"] = faces.astype(np.uint32).ravel()
    buffers.update()
    if normals is not None:  # after the update above, which makes normals of its own
        buffers["vertex_normals"] = normals.astype(np.float32).ravel()
        buffers.update()
    return copy


def _bsdf(material: Material | None) -> dict[str, Any]:
    """Return a surface that reflects on both sides; black where there is no material."""
    if material is None:
        return {"type": "diffuse", "reflectance": rgb((0.0, 0.0, 0.0))}
    return bsdf_of(material)
