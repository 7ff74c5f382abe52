"""Diffuse and Phong reflection: sample, eval and pdf of one contract.

Both directions point away from the surface: ω_o to the viewer, ω_i to where the light comes from.
``eval`` includes the cosine; densities are per solid angle; weight 0 means that nothing was
reflected. The lobe is not renormalised at the horizon: what falls below it is lost.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import drjit as dr

from drpt.kernel.primitives import DIFFUSE
from drpt.kernel.vec import frame, reflect
from drpt.kernel.warp import (
    INV_PI,
    cosine_hemisphere_pdf,
    phong_lobe_pdf,
    phong_lobe_sample_pdf,
    square_to_cosine_hemisphere,
    square_to_phong_lobe,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from drjit.auto import Array2f, Array3f, Bool, Float

    from drpt.kernel.estimator import Features
    from drpt.kernel.intersect import Hit


class BrdfSample(NamedTuple):
    """A direction to a light, its weight, eval / pdf, and its density per solid angle."""

    direction: Array3f
    weight: Array3f
    pdf: Float


class Brdf(NamedTuple):
    """The reflection of one surface point towards one viewer.

    ``exponent`` is `DIFFUSE` or that of the Phong lobe around ``mirrored``, the direction to the
    viewer mirrored at the shading normal. Where a scene has interpolated normals, a direction
    counts only where the geometric normal and the shading normal agree on its side.
    """

    features: Features
    albedo: Array3f
    exponent: Float
    normal: Array3f
    shading_normal: Array3f
    to_viewer: Array3f

    def eval(self, to_light: Array3f) -> Array3f:
        """f(ω_o, ω_i) times the cosine at ω_i."""
        cosine = dr.dot(self.shading_normal, to_light)
        lobe = self._either(lambda: INV_PI, lambda: self._phong_pdf(to_light))
        return self.albedo * dr.select((cosine > 0) & self._counts(to_light), lobe * cosine, 0)

    def pdf(self, to_light: Array3f) -> Float:
        """Solid angle: the density of :meth:`sample` at ω_i."""
        return self._either(
            lambda: cosine_hemisphere_pdf(dr.dot(self.shading_normal, to_light)),
            lambda: self._phong_pdf(to_light),
        )

    def sample(self, u: Array2f) -> BrdfSample:
        """Solid angle: a direction ω_i; neither its weight nor its density takes a power."""
        local = self._either(
            lambda: square_to_cosine_hemisphere(u), lambda: square_to_phong_lobe(u, self.exponent)
        )
        to_light = frame(self._either(lambda: self.shading_normal, self._mirrored)).to_world(local)
        pdf = self._either(
            lambda: cosine_hemisphere_pdf(local.z),
            lambda: phong_lobe_sample_pdf(u, local.z, self.exponent),
        )
        return BrdfSample(to_light, self.weight(to_light), pdf)

    def weight(self, to_light: Array3f) -> Array3f:
        """Eval / pdf of a direction ω_i; neither is divided for."""
        cosine = dr.dot(self.shading_normal, to_light)
        share = self._either(lambda: 1, lambda: cosine)
        reflected = self._counts(to_light) & (cosine > 0)
        return self.albedo * dr.select(reflected, share, 0)

    @property
    def is_diffuse(self) -> Any:
        """Whether the surface is diffuse, as far as the kernel has others."""
        return self.exponent == DIFFUSE if self.features.phong else self.features.diffuse

    def _either(self, diffuse: Callable[[], Any], phong: Callable[[], Any]) -> Any:
        """What the surface's kind asks for; the kernel has no code for a kind that is missing."""
        if not self.features.phong:
            return diffuse()
        if not self.features.diffuse:
            return phong()
        return dr.select(self.exponent == DIFFUSE, diffuse(), phong())

    def _mirrored(self) -> Array3f:
        return reflect(self.to_viewer, self.shading_normal)

    def _phong_pdf(self, to_light: Array3f) -> Float:
        """Density of the whole lobe; 1 − cos of the angle off its axis is |ω_r − ω_i|² / 2."""
        below_pole = dr.squared_norm(self._mirrored() - to_light) / 2
        return phong_lobe_pdf(below_pole, self.exponent)

    def _counts(self, to_light: Array3f) -> Bool | bool:
        if not self.features.interpolated_normals:
            return True
        return (dr.dot(self.normal, to_light) > 0) & (
            dr.dot(self.shading_normal, self.to_viewer) > 0
        )


def make_brdf(features: Features, hit: Hit, to_viewer: Array3f) -> Brdf:
    """The reflection at a hit; black where there is none."""
    return Brdf(features, hit.albedo, hit.exponent, hit.normal, hit.shading_normal, to_viewer)
