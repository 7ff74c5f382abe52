"""The reason why a picture is black, in one line."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from drpt.scene import Mesh, Sphere

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from numpy.typing import NDArray

    from drpt.kernel.first_hit import Seen
    from drpt.scene import Scene, Shape

MAX_POINTS = 1024
"""Number of visible points that lights are tested against, evenly spread over the picture."""
MAX_TRIANGLES = 4096
"""Number of triangles that are tested at once, so that the memory is 32 MiB at most."""
ROUNDING = 1e-6
"""Height above a plane, relative to the coordinates, up to which a point is in the plane."""
SIDE = "a triangle emits on the side from which its vertices turn counter-clockwise"


def black_because(scene: Scene, bounces: int, seen: Seen) -> str:
    """Return why a picture of a scene is black; a reason that is not certain is called likely.

    Parameters
    ----------
    scene, bounces
        What was rendered.
    seen
        First hits of the camera's rays, see :func:`drpt.kernel.first_hit.first_seen`.
    """
    return next(_reasons(scene, bounces, seen))


def _reasons(scene: Scene, bounces: int, seen: Seen) -> Iterator[str]:
    """Yield possible reasons; each assumes that those before it do not hold."""
    shapes = dict(enumerate(scene.shapes))
    lights = [number for number, shape in shapes.items() if shape.is_light]
    in_sight = set(seen.shape[seen.shape >= 0].tolist())
    surfaces = {n for n in in_sight if (material := shapes[n].material) and any(material.albedo)}
    if not lights:
        yield "no shape emits light"
    for number in lights:
        if _is_inside(scene.camera.eye, shapes[number]):
            yield f"the camera is inside shapes[{number}], a light that emits outward only"
    if not in_sight:
        yield "no shape is in front of the camera"
    if set(seen.shape[seen.front].tolist()) & set(lights):
        yield "the only light in sight is so small that no sample hits it; take more spp"
    if in_sight <= set(lights):
        yield f"the camera sees only the back of {_names(sorted(in_sight))}; {SIDE}"
    if bounces == 0:
        yield "0 bounces show lights only, and the camera sees the front of none"
    if not surfaces:
        yield "everything that the camera sees has an albedo of 0"
    points = seen.point[np.isin(seen.shape, list(surfaces))]
    if all(_faces_away(shapes[number], points) for number in lights):
        what = "the only light, faces" if len(lights) == 1 else "the only lights, face"
        yield f"{_names(lights)}, {what} away from everything that the camera sees; {SIDE}"
    yield "no light arrives; likely something blocks it, or surfaces reflect none to the camera"


def _names(numbers: Iterable[int]) -> str:
    first, *others = (f"shapes[{number}]" for number in numbers)
    if len(others) > 2:
        return f"{first} and {len(others)} other shapes"
    return " and ".join([first, *others])


def _is_inside(point: tuple[float, float, float], shape: Shape) -> bool:
    if not isinstance(shape, Sphere):
        return False
    return bool(np.linalg.norm(np.subtract(point, shape.center)) < shape.radius)


def _faces_away(light: Shape, points: NDArray[np.float64]) -> bool:
    """Whether no point is on the front of any of a light's triangles."""
    if not isinstance(light, Mesh):
        return False
    points = points[:: -(-len(points) // MAX_POINTS)]
    room = ROUNDING * max(np.abs(points).max(), np.abs(light.vertices).max())
    for start in range(0, len(light.faces), MAX_TRIANGLES):
        a, b, c = light.vertices[light.faces[start : start + MAX_TRIANGLES]].swapaxes(0, 1)
        normals = np.cross(b - a, c - a)
        heights = points @ normals.T - np.einsum("ij,ij->i", normals, a)
        if (heights > room * np.linalg.norm(normals, axis=1)).any():
            return False
    return True
