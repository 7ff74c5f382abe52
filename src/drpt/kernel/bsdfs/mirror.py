"""Perfectly specular reflection."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import drjit as dr

from drpt.kernel.vec import reflect, vec3
from drpt.scene import Mirror

if TYPE_CHECKING:
    from drjit.auto import Array2f, Array3f, Float

    from drpt.kernel.bsdfs.base import SurfacePoint
    from drpt.scene import Material


class MirrorLobe:
    """f cos θ = albedo δ(ω_i − ω_r), where ω_r is ω_o mirrored at the shading normal."""

    material: ClassVar[type[Material]] = Mirror
    delta: ClassVar[bool] = True

    def value(self, at: SurfacePoint, to_light: Array3f) -> float:
        """0: no other direction than that of the sample has a value."""
        return 0

    def pdf(self, at: SurfacePoint, to_light: Array3f) -> float:
        """0: no other direction than that of the sample has a density."""
        return 0

    def axis(self, at: SurfacePoint) -> Array3f:
        """The direction to the viewer, mirrored at the shading normal."""
        return reflect(at.to_viewer, at.shading_normal)

    def sample(self, at: SurfacePoint, u: Array2f) -> Array3f:
        """Discrete: the axis itself."""
        zero = type(u.x)(0)
        return vec3(zero, zero, zero + 1)

    def sample_pdf(self, at: SurfacePoint, u: Array2f, local: Array3f) -> Float:
        """Infinite: a probability in a single direction."""
        return type(u.x)(dr.inf)

    def weight(self, cosine: Float) -> float:
        """1: all of the light is in the sampled direction."""
        return 1
