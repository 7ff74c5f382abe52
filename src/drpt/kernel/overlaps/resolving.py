"""The rule for shapes that overlap in one plane: the later one is seen (host).

Without a rule, rounding would decide which of two surfaces in one place a ray hits. Before the
shapes are laid out, the area that a later shape covers is cut away from the earlier one. Of equal
spheres, the last one is kept.

A light is cut like any surface, but does not cut a surface that reflects: the light's front wins
against it, and its back is invisible (`intersect.COINCIDENT`). Two lights that face opposite ways
are both kept. Lights that are the same triangle or sphere add up, see `primitives`.

Nothing is cut where it makes no difference: between surfaces of the same material, and where both
sides of the common plane are dark, such as beneath a closed box that stands on the floor.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

from drpt.kernel.overlaps.coplanar import SAME_PLACE, coplanar_pairs
from drpt.kernel.overlaps.cutting import cut_parts
from drpt.kernel.overlaps.darkness import dark_on_both_sides
from drpt.kernel.overlaps.nearby import close_pairs
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
"""Number of pairs of shapes that a warning names. It counts the others."""


class Overlap(NamedTuple):
    """The numbers of two shapes that overlap; the later one is seen."""

    earlier: int
    later: int

    def __str__(self) -> str:
        later = "itself" if self.earlier == self.later else f"shapes[{self.later}]"
        return f"shapes[{self.earlier}] and {later}"


class Resolved(NamedTuple):
    """Parts without overlaps, and the overlaps that were cut."""

    parts: list[Part]
    overlaps: tuple[Overlap, ...] = ()


def warning_of(overlaps: tuple[Overlap, ...]) -> str:
    """One line that names the shapes that overlap."""
    named = ", ".join(map(str, overlaps[:SHOWN]))
    more = f", and {len(overlaps) - SHOWN} more" if len(overlaps) > SHOWN else ""
    return f"surfaces overlap in one place, where the later one is seen: {named}{more}"


def resolve_overlaps(parts: list[Part]) -> Resolved:
    """Cut the areas that later shapes cover away from earlier ones."""
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
    """The visible properties of a shape; no two meshes with normals look the same."""
    smooth = isinstance(shape, Mesh) and shape.normals is not None
    return (shape.material, shape.radiance, id(shape) if smooth else 0)


def _looks(parts: list[Part]) -> Indices:
    """Number of the look of each part (n,)."""
    known: dict[object, int] = {}
    return np.array([known.setdefault(_look(part.shape), len(known)) for part in parts], np.intp)


def _without_covered_spheres(parts: list[Part]) -> tuple[list[Part], list[Overlap]]:
    """Leave out spheres that coincide with a later one."""
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
    """Pairs (k, 2) of triangles that overlap in one plane; the first one is to be cut."""
    looks, light = _looks(triangles.parts), triangles.light
    if len(set(looks.tolist())) < 2 and light.sum() < 2:
        return np.empty((0, 2), np.intp)
    groups = looks[triangles.part]
    alone = np.flatnonzero(light)  # triangles of one light may overlap
    groups[alone] = len(looks) + alone
    pairs = coplanar_pairs(triangles, groups)
    first, second = light[pairs].T
    pairs = pairs[first | ~second]
    return pairs[~_add_up(triangles, pairs)]


def _add_up(triangles: Triangles, pairs: Indices) -> Mask:
    """Whether both of a pair are lights that face opposite ways or are the same triangle."""
    light = triangles.light[pairs]
    corners = triangles.corners(pairs.ravel()).reshape(-1, 2, 3, 3)
    first, second = triangles.vectors[pairs].swapaxes(0, 1)
    opposite = np.einsum("kx,kx->k", first, second) < 0
    turns = [np.roll(corners[:, 1], turn, axis=1) for turn in range(3)]
    same = np.any([(corners[:, 0] == turned).all(axis=(1, 2)) for turned in turns], axis=0)
    return np.asarray(light.all(axis=1) & (opposite | same))
