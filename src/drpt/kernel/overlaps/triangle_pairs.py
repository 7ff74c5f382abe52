"""Pairs of triangles: how far they overlap, and how far their planes are apart there (host)."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array: TypeAlias = NDArray[np.float64]
    Mask: TypeAlias = NDArray[np.bool_]

INSIDE = 1e-9
"""A point is in a triangle if no barycentric coordinate is below minus this. Points just outside do
no harm, but no corner of the common area may be lost."""


def overlap_width(corners: Array) -> Array:
    """Width (k,) of the common area of pairs of triangles (k, 2, 3, 3) in one plane.

    It is the smallest distance by which one triangle reaches over an edge of the other; 0 or less
    if the triangles share no area.
    """
    return np.minimum(_reach_over_edges(corners), _reach_over_edges(corners[:, ::-1]))


def lies_inside(corners: Array, rooms: Array) -> Mask:
    """Whether the second of pairs of triangles (k, 2, 3, 3) in one plane lies in the first (k,).

    Unless they are the same, it must keep off the first one's edges by ``rooms`` (k,).
    """
    first, second = corners.swapaxes(0, 1)
    is_corner = (first[:, :, None] == second[:, None]).all(axis=3).any(axis=2)
    heights = _heights_over_edges(corners).min(axis=(1, 2))
    return np.asarray(is_corner.all(axis=1) | (heights >= rooms))


def _reach_over_edges(corners: Array) -> Array:
    return np.asarray(_heights_over_edges(corners).max(axis=2).min(axis=1))


def _heights_over_edges(corners: Array) -> Array:
    """Heights (k, edges, corners) of the second triangle's corners above the first one's edges."""
    first, second = corners.swapaxes(0, 1)
    ahead = np.roll(first, -1, axis=1) - first
    normals = np.cross(ahead[:, 0], ahead[:, 1])
    inward = np.cross(normals[:, None], ahead)
    inward /= np.linalg.norm(inward, axis=2, keepdims=True)
    return np.einsum("kex,kecx->kec", inward, second[:, None] - first[:, :, None])


def separation(corners: Array, normals: Array) -> Array:
    """Greatest distance (k,) between pairs of triangles (k, 2, 3, 3) where they overlap.

    It is measured along unit normals (k, 3), and is greatest at a corner of the common area: a
    corner of one triangle in the other, or a crossing of two edges. Infinite without a common area.
    """
    heights = np.einsum("kicx,kx->kic", corners - corners[:, :1, :1], normals)
    flat = _projected(corners, normals)
    gaps = [
        _gaps_at_corners(flat, heights),
        _gaps_at_corners(flat[:, ::-1], heights[:, ::-1]),
        _gaps_at_crossings(flat, heights),
    ]
    widest = np.max([gap.max(axis=1, initial=-1) for gap in gaps], axis=0)
    return np.where(widest >= 0, widest, np.inf)


def _projected(corners: Array, normals: Array) -> Array:
    """Coordinates (k, 2, 3, 2) of corners in planes with unit normals (k, 3)."""
    helper = np.eye(3)[np.abs(normals).argmin(axis=1)]
    right = np.cross(helper, normals)
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    axes = np.stack([right, np.cross(normals, right)], axis=1)
    return np.asarray(np.einsum("kicx,kax->kica", corners - corners[:, :1, :1], axes))


def _gaps_at_corners(flat: Array, heights: Array) -> Array:
    """Distances (k, 3) of the first triangle's corners from the second; -1 outside of it."""
    (point, (a, b, c)) = flat[:, 0], np.moveaxis(flat[:, 1, :, None], 1, 0)
    area = _cross(b - a, c - a)
    area = np.where(area == 0, np.nan, area)
    of_b, of_c = _cross(point - a, c - a) / area, _cross(b - a, point - a) / area
    weights = np.stack([1 - of_b - of_c, of_b, of_c], axis=2)
    gaps = np.abs(heights[:, 0] - np.einsum("kpc,kc->kp", weights, heights[:, 1]))
    return np.where((weights >= -INSIDE).all(axis=2), gaps, -1)


def _gaps_at_crossings(flat: Array, heights: Array) -> Array:
    """Distances (k, 9) of the two triangles where their edges cross; -1 if they do not."""
    start, other = flat[:, 0, :, None], flat[:, 1, None]
    along = np.roll(start, -1, axis=1) - start
    other_along = np.roll(other, -1, axis=2) - other
    turn = _cross(along, other_along)
    parallel = turn == 0
    s, t = (
        np.where(parallel, -1, _cross(other - start, way) / np.where(parallel, 1, turn))
        for way in (other_along, along)
    )
    level, other_level = heights[:, 0, :, None], heights[:, 1, None]
    rise = np.roll(level, -1, axis=1) - level
    other_rise = np.roll(other_level, -1, axis=2) - other_level
    cross = (s >= 0) & (s <= 1) & (t >= 0) & (t <= 1)
    gaps = np.abs(level + s * rise - other_level - t * other_rise)
    return np.where(cross, gaps, -1).reshape(-1, 9)


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
