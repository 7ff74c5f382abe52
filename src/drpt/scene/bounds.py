"""The box around shapes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from drpt.scene.model import Mesh, Sphere

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from drpt.scene.model import Shape

    Array = NDArray[np.float64]


def bounds(shapes: Iterable[Shape]) -> tuple[Array, Array]:
    """Lowest and highest corner (3,) of the box around one shape or more."""
    shapes = tuple(shapes)
    spheres = [(*shape.center, shape.radius) for shape in shapes if isinstance(shape, Sphere)]
    centers, radii = np.split(np.array(spheres).reshape(-1, 4), [3], axis=1)
    meshes = [shape.vertices for shape in shapes if isinstance(shape, Mesh)]
    low = np.vstack([centers - radii, *(mesh.min(axis=0) for mesh in meshes)]).min(axis=0)
    high = np.vstack([centers + radii, *(mesh.max(axis=0) for mesh in meshes)]).max(axis=0)
    return low, high
