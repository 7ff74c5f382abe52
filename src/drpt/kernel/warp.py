"""Warps of the unit square, each beside its density; the first line names the measure and domain.

``u`` is uniform in [0, 1)²; both of its ends give finite unit vectors.
"""

from __future__ import annotations

from math import factorial
from typing import TYPE_CHECKING

import drjit as dr

from drpt.kernel.vec import horner, sincos_2pi, vec2, vec3

if TYPE_CHECKING:
    from drjit.auto import Array2f, Array3f, Float

INV_PI = 0.3183098861837907
INV_TWO_PI = 0.15915494309189535
INV_FOUR_PI = 0.07957747154594767
TWO_PI = 6.283185307179586
FOUR_PI = 12.566370614359172


def _direction(cos_theta: Float, sin_theta: Float, u: Float) -> Array3f:
    """Unit vector at the polar angle θ from +z and the azimuth 2πu."""
    sin_phi, cos_phi = sincos_2pi(u)
    return vec3(sin_theta * cos_phi, sin_theta * sin_phi, cos_theta)


def square_to_sphere(u: Array2f) -> Array3f:
    """Solid angle, whole sphere: uniform."""
    cos_theta = dr.fma(-2, u.x, 1)
    sin_theta = 2 * dr.sqrt(u.x * (1 - u.x))
    return _direction(cos_theta, sin_theta, u.y)


def sphere_pdf() -> float:
    """Density of :func:`square_to_sphere`."""
    return INV_FOUR_PI


def square_to_cosine_hemisphere(u: Array2f) -> Array3f:
    """Solid angle, hemisphere around +z: proportional to cos θ (Malley's method)."""
    return _direction(dr.sqrt(1 - u.x), dr.sqrt(u.x), u.y)


def cosine_hemisphere_pdf(cos_theta: Float) -> Float:
    """Density of :func:`square_to_cosine_hemisphere`; 0 below the horizon."""
    return dr.maximum(cos_theta, 0) * INV_PI


def square_to_cone(u: Array2f, height: Float) -> Array3f:
    """Solid angle, cone around +z: uniform.

    The cone is given by the height of its spherical cap, h = 1 − cos θ_max, which stays exact
    where cos θ_max rounds to 1.
    """
    below_pole = height * u.x
    return _direction(1 - below_pole, dr.sqrt(below_pole * (2 - below_pole)), u.y)


def cone_pdf(height: Float) -> Float:
    """Density of :func:`square_to_cone` inside the cone."""
    return INV_TWO_PI * dr.rcp(height)


def square_to_projected_cap(
    u: Array2f, sine: Float, height: Float, normal: Array3f
) -> tuple[Array3f, Float]:
    """Projected solid angle, spherical cap around +z above the horizon of ``normal``: uniform.

    Also the cosine at the normal. The cap is given by the sine of its half-angle σ and its height,
    1 − cos σ. Points uniform on the flat disc that closes it, cos σ above the centre, are moved
    along the normal up to the sphere. That keeps their projection, which maps the disc linearly;
    it adds |q|² + 2 λ q·n + λ² = 1, where |q|² = 1 − sin²σ (1 − u) on the disc, nothing cancels.
    """
    sin_phi, cos_phi = sincos_2pi(u.y)
    radius = sine * dr.sqrt(u.x)
    disc = vec3(radius * cos_phi, radius * sin_phi, 1 - height)
    below = dr.dot(disc, normal)
    missing = sine * sine * (1 - u.x)
    cosine = dr.sqrt(dr.fma(below, below, missing))
    return dr.fma(normal, missing / (below + cosine), disc), cosine


def square_to_phong_lobe(u: Array2f, exponent: Float) -> Array3f:
    """Solid angle, hemisphere around +z: proportional to cos^α θ.

    cos θ = (1 − u)^{1/(α+1)}; 1 − cos θ is taken from expm1, since the power itself rounds to 1
    where α is large.
    """
    below_pole = -expm1(dr.log(1 - u.x) / (exponent + 1))
    return _direction(1 - below_pole, dr.sqrt(below_pole * (2 - below_pole)), u.y)


def phong_lobe_pdf(below_pole: Float, exponent: Float) -> Float:
    """Density of :func:`square_to_phong_lobe` where 1 − cos θ = ``below_pole``; 0 from 1 on."""
    return (exponent + 1) * INV_TWO_PI * power_near_pole(below_pole, exponent)


def phong_lobe_sample_pdf(u: Array2f, cos_theta: Float, exponent: Float) -> Float:
    """Density where :func:`square_to_phong_lobe` maps ``u`` to, as cos^(α+1) θ = 1 − u."""
    return (exponent + 1) * INV_TWO_PI * (1 - u.x) / cos_theta


def power_near_pole(below_pole: Float, exponent: Float) -> Float:
    """cos^α θ from 1 − cos θ, exact where cos θ rounds to 1; 0 where cos θ < 0, also for α = 0."""
    above_plane = below_pole < 1
    return dr.select(above_plane, dr.exp(exponent * log1p(-below_pole)), 0)


def expm1(x: Float) -> Float:
    """exp(x) − 1 for x ≤ 0, without cancellation: its Taylor series where x > −1/2."""
    series = x * horner(x, *(1 / factorial(k) for k in range(1, 9)))
    return dr.select(x > -0.5, series, dr.exp(x) - 1)


def log1p(x: Float) -> Float:
    """ln(1 + x) for x in (−1, 0], without cancellation.

    Where x > −1/4 from ln(1 + x) = 2 artanh z, z = x / (2 + x), and its series in z² < 1/49;
    elsewhere the rounding of 1 + x does no harm.
    """
    z = x / (2 + x)
    series = 2 * z * horner(z * z, *(1 / k for k in range(1, 11, 2)))
    return dr.select(x > -0.25, series, dr.log(1 + x))


def square_to_triangle(u: Array2f) -> Array2f:
    """Area, triangle: uniform; gives the barycentric coordinates of the second and third vertex.

    Source: Heitz 2019, "A Low-Distortion Map Between Triangle and Square".
    """
    low = dr.minimum(u.x, u.y) / 2
    return vec2(dr.select(u.x < u.y, low, u.x - low), dr.select(u.x < u.y, u.y - low, low))
