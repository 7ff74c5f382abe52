"""The share c of directions that a guide chooses, by depth and albedo.

A guide knows where direct light is reflected. Let a vertex of a path have n vertices after it that
can get direct light. If the surfaces have the albedo ρ, the light that arrives is

    1 + ρ + … + ρⁿ⁻¹

times that of which the guide knows the directions, the first term. Light of the other terms comes
from everywhere alike. The noise is least where directions are as dense as light is bright, so that
the guide's share should be the first term's,

    κ(n) = 1 / (1 + ρ + … + ρⁿ⁻¹) = (1 − ρ) / (1 − ρⁿ).

A constant share fails with many bounces. A direction of which the guide knows nothing is chosen
with the probability 1 − c, and multiplies the throughput by ρ / (1 − c). So the second moment of a
path's contribution grows like (ρ² / (1 − c))ᴺ over N vertices, while by the BRDF alone it is ρ²ᴺ.
With c = κ(n) that factor is

    ρ / (1 − κ(n)) = κ(n − 1) / κ(n),

and the product of all of them, from n = N down to 2, is κ(1) / κ(N) = 1 + ρ + … + ρᴺ⁻¹: no path
weighs more than N times what reaches the first vertex. Where the albedo differs from vertex to
vertex, this holds with the albedo of each vertex itself, as κ(n − 1) / κ(n) ≤ n / (n − 1). So a
share is bounded by κ of the vertex' own albedo, and by `KNOWN` times that of the mean albedo.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import drjit as dr
import numpy as np

from drpt.kernel.patches import COLUMNS
from drpt.kernel.vec import types_of

if TYPE_CHECKING:
    from drjit.auto import Float, UInt32
    from numpy.typing import NDArray

    from drpt.kernel.patches import Patches
    from drpt.kernel.primitives import Primitives

    Array = NDArray[np.float64]

GREATEST = 0.5
"""Largest share."""
KNOWN = 0.8
"""Fraction of the reflected direct light that a guide reaches; some directions are blocked."""
LEAST = 1 / 32
"""Smaller shares gain nothing, and leave too few bits of a random number for a direction."""
STEP = 2.0**-10
"""Shares are multiples of this: then 1 − c is exact, and no random number is rounded to 1."""  # noqa: RUF001
MOST_VERTICES = 256
"""Number of later vertices beyond which a share of at least `LEAST` no longer changes."""


@dataclass
class GuideShares:
    """Shares on the device: ``table`` has a row of ``width`` for each row of patches."""

    table: Float
    width: int

    def of(self, patch: UInt32, vertices: int | UInt32) -> Float:
        """The guide's share on a patch, given the number of later vertices; 0 on patch 0."""
        types = types_of(self.table)
        count = types.UInt32(max(0, vertices) if isinstance(vertices, int) else vertices)
        column = dr.minimum(count, self.width - 1)
        return dr.gather(types.Float32, self.table, (patch // COLUMNS) * self.width + column)


def make_shares(primitives: Primitives, patches: Patches, bounces: int) -> Array:
    """Shares (rows of patches, vertices to come), 0 with no vertex to come (host)."""
    facets = len(primitives.facets)
    albedo, diffuse = primitives.reflectance[:facets, :3], primitives.diffuse[:facets]
    mean = np.average(albedo.mean(axis=1), weights=diffuse * primitives.facet_areas)
    count = min(bounces, MOST_VERTICES) - 1
    share = np.minimum(KNOWN * known_part(mean, count), known_part(albedo.max(axis=1), count))
    of_facets = np.pad(np.minimum(GREATEST, share), ((0, 1), (1, 0)))
    of_facets[facets] = 0  # that of no facet, number -1
    return np.asarray(of_facets[patches.facet[::COLUMNS]])


def known_part(albedo: Any, count: int) -> Array:
    """κ(1) … κ(count) for each albedo, (n, count) (host)."""
    powers = np.reshape(albedo, (-1, 1)) ** np.arange(count)
    return np.asarray(1 / np.cumsum(powers, axis=1))


def rounded(shares: Array) -> Array:
    """Shares as kernels use them: multiples of `STEP`, none below `LEAST` (host)."""
    steps = np.floor(shares / STEP) * STEP
    return np.where(steps < LEAST, 0, steps)
