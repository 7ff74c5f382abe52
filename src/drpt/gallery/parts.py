"""Parts of the glossy box: which shape is which, and where a picture shows it."""

from __future__ import annotations

from dataclasses import replace
from enum import IntEnum
from typing import TYPE_CHECKING

from drpt.render import Rendering
from drpt.scene import Diffuse, Mesh, Scene, Sphere

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from drpt.scene import Material
    from drpt.scene.model import Shape

COVERAGE_SPP = 64


class Part(IntEnum):
    """Shapes of the Cornell boxes with glossy parts, by their place in the scene file."""

    LAMP = 0
    FLOOR = 1
    CEILING = 2
    BACK_WALL = 3
    GREEN_WALL = 4
    RED_WALL = 5
    SMALL_BOX = 6
    LARGE_BOX = 7

    def __str__(self) -> str:
        return self.name.lower().replace("_", " ")


def with_material(scene: Scene, part: Part, material: Material) -> Scene:
    """Return the scene with another material of a part."""
    shapes = tuple(
        _painted(shape, material) if index == part else shape
        for index, shape in enumerate(scene.shapes)
    )
    return replace(scene, shapes=shapes)


def coverage(scene: Scene, part: Part) -> NDArray[np.float32]:
    """Return how much of each pixel shows a part, from 0 to 1, shape (height, width)."""
    white, black = Diffuse(1), Diffuse(0)
    shapes = tuple(
        _painted(shape, white if index == part else black)
        for index, shape in enumerate(scene.shapes)
    )
    layers = Rendering(replace(scene, shapes=shapes), COVERAGE_SPP).first_hits()
    share: NDArray[np.float32] = layers["albedo"][..., 0]
    return share


def _painted(shape: Shape, material: Material) -> Shape:
    if isinstance(shape, Mesh):
        return Mesh(shape.vertices, shape.faces, shape.normals, material)
    return Sphere(shape.center, shape.radius, material)
