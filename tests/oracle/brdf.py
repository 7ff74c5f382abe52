"""Diffuse and Phong reflection: value times cosine, sampling and its density, over n directions.

All directions point away from the surface. f is per steradian; densities are per steradian.
"""

import numpy as np

from drpt.scene import Diffuse, Material, Mirror, Phong
from tests.oracle.arrays import Bools, Floats, basis, dot, normalize, sample_uniform_sphere


def turn_to_viewer(
    geometric_normal: Floats, shading_normal: Floats, wo: Floats
) -> tuple[Floats, Floats]:
    """Return both normals (n, 3) on the viewer's side: surfaces reflect on both.

    The shading normal joins the geometric normal's hemisphere, and then both are flipped so that
    the geometric normal faces ω_o.
    """
    to_geometric = np.where(dot(shading_normal, geometric_normal) < 0, -1.0, 1.0)
    to_viewer = np.where(dot(geometric_normal, wo) < 0, -1.0, 1.0)
    return (
        geometric_normal * to_viewer[:, None],
        shading_normal * (to_geometric * to_viewer)[:, None],
    )


def evaluate(
    material: Material,
    geometric_normal: Floats,
    shading_normal: Floats,
    wo: Floats,
    wi: Floats,
) -> Floats:
    """Return f(ω_o, ω_i) n·ω_i (n, 3), n the shading normal; zero for directions that do not count.

    Diffuse: f = ρ/π. Phong: f = ρ (α+1)/(2π) max(0, ω_r·ω_i)^α. Mirror: 0; see `mirrored`.
    """
    ng, ns = turn_to_viewer(geometric_normal, shading_normal, wo)
    if isinstance(material, Mirror):
        value = np.zeros(len(wi))
    elif isinstance(material, Diffuse):
        value = np.full(len(wi), 1 / np.pi)
    else:
        assert isinstance(material, Phong)
        value = _lobe(material.exponent, dot(_mirror(ns, wo), wi))
    cosine = np.where(_counts(ng, ns, wo, wi), dot(ns, wi), 0.0)
    return (value * cosine)[:, None] * np.asarray(material.albedo, np.float64)


def density(
    material: Material,
    geometric_normal: Floats,
    shading_normal: Floats,
    wo: Floats,
    wi: Floats,
) -> Floats:
    """Return the density (n,) of `sample`: n·ω_i/π, or the whole Phong lobe, where ω_i counts.

    Its integral is below 1 by the share of samples that do not count.
    """
    ng, ns = turn_to_viewer(geometric_normal, shading_normal, wo)
    if isinstance(material, Diffuse):
        value = dot(ns, wi) / np.pi
    else:
        assert isinstance(material, Phong)
        value = _lobe(material.exponent, dot(_mirror(ns, wo), wi))
    return np.where(_counts(ng, ns, wo, wi), value, 0.0)


def sample(
    material: Material,
    geometric_normal: Floats,
    shading_normal: Floats,
    wo: Floats,
    rng: np.random.Generator,
) -> Floats:
    """Draw ω_i (n, 3): cosine-weighted around the normal, or from the lobe around ω_r.

    A point on the unit sphere that rests on the surface is cosine-distributed seen from there.
    In the lobe, the cumulative distribution of cos γ is cos^{α+1} γ.
    """
    _, ns = turn_to_viewer(geometric_normal, shading_normal, wo)
    if isinstance(material, Diffuse):
        return normalize(ns + sample_uniform_sphere(rng, len(wo)))
    assert isinstance(material, Phong)
    log_cos = np.log1p(-rng.random(len(wo))) / (material.exponent + 1)
    cos_gamma, sin_gamma = np.exp(log_cos), np.sqrt(-np.expm1(2 * log_cos))
    phi = 2 * np.pi * rng.random(len(wo))
    local = np.stack([sin_gamma * np.cos(phi), sin_gamma * np.sin(phi), cos_gamma], axis=1)
    return np.asarray(np.einsum("nk,nkc->nc", local, basis(_mirror(ns, wo))))


def mirrored(
    material: Mirror, geometric_normal: Floats, shading_normal: Floats, wo: Floats
) -> tuple[Floats, Floats]:
    """Return the only direction ω_i (n, 3) into which a mirror reflects, and its share (n, 3)."""
    ng, ns = turn_to_viewer(geometric_normal, shading_normal, wo)
    wi = _mirror(ns, wo)
    counts = _counts(ng, ns, wo, wi).astype(np.float64)
    return wi, counts[:, None] * np.asarray(material.albedo, np.float64)


def _lobe(exponent: float, cos_gamma: Floats) -> Floats:
    """Return (α+1)/(2π) cos^α γ, zero from γ = 90° on (for α = 0 as well)."""
    power = np.where(cos_gamma > 0, np.maximum(cos_gamma, 0.0) ** exponent, 0.0)
    return (exponent + 1) / (2 * np.pi) * power


def _mirror(normal: Floats, wo: Floats) -> Floats:
    """Return ω_r, the view direction mirrored at the normal."""
    return 2 * dot(normal, wo)[:, None] * normal - wo


def _counts(ng: Floats, ns: Floats, wo: Floats, wi: Floats) -> Bools:
    """Return whether both directions are on the positive side of both normals."""
    return (dot(ng, wi) > 0) & (dot(ns, wi) > 0) & (dot(ng, wo) > 0) & (dot(ns, wo) > 0)
