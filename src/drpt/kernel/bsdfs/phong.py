"""Phong reflection: a lobe around the mirror direction.

f = albedo (α + 1) / (2π) max(0, ω_r·ω_i)^α, where ω_r is ω_o mirrored at the shading normal
(Lafortune & Willems 1994). The lobe is not renormalised at the horizon: its part below is lost.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import drjit as dr

from drpt.kernel.vec import reflect
from drpt.kernel.warp import phong_lobe_pdf, phong_lobe_sample_pdf, square_to_phong_lobe
from drpt.scene import Phong

if TYPE_CHECKING:
    from drjit.auto import Array2f, Array3f, Float

    from drpt.kernel.bsdfs.base import SurfacePoint
    from drpt.scene import Material


class PhongLobe:
    """Its density is f / albedo, so that only the cosine is left in its weight."""

    material: ClassVar[type[Material]] = Phong
    delta: ClassVar[bool] = False

    def value(self, at: SurfacePoint, to_light: Array3f) -> Float:
        """F / albedo: the density of the lobe."""
        return self.pdf(at, to_light)

    def pdf(self, at: SurfacePoint, to_light: Array3f) -> Float:
        """Density of the whole lobe; 1 − cos of the angle off its axis is |ω_r − ω_i|² / 2."""
        below_pole = dr.squared_norm(self.axis(at) - to_light) / 2
        return phong_lobe_pdf(below_pole, at.parameter)

    def axis(self, at: SurfacePoint) -> Array3f:
        """The direction to the viewer, mirrored at the shading normal."""
        return reflect(at.to_viewer, at.shading_normal)

    def sample(self, at: SurfacePoint, u: Array2f) -> Array3f:
        """Solid angle: directions in proportion to the power of the cosine off the axis."""
        return square_to_phong_lobe(u, at.parameter)

    def sample_pdf(self, at: SurfacePoint, u: Array2f, local: Array3f) -> Float:
        """Solid angle: the density of a sample, without its power."""
        return phong_lobe_sample_pdf(u, local.z, at.parameter)

    def weight(self, cosine: Float) -> Float:
        """The cosine: the density is f / albedo."""
        return cosine
