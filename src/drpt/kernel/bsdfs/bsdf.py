"""The BSDF of a surface point: the lobe of its kind, times its albedo."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import drjit as dr

from drpt.kernel.vec import frame

if TYPE_CHECKING:
    from collections.abc import Callable

    from drjit.auto import Array2f, Array3f, Bool, Float

    from drpt.kernel.bsdfs.base import Lobe, SurfacePoint


class BsdfSample(NamedTuple):
    """A direction to a light, its weight, eval / pdf, and its density per solid angle."""

    direction: Array3f
    weight: Array3f
    pdf: Float


class Bsdf(NamedTuple):
    """The reflection of one surface point towards one viewer.

    Both directions point away from the surface: ω_o to the viewer, ω_i to where the light comes
    from. ``eval`` includes the cosine; densities are per solid angle; weight 0 means that nothing
    was reflected.

    Attributes
    ----------
    lobes
        The kinds that the scene has; ``code`` tells which of them the point has.
    normal
        The geometric normal, where the scene has interpolated normals: then a direction counts
        only where both normals agree on its side.
    """

    lobes: tuple[Lobe, ...]
    albedo: Array3f
    code: Float
    point: SurfacePoint
    normal: Array3f | None

    def eval(self, to_light: Array3f) -> Array3f:
        """f(ω_o, ω_i) times the cosine at ω_i."""
        cosine = dr.dot(self.point.shading_normal, to_light)
        value = self._pick(lambda lobe: lobe.value(self.point, to_light))
        return self.albedo * dr.select((cosine > 0) & self._counts(to_light), value * cosine, 0)

    def pdf(self, to_light: Array3f) -> Float:
        """Solid angle: the density of :meth:`sample` at ω_i."""
        return self._pick(lambda lobe: lobe.pdf(self.point, to_light))

    def sample(self, u: Array2f) -> BsdfSample:
        """Solid angle: a direction ω_i; neither its weight nor its density takes a power."""
        local = self._pick(lambda lobe: lobe.sample(self.point, u))
        axis = self._pick(lambda lobe: lobe.axis(self.point))
        to_light = frame(axis).to_world(local)
        pdf = self._pick(lambda lobe: lobe.sample_pdf(self.point, u, local))
        return BsdfSample(to_light, self.weight(to_light), pdf)

    def weight(self, to_light: Array3f) -> Array3f:
        """Eval / pdf of a direction ω_i; neither is divided for."""
        cosine = dr.dot(self.point.shading_normal, to_light)
        share = self._pick(lambda lobe: lobe.weight(cosine))
        reflected = self._counts(to_light) & (cosine > 0)
        return self.albedo * dr.select(reflected, share, 0)

    @property
    def is_diffuse(self) -> Any:
        """Whether light is reflected into all directions alike."""
        return self._is([lobe.material.is_diffuse for lobe in self.lobes])

    @property
    def is_delta(self) -> Any:
        """Whether light is reflected into a single direction."""
        return self._is([lobe.delta for lobe in self.lobes])

    def _is(self, flags: list[bool]) -> Any:
        """Whether the flag of the point's kind is set."""
        if all(flags) or not any(flags):
            return all(flags)
        kinds = [lobe.material for lobe, flag in zip(self.lobes, flags, strict=True) if flag]
        found: Any = kinds[0].has(self.code)
        for kind in kinds[1:]:
            found |= kind.has(self.code)
        return found

    def _pick(self, ask: Callable[[Lobe], Any]) -> Any:
        """The answer of the point's kind; the kernel has no code for a kind that is missing."""
        answers = [ask(lobe) for lobe in self.lobes]
        found = answers[-1]
        for lobe, answer in reversed(list(zip(self.lobes[:-1], answers, strict=False))):
            found = dr.select(lobe.material.has(self.code), answer, found)
        return found

    def _counts(self, to_light: Array3f) -> Bool | bool:
        if self.normal is None:
            return True
        to_viewer = dr.dot(self.point.shading_normal, self.point.to_viewer) > 0
        return (dr.dot(self.normal, to_light) > 0) & to_viewer
