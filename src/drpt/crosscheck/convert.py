"""drpt's scenes in Mitsuba."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from drpt.crosscheck.phong import NAME as PHONG
from drpt.crosscheck.variant import load_mitsuba
from drpt.scene import Mesh, Phong, Sphere

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

    Raises
    ------
    ValueError
        The variant that is set does not compute in RGB.
    drpt.kernel.backend.BackendError
        No usable libLLVM was found.
    """
    return load_mitsuba().load_dict(to_mitsuba_dict(scene, bounces))


def to_mitsuba_dict(scene: Scene, bounces: int = 3) -> dict[str, Any]:
    """Return the dict that Mitsuba loads the scene from; meshes are in it as Mitsuba's objects.

    See :func:`to_mitsuba`. Phong surfaces are of the type ``drpt_phong``, which is registered in
    the variant that is set.
    """
    mi = load_mitsuba()
    return {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": bounces + 1, "rr_depth": bounces + 2},
        "sensor": _sensor(mi, scene),
        **{f"shape{i}": _shape(mi, shape) for i, shape in enumerate(scene.shapes)},
    }


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
    eye, target, up = map(np.array, (camera.eye, camera.target, camera.up))
    forward = (target - eye) / np.linalg.norm(target - eye)
    left = np.cross(up, forward)
    left /= np.linalg.norm(left)
    return np.vstack([np.column_stack([left, np.cross(forward, left), forward, eye]), [0, 0, 0, 1]])


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
    return _mesh(mi, shape)


def surface(shape: Shape) -> dict[str, Any]:
    """Return what a shape reflects and emits, as the children of Mitsuba's shape."""
    bsdf = {"bsdf": _bsdf(shape.material)}
    if not shape.is_light:
        return bsdf
    return {**bsdf, "emitter": {"type": "area", "radiance": _rgb(shape.radiance)}}


def _mesh(mi: Any, mesh: Mesh) -> Any:
    """Return a mesh of Mitsuba's; a light emits by its geometry's side, not by its normals'."""
    properties = mi.Properties()
    for name, plugin in surface(mesh).items():
        properties[name] = mi.load_dict(plugin)
    normals = None if mesh.is_light else mesh.normals
    properties["face_normals"] = normals is None
    sizes = len(mesh.vertices), len(mesh.faces)
    copy = mi.Mesh("mesh", *sizes, props=properties, has_vertex_normals=normals is not None)
    buffers = mi.traverse(copy)
    buffers["vertex_positions"] = mesh.vertices.astype(np.float32).ravel()
    buffers["faces"] = mesh.faces.astype(np.uint32).ravel()
    buffers.update()
    if normals is not None:  # after the update above, which makes normals of its own
        buffers["vertex_normals"] = normals.astype(np.float32).ravel()
        buffers.update()
    return copy


def _bsdf(material: Material | None) -> dict[str, Any]:
    """Return a surface that reflects on both sides; black where there is no material."""
    if material is None:
        return {"type": "diffuse", "reflectance": _rgb((0.0, 0.0, 0.0))}
    lobe: dict[str, Any] = {"type": "diffuse"}
    if isinstance(material, Phong):
        lobe = {"type": PHONG, "exponent": material.exponent}
    return {"type": "twosided", "bsdf": {**lobe, "reflectance": _rgb(material.albedo)}}


def _rgb(colour: Any) -> dict[str, Any]:
    return {"type": "rgb", "value": colour}
