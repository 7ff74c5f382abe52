"""drpt's Phong surface as a plugin of Mitsuba, which has none: the type ``drpt_phong``.

Its formulas stand here once more, for a check that shared drpt's own could not find their errors.
"""

from __future__ import annotations

from typing import Any

NAME = "drpt_phong"


def register_phong() -> None:
    """Register the plugin in the variant of Mitsuba that is set."""
    import drjit as dr
    import mitsuba as mi

    class Phong(mi.BSDF):
        """f = ρ (α+1)/(2π) max(0, ω_r·ω_i)^α around ω_r, ω_o mirrored at the shading normal.

        One-sided, as Mitsuba's own surfaces are: ``twosided`` makes it reflect on both. The lobe
        is not renormalised at the horizon. Mitsuba calls ω_o ``si.wi``, and ω_i ``wo``.

        Parameters: ``reflectance`` ρ, a colour; ``exponent`` α ≥ 0.
        """

        def __init__(self, props: Any) -> None:
            super().__init__(props)
            self.reflectance = mi.Color3f(props["reflectance"])
            self.exponent = mi.Float(props["exponent"])
            dr.make_opaque(self.reflectance, self.exponent)
            self.m_components = [mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide]
            self.m_flags = self.m_components[0]

        def sample(
            self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True
        ) -> tuple[Any, Any]:
            lobe = mi.Frame3f(mi.reflect(si.wi))
            bs: Any = dr.zeros(mi.BSDFSample3f, dr.width(sample2))
            bs.wo = lobe.to_world(square_to_lobe(sample2, self.exponent))
            bs.pdf = self.pdf(ctx, si, bs.wo, active)
            bs.eta = 1
            bs.sampled_type = +mi.BSDFFlags.GlossyReflection
            bs.sampled_component = 0
            weight = self.reflectance * mi.Frame3f.cos_theta(bs.wo)
            return bs, dr.select(bs.pdf > 0, weight, 0)

        def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return self.reflectance * mi.Frame3f.cos_theta(wo) * self.pdf(ctx, si, wo, active)

        def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            front = (mi.Frame3f.cos_theta(si.wi) > 0) & (mi.Frame3f.cos_theta(wo) > 0)
            density = lobe_pdf(mi.reflect(si.wi), wo, self.exponent)
            return dr.select(active & front, density, 0)

        def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> tuple[Any, Any]:
            return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)

        def traverse(self, callback: Any) -> None:
            callback.put("reflectance", self.reflectance, mi.ParamFlags.Differentiable)
            callback.put("exponent", self.exponent, mi.ParamFlags.Differentiable)

        def to_string(self) -> str:
            return f"Phong[reflectance={self.reflectance}, exponent={self.exponent}]"

    mi.register_bsdf(NAME, Phong)


def square_to_lobe(u: Any, exponent: Any) -> Any:
    """Solid angle, hemisphere around +z: proportional to cos^α θ.

    cos θ = u^{1/(α+1)} = e^x; where it rounds to 1, 1 − cos θ = −2 e^{x/2} sinh(x/2) does not.
    """
    import drjit as dr
    import mitsuba as mi

    x = dr.log(1 - u.x) / (exponent + 1)
    below_pole = -2 * dr.exp(x / 2) * dr.sinh(x / 2)
    sin_theta = dr.safe_sqrt(below_pole * (2 - below_pole))
    sin_phi, cos_phi = dr.sincos(2 * dr.pi * u.y)
    return mi.Vector3f(sin_theta * cos_phi, sin_theta * sin_phi, 1 - below_pole)


def lobe_pdf(axis: Any, direction: Any, exponent: Any) -> Any:
    """Solid angle: density of the lobe around an axis, (α+1)/(2π) cos^α γ; 0 from 90° on.

    With q = 1 − cos γ = |axis − direction|²/2, exact where cos γ rounds to 1, and
    ln(1 − q) = −2 artanh(q / (2 − q)).
    """
    import drjit as dr

    q = dr.squared_norm(axis - direction) / 2
    power = dr.exp(-2 * exponent * dr.atanh(q / (2 - q)))
    return dr.select(q < 1, (exponent + 1) / (2 * dr.pi) * power, 0)
