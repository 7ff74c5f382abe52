"""Convex polygons of different sizes, in padded arrays, and operations on all of them (host)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Array: TypeAlias = NDArray[np.float64]
    Indices: TypeAlias = NDArray[np.intp]
    Mask: TypeAlias = NDArray[np.bool_]


@dataclass(frozen=True)
class Polygons:
    """Corners (n, k, 3) of polygons, of which the first ``sizes`` (n,) count."""

    corners: Array
    sizes: Indices

    @classmethod
    def of(cls, polygons: Sequence[Array]) -> Polygons:
        """Polygons (k, 3) of any sizes."""
        sizes = np.array([len(polygon) for polygon in polygons], np.intp)
        corners = np.zeros((len(sizes), max(3, sizes.max(initial=0)), 3))
        for row, polygon in zip(corners, polygons, strict=True):
            row[: len(polygon)] = polygon
        return cls(corners, sizes)

    def __getitem__(self, chosen: Indices | Mask) -> Polygons:
        """Some of the polygons."""
        return Polygons(self.corners[chosen], self.sizes[chosen])

    @property
    def count(self) -> int:
        """Number of polygons."""
        return len(self.sizes)

    @property
    def there(self) -> Mask:
        """Which corners (n, k) count."""
        return np.asarray(np.arange(self.corners.shape[1]) < self.sizes[:, None])

    @property
    def following(self) -> Indices:
        """Number (n, k) of the corner after each one."""
        after = np.arange(1, self.corners.shape[1] + 1)
        return np.where(after < self.sizes[:, None], after, 0)

    def normals(self) -> Array:
        """Unit normals (n, 3); the corners are seen counter-clockwise against them."""
        spokes = self.corners - self.corners[:, :1]
        vectors = np.cross(spokes[:, 1:-1], spokes[:, 2:])
        vectors = np.where(self.there[:, 2:, None], vectors, 0).sum(axis=1)
        return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))

    def ahead(self) -> Array:
        """Vectors (n, k, 3) from each corner to the next."""
        after = np.take_along_axis(self.corners, self.following[..., None], axis=1)
        return np.where(self.there[..., None], after - self.corners, 0)

    def clipped(self, heights: Array) -> Polygons:
        """The parts where heights (n, k) of the corners are at least 0; one of them is."""
        following, candidates = self.following, 2 * self.corners.shape[1]
        there = np.where(self.there, heights, -1.0)
        after = np.take_along_axis(there, following, axis=1)
        crossed = self.there & (there * after < 0)
        share = np.divide(there, there - after, out=np.zeros_like(there), where=crossed)
        crossing = self.corners + share[..., None] * self.ahead()
        kept = np.stack([there >= 0, crossed], axis=2).reshape(self.count, candidates)
        corners = np.stack([self.corners, crossing], axis=2).reshape(self.count, candidates, 3)
        order = np.argsort(~kept, axis=1, kind="stable")
        sizes = kept.sum(axis=1)
        order = order[:, : max(3, sizes.max(initial=0))]
        return Polygons(np.take_along_axis(corners, order[..., None], axis=1), sizes)

    def widened(self, normals: Array, widths: Array, longest_mitre: float) -> Polygons:
        """The polygons with edges moved outward by widths (n,), given their unit normals (n, 3).

        Sharp corners move no farther than ``longest_mitre`` widths.
        """
        outward = np.cross(self.ahead(), normals[:, None])
        lengths = np.linalg.norm(outward, axis=2, keepdims=True)
        outward = np.divide(outward, lengths, out=np.zeros_like(outward), where=lengths > 0)
        before = np.roll(outward, 1, axis=1)
        before[:, 0] = outward[np.arange(self.count), self.sizes - 1]
        both = outward + before
        scale = 2 / np.maximum((both**2).sum(axis=2), (2 / longest_mitre) ** 2)
        return Polygons(self.corners + (widths[:, None] * scale)[..., None] * both, self.sizes)

    def fans(self) -> tuple[Array, Indices]:
        """Triangles (m, 3, 3) of all polygons, and the number (m,) of the polygon of each."""
        last = np.arange(2, self.corners.shape[1])
        used = last < self.sizes[:, None]
        owners, column = np.nonzero(used)
        first, second, third = (
            self.corners[owners, k] for k in (0 * column, column + 1, column + 2)
        )
        return np.stack([first, second, third], axis=1), owners


def joined(batches: Sequence[Polygons]) -> Polygons:
    """All polygons of several batches."""
    width = max((batch.corners.shape[1] for batch in batches), default=3)
    sizes = np.concatenate([np.zeros(0, np.intp), *(batch.sizes for batch in batches)])
    corners = np.zeros((len(sizes), width, 3))
    start = 0
    for batch in batches:
        stop = start + batch.count
        corners[start:stop, : batch.corners.shape[1]] = batch.corners
        start = stop
    return Polygons(corners, sizes)
