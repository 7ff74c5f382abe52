"""What every kind of BSDF offers; a BSDF of a point is one of the kinds that a scene has.

Both directions point away from the surface: ω_o to the viewer, ω_i to where the light comes from.
A kind is a lobe of directions around an axis, without the albedo, which every surface has.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Protocol

if TYPE_CHECKING:
    from drjit.auto import Array2f, Array3f, Float

    from drpt.scene import Material


class SurfacePoint(NamedTuple):
    """What a lobe depends on.

    ``parameter`` is the number of the material besides its albedo, for kinds that have one.
    """

    parameter: Float
    shading_normal: Array3f
    to_viewer: Array3f


class Lobe(Protocol):
    """A kind of BSDF.

    ``material`` is its class in the scene. Nothing but its sample finds the direction of a
    ``delta`` lobe: its value is 0, and its density infinite.
    """

    material: ClassVar[type[Material]]
    delta: ClassVar[bool]

    def value(self, at: SurfacePoint, to_light: Array3f) -> Any:
        """f(ω_o, ω_i) / albedo, without the cosine."""
        ...

    def pdf(self, at: SurfacePoint, to_light: Array3f) -> Any:
        """Solid angle: the density of samples at ω_i."""
        ...

    def axis(self, at: SurfacePoint) -> Array3f:
        """The unit vector around which samples lie."""
        ...

    def sample(self, at: SurfacePoint, u: Array2f) -> Array3f:
        """Solid angle: a direction ω_i in a frame whose third vector is the axis."""
        ...

    def sample_pdf(self, at: SurfacePoint, u: Array2f, local: Array3f) -> Any:
        """Solid angle: the density of the sample that ``u`` gives; it takes no power."""
        ...

    def weight(self, cosine: Float) -> Any:
        """f(ω_o, ω_i) cos θ / (albedo pdf) of a direction, by its cosine; it takes no division."""
        ...
