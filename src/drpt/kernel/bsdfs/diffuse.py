"""Lambertian reflection."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import drjit as dr

from drpt.kernel.warp import INV_PI, cosine_hemisphere_pdf, square_to_cosine_hemisphere
from drpt.scene import Diffuse

if TYPE_CHECKING:
    from drjit.auto import Array2f, Array3f, Float

    from drpt.kernel.bsdfs.base import SurfacePoint
    from drpt.scene import Material


class DiffuseLobe:
    """f = albedo / π, sampled by the cosine around the shading normal."""

    material: ClassVar[type[Material]] = Diffuse
    delta: ClassVar[bool] = False

    def value(self, at: SurfacePoint, to_light: Array3f) -> float:
        """1 / π: f / albedo."""
        return INV_PI

    def pdf(self, at: SurfacePoint, to_light: Array3f) -> Float:
        """Solid angle: cos θ / π."""
        return cosine_hemisphere_pdf(dr.dot(at.shading_normal, to_light))

    def axis(self, at: SurfacePoint) -> Array3f:
        """The shading normal."""
        return at.shading_normal

    def sample(self, at: SurfacePoint, u: Array2f) -> Array3f:
        """Solid angle: directions in proportion to their cosine."""
        return square_to_cosine_hemisphere(u)

    def sample_pdf(self, at: SurfacePoint, u: Array2f, local: Array3f) -> Float:
        """Solid angle: cos θ / π of a sample."""
        return cosine_hemisphere_pdf(local.z)

    def weight(self, cosine: Float) -> float:
        """1: the density is f cos θ / albedo."""
        return 1
