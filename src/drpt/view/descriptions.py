"""What a browser is told about scenes, for its controls."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from drpt.distribution import VERSION
from drpt.render import SAMPLERS, Mode
from drpt.scene import Mesh
from drpt.view.state import State

if TYPE_CHECKING:
    from drpt.scene import Shape
    from drpt.view.scenes import Scenes
    from drpt.view.show import Show


def hello(scenes: Scenes) -> dict[str, Any]:
    """Return the first message: what there is to choose from, and what is shown by default."""
    return {
        "type": "hello",
        "version": VERSION,
        "scenes": scenes.names,
        "modes": list(Mode),
        "samplers": list(SAMPLERS),
        "state": State(scenes.default).json,
    }


def describe_scene(show: Show, before: Show | None) -> dict[str, Any]:
    """Return the message about a scene as it is shown; without shapes if they are as before."""
    camera, shapes = asdict(show.scene.camera), {}
    if before is None or not show.has_the_shapes_of(before):
        shapes = {"shapes": [_shape(*numbered) for numbered in enumerate(show.scene.shapes)]}
    return {
        "type": "scene",
        "number": show.number,
        "scene": show.state.scene,
        "description": show.scene.description,
        "width": camera.pop("width"),
        "height": camera.pop("height"),
        "camera": camera,
        **shapes,
    }


def _shape(number: int, shape: Shape) -> dict[str, Any]:
    material = shape.material
    return {
        "index": number,
        "kind": "mesh" if isinstance(shape, Mesh) else "sphere",
        "light": shape.is_light,
        "material": None if material is None else type(material).__name__.lower(),
        "albedo": None if material is None else material.albedo,
        "exponent": getattr(material, "exponent", None),
        "radiance": shape.radiance,
        "center": getattr(shape, "center", None),
        "radius": getattr(shape, "radius", None),
        "faces": len(shape.faces) if isinstance(shape, Mesh) else None,
    }
