"""Shapes that overlap in one plane: of each two the later one is seen (host).

Two surfaces in one place leave it to rounding which of them a ray meets. So before any layout is
made of the shapes, what a later shape covers is cut away from an earlier one, and of spheres that
are the same the last one is kept.

A light is cut like any surface, but cuts away nothing from a surface that reflects: its front is
seen before that, and its back is not seen (`intersect.COINCIDENT`). Lights that face opposite ways
are both kept. Lights that are the same triangle or sphere add up, see `primitives`.

Nothing is cut where it makes no difference: between surfaces of the same material, and where both
sides of the common plane are dark, such as beneath a closed box that stands on the floor.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

from drpt.kernel.coplanar import SAME_PLACE, coplanar_pairs
from drpt.kernel.cutting import cut_parts
from drpt.kernel.darkness import dark_on_both_sides
from drpt.kernel.nearby import close_pairs
from drpt.kernel.parts import all_triangles
from drpt.scene import Mesh, Sphere

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from drpt.kernel.parts import Part, Triangles
    from drpt.scene import Shape

    Array: TypeAlias = NDArray[np.float64]
    Indices: TypeAlias = NDArray[np.intp]
    Mask: TypeAlias = NDArray[np.bool_]

SHOWN = 3
"""Pairs of shapes that a warning names; it counts the others."""


class Overlap(NamedTuple):
    """The numbers of two shapes that overlap; the later one is seen."""

    earlier: int
    later: int

    def __str__(self) -> str:
        later = "itself" if self.earlier == self.later else f"shapes[{self.later}]"
        return f"shapes[{self.earlier}] and {later}"


class Resolved(NamedTuple):
    """Parts of which no two surfaces are in one place, and what has been cut for that."""

    parts: list[Part]
    overlaps: tuple[Overlap, ...] = ()


def warning_of(overlaps: tuple[Overlap, ...]) -> str:
    """One line that names the shapes that overlap."""
    named = ", ".join(map(str, overlaps[:SHOWN]))
    more = f", and {len(overlaps) - SHOWN} more" if len(overlaps) > SHOWN else ""
    return f"surfaces overlap in one place, where the later one is seen: {named}{more}"


def resolve_overlaps(parts: list[Part]) -> Resolved:
    """Cut what later shapes cover away from earlier ones."""
    parts, same_spheres = _without_covered_spheres(parts)
    triangles = all_triangles(parts)
    pairs = _overlapping_triangles(triangles)
    if len(pairs):
        pairs = pairs[~dark_on_both_sides(parts, triangles, pairs)]
    if len(pairs):
        numbers = np.array([part.number for part in triangles.parts])
        same_spheres += _unique_overlaps(numbers[triangles.part[pairs]])
        parts = cut_parts(parts, triangles, pairs)
    return Resolved(parts, tuple(sorted(same_spheres)))


def _unique_overlaps(numbers: Indices) -> list[Overlap]:
    return [Overlap(*pair) for pair in np.unique(numbers, axis=0).tolist()]


def _look(shape: Shape) -> object:
    """What tells shapes apart by sight: interpolated normals are those of a mesh alone."""
    smooth = isinstance(shape, Mesh) and shape.normals is not None
    return (shape.material, shape.radiance, id(shape) if smooth else 0)


def _looks(parts: list[Part]) -> Indices:
    """The number of each part's look (n,)."""
    known: dict[object, int] = {}
    return np.array([known.setdefault(_look(part.shape), len(known)) for part in parts], np.intp)


def _without_covered_spheres(parts: list[Part]) -> tuple[list[Part], list[Overlap]]:
    """Leave out spheres in whose place there is a later one."""
    spheres = [part for part in parts if isinstance(part.shape, Sphere)]
    looks = _looks(spheres)
    if len(set(looks.tolist())) < 2:
        return parts, []
    rows = np.array([part.primitives[0] for part in spheres])
    tolerances = SAME_PLACE * (np.abs(rows[:, :3]).max(axis=1) + rows[:, 3])

    def boxes(numbers: Indices) -> tuple[Array, Array]:
        centers, radii = rows[numbers, :3], rows[numbers, 3:]
        return centers - radii, centers + radii

    pairs = close_pairs(rows, tolerances, looks, boxes)
    first, second = pairs.T
    differences = np.abs(rows[first] - rows[second]).max(axis=1, initial=0)
    light = np.array([part.is_light for part in spheres])
    add_up = light[first] & light[second] & (differences == 0)
    pairs = pairs[(differences <= np.minimum(tolerances[first], tolerances[second])) & ~add_up]
    numbers = np.array([part.number for part in spheres])
    covered = set(numbers[pairs[:, 0]].tolist())
    kept = [part for part in parts if part.number not in covered]
    return kept, _unique_overlaps(numbers[pairs])


def _overlapping_triangles(triangles: Triangles) -> Indices:
    """Pairs (k, 2) of triangles that overlap in one plane, the one to cut first."""
    looks, light = _looks(triangles.parts), triangles.light
    if len(set(looks.tolist())) < 2 and light.sum() < 2:
        return np.empty((0, 2), np.intp)
    groups = looks[triangles.part]
    alone = np.flatnonzero(light)  # the triangles of a light may cover each other
    groups[alone] = len(looks) + alone
    pairs = coplanar_pairs(triangles, groups)
    first, second = light[pairs].T
    pairs = pairs[first | ~second]
    return pairs[~_add_up(triangles, pairs)]


def _add_up(triangles: Triangles, pairs: Indices) -> Mask:
    """Whether pairs are of lights that face opposite ways, or are one and the same triangle."""
    light = triangles.light[pairs]
    corners = triangles.corners(pairs.ravel()).reshape(-1, 2, 3, 3)
    first, second = triangles.vectors[pairs].swapaxes(0, 1)
    opposite = np.einsum("kx,kx->k", first, second) < 0
    turns = [np.roll(corners[:, 1], turn, axis=1) for turn in range(3)]
    same = np.any([(corners[:, 0] == turned).all(axis=(1, 2)) for turned in turns], axis=0)
    return np.asarray(light.all(axis=1) & (opposite | same))
