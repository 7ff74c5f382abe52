"""Shapes of Mitsuba's as arrays, each triangle turned to the side that Mitsuba takes as front."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from drpt.scene.meshes import MeshArrays

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

DISK_CORNERS = 128
"""Corners of a disk: with the disk's area they lie 2e-4 of its radius outside of its rim, and the
middles of the edges 1e-4 inside."""
SAME_NORMAL = 1e-5
"""Largest distance from a face's normal at which a shading normal is that: some roundings of
float32, in which Mitsuba keeps them."""
SIMILAR = 1e-3
"""Error of squared lengths that Mitsuba tolerates in the matrix of a sensor."""

SQUARE = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float64)


def uniform_scale(axes: Floats) -> float | None:
    """Return by how much a matrix (3, 3) scales all directions alike; None if it does not."""
    square = float(axes[:, 0] @ axes[:, 0])
    alike = np.abs(axes.T @ axes - square * np.eye(3)).max() <= SIMILAR * square
    return float(np.sqrt(square)) if alike else None


def disk() -> Floats:
    """Return the corners of the regular polygon with the area of the unit disk."""
    angle = 2 * np.pi / DISK_CORNERS
    azimuth = angle * np.arange(DISK_CORNERS)
    radius = np.sqrt(angle / np.sin(angle))
    corners: Floats = radius * np.stack([np.cos(azimuth), np.sin(azimuth), 0 * azimuth], axis=1)
    return corners


def polygon(corners: Floats, to_world: Floats, flipped: bool) -> MeshArrays:
    """Return a convex polygon of the plane z = 0, in the world; its front was +z, or -z."""
    vertices = corners @ to_world[:3, :3].T + to_world[:3, 3]
    last = np.arange(2, len(corners))
    faces = np.stack([0 * last, last - 1, last], axis=1)
    front = np.linalg.inv(to_world[:3, :3])[2] * (-1 if flipped else 1)
    return MeshArrays(vertices, turned(vertices, faces, front), None)


def mesh_arrays(mi: Any, mesh: Any) -> MeshArrays:
    """Return a mesh of Mitsuba's; without normals where they are those of its faces."""
    buffers = mi.traverse(mesh)
    vertices, normals = (
        np.array(buffers[f"vertex_{name}"], np.float64).reshape(-1, 3)
        for name in ("positions", "normals")
    )
    faces = np.array(buffers["faces"], np.int64).reshape(-1, 3)
    if not mesh.has_vertex_normals():
        front = face_normals(vertices, faces)
        return MeshArrays(vertices, turned(vertices, faces, _flip(mi, mesh, front) * front), None)
    normals *= _flip(mi, mesh, normals[faces].sum(axis=1))
    faces = turned(vertices, faces, normals[faces].sum(axis=1))
    flat = np.abs(normals[faces] - face_normals(vertices, faces)[:, None]) < SAME_NORMAL
    return MeshArrays(vertices, faces, None if flat.all() else normals)


def turned(vertices: Floats, faces: NDArray[Any], front: Floats) -> NDArray[Any]:
    """Return the faces, each counter-clockwise as seen from the direction `front`, (m, 3)."""
    away = (face_normals(vertices, faces) * front).sum(axis=1) < 0
    return np.where(away[:, None], faces[:, ::-1], faces)


def face_normals(vertices: Floats, faces: NDArray[Any]) -> Floats:
    """Return each triangle's normal, (m, 3); 0 where it has no area."""
    a, b, c = vertices[faces].swapaxes(0, 1)
    normals: Floats = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return normals / np.where(lengths > 0, lengths, 1)


def _flip(mi: Any, mesh: Any, front: Floats) -> int:
    """Return -1 if Mitsuba takes the sides opposite to `front`, (m, 3), for the triangles' own."""
    if not len(front):
        return 1
    longest = int(np.argmax((front**2).sum(axis=1)))
    hit = mi.PreliminaryIntersection3f()
    hit.prim_index = longest
    hit.prim_uv = [1 / 3, 1 / 3]
    surface = mesh.compute_surface_interaction(mi.Ray3f([0, 0, 0], [0, 0, 1]), hit)
    return -1 if np.array(surface.sh_frame.n).ravel() @ front[longest] < 0 else 1
