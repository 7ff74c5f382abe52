"""Whether light can reach either side of a plane in which two surfaces overlap (host).

A side is dark inside a closed body without a light, and where no part of the scene is on that side
of the plane. A camera sees black there, wherever it stands.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from drpt.kernel.overlaps.coplanar import SAME_PLACE
from drpt.scene import Mesh

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from drpt.kernel.parts import Part, Triangles

    Array: TypeAlias = NDArray[np.float64]
    Indices: TypeAlias = NDArray[np.intp]
    Mask: TypeAlias = NDArray[np.bool_]

NEAR = SAME_PLACE
"""A point is beyond a plane only if it is farther from it than this, relative to the scene's
coordinates."""
PLANES = 256
"""Number of planes that are tested. Something is assumed to be beyond all others."""
DIGITS = 6
"""Planes that agree to this many digits are tested once."""


def dark_on_both_sides(parts: list[Part], triangles: Triangles, pairs: Indices) -> Mask:
    """Whether no light reaches pairs (k, 2) of triangles in one plane, so no picture shows them.

    At least one side must be inside a closed body: a connected part of a mesh each of whose edges
    is shared by two triangles.
    """
    planes = _planes(triangles, pairs)
    dark_above, dark_below = _nothing_beyond(parts, planes)
    inner = _inner_sides(parts, triangles, np.unique(triangles.part[pairs]))
    facing = np.sign(np.einsum("kix,kx->ki", triangles.vectors[pairs], planes[:, :3]))
    shines, inside = np.where(triangles.light[pairs], facing, 0), inner[pairs] * facing
    above, below = (inside > 0).any(axis=1), (inside < 0).any(axis=1)
    dark_above &= (shines <= 0).all(axis=1)
    dark_below &= (shines >= 0).all(axis=1)
    return np.asarray(above & (below | dark_below) | below & dark_above)


def _planes(triangles: Triangles, pairs: Indices) -> Array:
    """Return the plane of each pair, a row (normal, offset): the larger triangle's plane."""
    numbers, normals = triangles.larger(pairs)
    offsets = np.einsum("kx,kx->k", normals, triangles.corners(numbers)[:, 0])
    return np.column_stack([normals, offsets])


def _nothing_beyond(parts: list[Part], planes: Array) -> tuple[Mask, Mask]:
    """Whether nothing of the scene is above each plane (n, 4), and below it."""
    points, radii = _balls(parts)
    size = np.abs(points).max(initial=0) + radii.max(initial=0)
    rounded = np.round(planes / [1, 1, 1, size], DIGITS)
    _, first, of_plane = np.unique(rounded, axis=0, return_index=True, return_inverse=True)
    above, below = np.zeros((2, len(first)), bool)
    for k, (*normal, offset) in enumerate(planes[first[:PLANES]]):
        heights = points @ normal - offset
        above[k] = (heights + radii).max() <= NEAR * size
        below[k] = (heights - radii).min() >= -NEAR * size
    return above[of_plane.ravel()], below[of_plane.ravel()]


def _balls(parts: list[Part]) -> tuple[Array, Array]:
    """Centres (n, 3) and radii (n,) of balls with the same convex hull as the parts."""
    meshes = [part.triangles.reshape(-1, 3) for part in parts if isinstance(part.shape, Mesh)]
    spheres = [part.primitives for part in parts if not isinstance(part.shape, Mesh)]
    rows = np.concatenate([np.empty((0, 4)), *spheres])
    radii = np.concatenate([rows[:, 3], np.zeros(sum(map(len, meshes)))])
    return np.concatenate([rows[:, :3], *meshes]), radii


def _inner_sides(parts: list[Part], triangles: Triangles, places: Indices) -> Indices:
    """The dark side of each triangle (n,), where a closed body has it inside.

    1 is the front, -1 the back, 0 neither. Triangles of parts that are not at ``places`` have 0.
    """
    inner = np.zeros(len(triangles.part), np.intp)
    numbers = np.flatnonzero(np.isin(triangles.part, places))
    corners, part = triangles.corners(numbers), triangles.part[numbers]
    closed, body = _closed_bodies(corners, part)
    volumes = np.bincount(body, np.einsum("kx,kx->k", corners[:, 0], triangles.vectors[numbers]))
    outward = np.sign(volumes)[body].astype(np.intp)
    light = triangles.light[numbers]
    dark = closed & ~_holds_light(parts, triangles.parts, corners, part, body)
    inner[numbers] = np.where(dark & ~(light & (outward < 0)), -outward, 0)
    return inner


def _closed_bodies(corners: Array, part: Indices) -> tuple[Mask, Indices]:
    """Whether each triangle (n, 3, 3) belongs to a closed body, and the number of its body."""
    from scipy.sparse import coo_array  # the import is slow, and few scenes need it
    from scipy.sparse.csgraph import connected_components

    points = np.column_stack([np.repeat(part, 3), corners.reshape(-1, 3)])
    distinct, faces = np.unique(points, axis=0, return_inverse=True)
    faces, count = faces.reshape(-1, 3), len(distinct)
    starts, stops = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    edges, index, uses = np.unique(starts * count + stops, return_inverse=True, return_counts=True)
    shared = (uses[index.ravel()] == 1) & np.isin(stops * count + starts, edges)
    graph = coo_array((np.ones(len(starts), bool), (starts, stops)), (count, count))
    bodies = connected_components(graph, directed=False)[1]
    body = bodies[faces[:, 0]].astype(np.intp)
    open_bodies = np.unique(body[~shared.reshape(-1, 3).all(axis=1)])
    return ~np.isin(body, open_bodies), body


def _holds_light(
    parts: list[Part], meshes: list[Part], corners: Array, part: Indices, body: Indices
) -> Mask:
    """Whether the box around each triangle's body intersects that of a light of another shape."""
    count = body.max(initial=-1) + 1
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(low, body, corners.min(axis=1))
    np.maximum.at(high, body, corners.max(axis=1))
    own = np.zeros(count, np.intp)
    own[body] = np.array([mesh.number for mesh in meshes])[part]
    held = np.zeros(count, bool)
    for light in (part for part in parts if part.is_light and len(part.primitives)):
        points, radii = _balls([light])
        lowest, highest = (
            (points - radii[:, None]).min(axis=0),
            (points + radii[:, None]).max(axis=0),
        )
        inside = (lowest <= high).all(axis=1) & (low <= highest).all(axis=1)
        held |= inside & (own != light.number)
    return held[body]
