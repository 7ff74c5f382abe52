"""Statistical gates: each says how small a bias it detects, and can therefore fail.

`significance` is the probability that a gate fails although nothing is wrong, over all the values
that it compares (Šidák 1967).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import stats

from tests.oracle.arrays import Floats

ROUNDING = 1e-6  # relative difference that float32 arithmetic is allowed, apart from the noise
QUADRATURE_NODES = 8  # Gauss-Legendre, per axis and cell


@dataclass(frozen=True)
class ChiSquare:
    """Result of a chi² test: `p_value` is small where the samples do not follow the density."""

    statistic: float
    degrees_of_freedom: int
    p_value: float


def sidak(significance: float, comparisons: int) -> float:
    """Return the significance of each of n independent comparisons: 1 - (1 - α)^(1/n)."""
    return float(-np.expm1(np.log1p(-significance) / comparisons))


def z_test_mean(mean: npt.ArrayLike, standard_error: npt.ArrayLike, truth: npt.ArrayLike) -> Floats:
    """Return the two-sided p-value of each mean; `ROUNDING` of the truth is no difference."""
    mean, standard_error, truth = (
        np.asarray(values, np.float64) for values in (mean, standard_error, truth)
    )
    difference = np.maximum(np.abs(mean - truth) - ROUNDING * np.abs(truth), 0.0)
    tiny = np.finfo(np.float64).tiny
    p_value = 2 * stats.norm.sf(difference / np.maximum(standard_error, tiny))
    return np.where(np.isfinite(mean), p_value, 0.0)


def assert_means_agree(
    mean_a: npt.ArrayLike,
    se_a: npt.ArrayLike,
    mean_b: npt.ArrayLike,
    se_b: npt.ArrayLike,
    significance: float,
) -> None:
    """Assert that two arrays of means have the same expectation, value by value.

    A truth without noise has standard error 0. To detect a bias that all pixels share, compare
    `mean_of_independent` of the images instead of the images.
    """
    standard_error = np.hypot(se_a, se_b)
    p_value = np.atleast_1d(z_test_mean(mean_a, standard_error, mean_b))
    worst = np.unravel_index(p_value.argmin(), p_value.shape)
    a, b, se = (
        float(np.broadcast_to(values, p_value.shape)[worst])
        for values in (mean_a, mean_b, standard_error)
    )
    least = smallest_detectable(se, significance, p_value.size)
    assert p_value[worst] >= sidak(significance, p_value.size), (
        f"means differ at {tuple(map(int, worst))}: {a:.9g} and {b:.9g}, a difference of "
        f"{a - b:.3g} = {(a - b) / se if se else np.inf:.2f} standard errors "
        f"(p = {p_value[worst]:.2g}; the gate detects {float(least):.2g})"
    )


def smallest_detectable(
    standard_error: npt.ArrayLike,
    significance: float,
    comparisons: int = 1,
    power: float = 0.95,
) -> Floats:
    """Return the bias that the gate detects with probability `power`, in the mean's units."""
    threshold = float(stats.norm.isf(sidak(significance, comparisons) / 2))
    return np.asarray(standard_error, np.float64) * (threshold + float(stats.norm.isf(1 - power)))


def mean_of_independent(mean: Floats, standard_error: Floats) -> tuple[Floats, Floats]:
    """Return the mean (3,) of an image (height, width, 3) and its standard error.

    Its pixels must be independent, as pseudo-random ones are.
    """
    pixels = mean.shape[0] * mean.shape[1]
    return mean.mean(axis=(0, 1)), np.sqrt((standard_error**2).sum(axis=(0, 1))) / pixels


def chi2_test(
    directions: Floats,
    drawn: int,
    pdf: Callable[[Floats], Floats],
    cos_edges: Floats,
    phi_edges: Floats,
    *,
    min_expected: float = 5.0,
) -> ChiSquare:
    """Test directions against a density over the cells of (cos θ, φ), θ from +z, φ in [0, 2π].

    A density that is wrong by the relative ripple b raises the statistic by about drawn b², which
    shows once it exceeds five of its standard deviations, 5 √(2 cells).

    Parameters
    ----------
    directions
        The (m, 3) unit vectors that were accepted, of `drawn` samples in all. The samples lost,
        and those outside the edges, make one more cell.
    pdf
        Density per steradian of directions (n, 3), integrated over each cell: its
        discontinuities had best lie on edges, and its features span several cells.
    cos_edges, phi_edges
        Increasing edges of the cells; they need not cover the sphere.
    min_expected
        Cells that expect fewer samples are pooled.
    """
    cos_theta = np.clip(directions[:, 2], -1.0, 1.0)
    phi = np.arctan2(directions[:, 1], directions[:, 0]) % (2 * np.pi)
    counts = np.histogram2d(cos_theta, phi, (cos_edges, phi_edges))[0].ravel()
    expected = drawn * probability_per_cell(pdf, cos_edges, phi_edges).ravel()
    counts = np.append(counts, drawn - counts.sum())
    expected = np.append(expected, max(drawn - expected.sum(), 0.0))
    return chi2_of_counts(counts, expected, min_expected)


def probability_per_cell(
    pdf: Callable[[Floats], Floats], cos_edges: Floats, phi_edges: Floats
) -> Floats:
    """Return the integral (n_cos, n_phi) of a density over each cell, by Gauss-Legendre."""
    cos_theta, cos_weight = _gauss_legendre(cos_edges)
    phi, phi_weight = _gauss_legendre(phi_edges)
    cos_theta, phi = np.broadcast_arrays(cos_theta[:, :, None, None], phi)
    sin_theta = np.sqrt(1 - cos_theta**2)
    directions = np.stack([sin_theta * np.cos(phi), sin_theta * np.sin(phi), cos_theta], axis=-1)
    values = pdf(directions.reshape(-1, 3)).reshape(phi.shape)
    return np.asarray(np.einsum("iajb,ia,jb->ij", values, cos_weight, phi_weight))


def chi2_of_counts(counts: Floats, expected: Floats, min_expected: float = 5.0) -> ChiSquare:
    """Return Pearson's chi² test of counts (n,), cells with small expectations pooled."""
    if expected.sum() < 2 * min_expected:
        raise ValueError(f"{expected.sum():.3g} samples are too few for a chi² test")
    order = np.argsort(expected)
    counts, expected = counts[order], expected[order]
    pooled = int(np.searchsorted(np.cumsum(expected), min_expected)) + 1
    pooled = max(pooled, int(np.searchsorted(expected, min_expected)))
    counts = np.append(counts[:pooled].sum(), counts[pooled:])
    expected = np.append(expected[:pooled].sum(), expected[pooled:])
    statistic = float(((counts - expected) ** 2 / expected).sum())
    freedom = len(counts) - 1
    return ChiSquare(statistic, freedom, float(stats.chi2.sf(statistic, freedom)))


def _gauss_legendre(edges: Floats) -> tuple[Floats, Floats]:
    """Return nodes and weights (n, QUADRATURE_NODES) on each of n intervals."""
    nodes, weights = np.polynomial.legendre.leggauss(QUADRATURE_NODES)
    half = np.diff(edges)[:, None] / 2
    return edges[:-1, None] + half * (1 + nodes), half * weights
