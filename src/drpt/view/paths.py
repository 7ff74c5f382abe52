"""The paths through a pixel, as a browser draws and lists them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from drpt.kernel.recording import NONE
from drpt.scene.bounds import bounds

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from drpt.kernel.recording import Vertices
    from drpt.scene import Scene

    Array = NDArray[np.float64]


def describe_paths(scene: Scene, vertices: Vertices) -> list[dict[str, Any]]:
    """Return what is known about each path, for JSON: its radiance, and its vertices in order."""
    points = _ends(scene, vertices)
    at, light_at = _project(scene, points), _project(scene, vertices.light_point)
    radiance = vertices.contribution.sum(axis=0)

    def vertex(depth: int, path: int) -> dict[str, Any]:
        here, shape = (depth, path), int(vertices.shape[depth, path])
        return {
            "at": _numbers(at[here]),
            "point": _numbers(points[here]),
            "shape": _shape(shape),
            "event": _event(scene, shape),
            "throughput": _numbers(vertices.throughput[here]),
            "contribution": _numbers(vertices.contribution[here]),
            "light": _light(vertices, here, light_at[here]),
        }

    return [
        {
            "sample": path,
            "radiance": _numbers(radiance[path]),
            "vertices": [vertex(depth, path) for depth in range(reached.sum())],
        }
        for path, reached in enumerate(vertices.reached.T)
    ]


def _ends(scene: Scene, vertices: Vertices) -> Array:
    """Where each ray ends: what it meets, or a point on its way out of the scene."""
    points, size = vertices.point.copy(), _size(scene)
    start = np.broadcast_to(np.array(scene.camera.eye), points.shape[1:])
    for depth, missed in enumerate(vertices.shape == NONE):
        before = points[depth - 1] if depth else start
        points[depth, missed] = (before + size * vertices.direction[depth])[missed]
    return points


def _size(scene: Scene) -> float:
    low, high = bounds(scene.shapes)
    return float(np.linalg.norm(high - low))


def _project(scene: Scene, points: Array) -> Array:
    from drpt.scene.picture_plane import picture_plane

    ways = points.reshape(-1, 3) - scene.camera.eye
    return picture_plane(scene.camera).project(ways)[:, :2].reshape(*points.shape[:-1], 2)


def _light(vertices: Vertices, here: tuple[int, int], at: Array) -> dict[str, Any] | None:
    shape = int(vertices.light_shape[here])
    if shape == NONE:
        return None
    return {
        "at": _numbers(at),
        "point": _numbers(vertices.light_point[here]),
        "shape": shape,
        "visible": bool(vertices.contribution[here].any()),
    }


def _event(scene: Scene, shape: int) -> str:
    if shape == NONE:
        return "background"
    return "light" if scene.shapes[shape].is_light else "surface"


def _shape(shape: int) -> int | None:
    return None if shape == NONE else shape


def _numbers(values: Array) -> list[float] | None:
    """Values for JSON, None if one of them is none."""
    return [float(value) for value in values] if np.isfinite(values).all() else None
