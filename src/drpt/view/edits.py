"""Scenes as a browser changes them: lights, surfaces, and the camera's place."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial.transform import Rotation

from drpt.scene import Camera, Diffuse, Phong, Scene, SceneError, Sphere
from drpt.scene.bounds import bounds
from drpt.scene.checks import refuse
from drpt.view.state import Orbit

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from drpt.scene import Shape
    from drpt.scene.checks import Point
    from drpt.scene.materials import Material

OF_SPHERES = ("center", "radius")
OF_SURFACES = ("albedo", "exponent")
NEAR = 1e-3
"""The camera goes around a point that is farther away than this, relative to what it looks at."""


def edited(scene: Scene, edits: Mapping[int, Mapping[str, Any]], orbit: Orbit) -> Scene:
    """Return a scene with some shapes changed, seen from where the camera has gone.

    An edit may have ``center`` and ``radius`` of a sphere, ``albedo`` and ``exponent`` of what
    reflects (None makes it diffuse). A light whose radius changes keeps its power. Raises
    `SceneError`, which names the field.
    """
    shapes = list(scene.shapes)
    for number, edit in edits.items():
        field = f"edits[{number}]"
        if number >= len(shapes):
            raise SceneError(f"there are {len(shapes)} shapes, counted from 0", field)
        try:
            shapes[number] = _changed(shapes[number], edit)
        except SceneError as error:
            raise error.within(field) from None
    try:
        camera = moved(scene, orbit)
    except SceneError as error:
        raise error.within("camera") from None
    return replace(scene, shapes=tuple(shapes), camera=camera)


def _changed(shape: Shape, edit: Mapping[str, Any]) -> Shape:
    allowed = OF_SPHERES * isinstance(shape, Sphere) + OF_SURFACES * (shape.material is not None)
    for name in edit:
        if name not in allowed:
            raise refuse("", name, f"one of {', '.join(allowed)}" if allowed else "left out")
    geometry = {name: edit[name] for name in OF_SPHERES if name in edit}
    changed = replace(shape, **geometry) if geometry else shape
    if isinstance(changed, Sphere) and isinstance(shape, Sphere) and shape.radiance is not None:
        radiance = np.multiply(shape.radiance, (shape.radius / changed.radius) ** 2)
        return Sphere(changed.center, changed.radius, radiance=radiance)
    if changed.material is not None and edit.keys() & set(OF_SURFACES):
        return replace(changed, material=_material(changed.material, edit))
    return changed


def _material(material: Material, edit: Mapping[str, Any]) -> Material:
    albedo = edit.get("albedo", material.albedo)
    if "exponent" not in edit:
        return replace(material, albedo=albedo)
    exponent = edit["exponent"]
    return Diffuse(albedo) if exponent is None else Phong(albedo, exponent)


def moved(scene: Scene, orbit: Orbit) -> Camera:
    """Return the camera after it has gone around what it looks at."""
    camera = scene.camera
    if orbit == Orbit():
        return camera
    eye, up = np.array(camera.eye), np.array(camera.up)
    up /= np.linalg.norm(up)
    right, _, forward = camera.axes()
    pivot = eye + forward * _depth(scene, forward)
    around = Rotation.from_rotvec(orbit.azimuth * up, degrees=True)
    over = Rotation.from_rotvec(-orbit.elevation * right, degrees=True)
    turn = around * over
    there = pivot + turn.apply(eye - pivot) * 2.0**-orbit.zoom
    return replace(camera, eye=_point(there), target=_point(pivot), up=_point(turn.apply(up)))


def _depth(scene: Scene, forward: NDArray[np.float64]) -> float:
    """How far ahead of the eye the middle of what stands around it is, if it is ahead.

    What holds the eye, such as a sky, is left out if there is anything else.
    """
    eye = scene.camera.eye
    outside = [
        shape
        for shape, (low, high) in ((shape, bounds([shape])) for shape in scene.shapes)
        if (eye < low).any() or (eye > high).any()
    ]
    low, high = bounds(outside or scene.shapes)
    depth = float(((low + high) / 2 - scene.camera.eye) @ forward)
    return max(depth, NEAR * float(np.linalg.norm(high - low)))


def _point(vector: NDArray[np.float64]) -> Point:
    x, y, z = vector.tolist()
    return x, y, z
