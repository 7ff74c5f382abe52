"""Directions by a guide: one share of them by the BSDF, the others towards patches.

An estimate takes either way by chance and weights it by the density of both (Veach & Guibas 1995,
the balance heuristic for one sample). The density of the guided directions is known only where the
ray arrives, as is its weight.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import drjit as dr

from drpt.kernel.guiding.guide import NOWHERE
from drpt.kernel.integrators.directions import ScatterSample
from drpt.kernel.vec import types_of, vec2
from drpt.kernel.warp import cosine_hemisphere_pdf

if TYPE_CHECKING:
    from drjit.auto import Array2f, Float, UInt32

    from drpt.kernel.bsdfs import Bsdf
    from drpt.kernel.guiding.guide import Guide
    from drpt.kernel.guiding.share import GuideShares
    from drpt.kernel.integrators.depth import Depth
    from drpt.kernel.integrators.state import Path
    from drpt.kernel.intersect import Hit


class Place(NamedTuple):
    """The patch of a vertex, 0 if its directions are not guided, and the share that is."""

    patch: UInt32
    share: Any = 0


class GuidedDirections:
    """Directions by a guide, from diffuse surfaces; its state is a patch and a target.

    The patch is the one from which the ray comes, and the target the facet to which it was guided.
    """

    def __init__(self, guide: Guide, shares: GuideShares, bounces: int) -> None:
        self.guide, self.shares, self.bounces = guide, shares, bounces
        number = guide.types.UInt32
        self.start = number(0), number(NOWHERE)

    def arrive(self, path: Path, hit: Hit, depth: Depth) -> tuple[Path, Hit, Place]:
        """Weight the direction by both densities, and reject guided rays that miss their target."""
        if depth.only_emits:  # the last segment is not guided
            return path, hit, Place(path.guide[0])
        place = Place(self.guide.patch_of(hit))
        if not depth.may_be_later:
            return path, hit, place
        patch, target = path.guide
        lost = (target != NOWHERE) & ~(hit.valid & (hit.primitive == target))
        share = self.shares.of(patch, self.bounces - depth.number)
        density = share * self.guide.density(patch, place.patch)
        by_guide = density * dr.square(hit.distance)
        by_bsdf = path.pdf * dr.abs(dr.dot(hit.normal, path.direction))
        weight = dr.select(by_guide > 0, by_bsdf / (by_bsdf + by_guide), 1)
        beta = path.beta * dr.select(lost, 0, weight)
        return path._replace(beta=beta), hit._replace(valid=hit.valid & ~lost), place

    def at(self, place: Place, bsdf: Bsdf, depth: Depth) -> Place:
        """The patch of a diffuse surface, and its share.

        The last segment can only hit a light; it is not guided.
        """
        guided = bsdf.is_diffuse & depth.next_reflects
        patch = dr.select(guided, place.patch, types_of(place.patch).UInt32(0))
        return Place(patch, self.shares.of(patch, depth.bounces_after_next))

    def bsdf_share(self, place: Place) -> Float:
        """Share of the directions that follow the BSDF."""
        rest: Float = 1 - place.share
        return rest

    def sample(self, place: Place, hit: Hit, bsdf: Bsdf, u: Array2f) -> ScatterSample:
        """A direction to a point of a patch, or by the BSDF."""
        share = place.share
        guided, unguided = u.x < share, 1 - share
        u = vec2(dr.select(guided, u.x / share, (u.x - share) / unguided), u.y)
        towards, facet = self.guide.aim(place.patch, hit.point, u, guided)
        sample = bsdf.sample(u)
        direction = dr.select(guided, towards, sample.direction)
        of_guided = cosine_hemisphere_pdf(dr.dot(bsdf.point.shading_normal, towards))
        pdf = unguided * dr.select(guided, of_guided, sample.pdf)
        target = dr.select(guided, facet, NOWHERE)
        return ScatterSample(
            direction, bsdf.weight(direction) / unguided, pdf, (place.patch, target)
        )
