"""Scenes whose radiance is known in closed form, each with its derivation.

Angles are in radians; an irradiance is in units of the light's radiance times steradian.
"""

import math

from scipy.integrate import quad


def furnace_radiance(
    albedo: float, radiance: float, light_radius: float, radius: float, bounces: int
) -> float:
    """Return the wall's radiance in a closed diffuse sphere around a concentric light.

    Seen from any wall point the light is a cap around the normal with sin σ = r/R, so it fills
    the fraction s = ∫_cap cos dω / π = sin²σ = (r/R)² of the cosine-weighted hemisphere; the wall
    fills the rest, since the sphere is closed. By symmetry the wall's radiance after k bounces
    is the same everywhere: W_0 = 0, W_k = ρ (s L + (1 - s) W_{k-1}).
    """
    s = (light_radius / radius) ** 2
    wall = 0.0
    for _ in range(bounces):
        wall = albedo * (s * radiance + (1 - s) * wall)
    return wall


def sphere_light_irradiance(radiance: float, sigma: float, omega: float) -> float:
    """Return the irradiance of a plane by a sphere light of half-angle σ, its centre at ω.

    E/L is the area of the light's visible cap projected onto the plane (Nusselt). With the
    centre at (sin ω, 0, cos ω), the cap's rim projects to
    (cos σ sin ω - sin σ cos ω cos t, sin σ sin t) and lies above the horizon for |t| < t0,
    where cos t0 = -cot σ cot ω (clamped: t0 = π wholly above, 0 wholly below).
    Green's theorem, ½ ∮ x dy - y dx, gives for that arc, run so that the area is on its left,
    sin²σ cos ω t0 - sin σ cos σ sin ω sin t0. The unit circle closes the contour between the
    azimuths ±φ0 where the rim crosses the horizon and adds φ0; there
    sin φ0 = sin σ sin t0 and cos φ0 = cos σ / sin ω. σ < π/2 (the receiver is outside the light).
    With y = tan φ0 = tan σ sin t0 sin ω the sum is sin²σ (cos ω t0 + y) + (atan y - y), where
    nothing cancels: small lights keep their digits.
    """
    cos_t0 = -math.cos(omega) * math.cos(sigma) / max(math.sin(omega) * math.sin(sigma), 1e-300)
    t0 = math.acos(min(max(cos_t0, -1.0), 1.0))
    sin_t0 = math.sin(t0) if 0 < t0 < math.pi else 0.0
    y = math.tan(sigma) * sin_t0 * math.sin(omega)
    return radiance * (math.sin(sigma) ** 2 * (math.cos(omega) * t0 + y) + _atan_minus(y))


def _atan_minus(y: float) -> float:
    """Return atan y - y; from its series where the difference would cancel."""
    if y > 0.1:
        return math.atan(y) - y
    return math.fsum((-1) ** k * y ** (2 * k + 1) / (2 * k + 1) for k in range(1, 9))


def sphere_light_flux_through_rectangle(
    radiance: float, radius: float, height: float, half_a: float, half_b: float
) -> float:
    """Return the flux onto a 2a x 2b rectangle from a sphere light centred above its middle.

    With the light wholly above the plane (h >= r), E = π L (r/d)² cos ω at each point: π L r²
    times dA cos ω / d², the solid angle that the point's surroundings fill seen from the light's
    centre. Their sum is the rectangle's solid angle, 4 atan(ab / (h √(a² + b² + h²))).
    """
    diagonal = math.sqrt(half_a**2 + half_b**2 + height**2)
    solid_angle = 4 * math.atan2(half_a * half_b, height * diagonal)
    return math.pi * radiance * radius**2 * solid_angle


def phong_mirrored_light(
    albedo: float, exponent: float, radiance: float, sigma: float, theta: float
) -> float:
    """Return the radiance that Phong reflects at tilt θ of a light around the mirror direction.

    In polar coordinates (γ, φ) around the mirror direction,
    n·ω_i = cos θ cos γ + sin θ sin γ cos φ; the second term vanishes over φ while the whole
    cap γ <= σ is above the horizon (θ + σ <= π/2). What is left is
    ρ L (α+1)/(2π) cos θ · 2π ∫_0^σ cos^{α+1}γ sin γ dγ.
    """
    lobe = -math.expm1((exponent + 2) * math.log(math.cos(sigma)))
    return albedo * radiance * math.cos(theta) * (exponent + 1) / (exponent + 2) * lobe


def phong_directional_albedo(albedo: float, exponent: float, theta: float) -> float:
    """Return ∫ f cos dω_i of a Phong surface viewed at tilt θ, to about 1e-10.

    The cap γ <= π/2 - θ of the lobe is whole and known (`phong_mirrored_light` with L = 1).
    Beyond it, only |φ| < t0 is above the horizon, cos t0 = -cot γ cot θ, and
    H(γ) = ∫ n·ω_i dφ = 2 (cos θ cos γ t0 + sin θ sin γ sin t0). The rest,
    ρ (α+1)/(2π) ∫ cos^α γ sin γ H dγ, is done numerically after the substitution
    cos γ = sin θ e^{-v/(α+1)}, which turns (α+1) cos^α γ sin γ dγ into sin^{α+1}θ e^{-v} dv.
    At θ = 0 nothing is beyond: ρ (α+1)/(α+2).
    """
    if theta == 0:
        return albedo * (exponent + 1) / (exponent + 2)
    sin_theta, cos_theta = math.sin(theta), math.cos(theta)

    def beyond(v: float) -> float:
        cos_gamma = sin_theta * math.exp(-v / (exponent + 1))
        sin_gamma = math.sqrt(1 - cos_gamma**2)
        t0 = math.acos(max(-1.0, -cos_gamma * cos_theta / (sin_gamma * sin_theta)))
        h = 2 * (cos_theta * cos_gamma * t0 + sin_theta * sin_gamma * math.sin(t0))
        return math.exp(-v) * h

    integral = float(quad(beyond, 0, math.inf, epsabs=1e-12, epsrel=1e-11, limit=400)[0])
    rest = albedo * math.pow(sin_theta, exponent + 1) / (2 * math.pi) * integral
    return phong_mirrored_light(albedo, exponent, 1.0, math.pi / 2 - theta, theta) + rest
