"""Directions around +z in polar coordinates that resolve the narrowest lobe.

There 1 - cos θ is known to float32's relative precision, while cos θ itself rounds to 1.
"""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from tests.oracle.arrays import Floats
from tests.oracle.statistics import chi2_of_counts

Density: TypeAlias = Callable[[Floats, Floats], Floats]  # of (1 - cos θ, φ), per steradian

CELLS = 101  # a side
QUADRATURE_NODES = 4  # Gauss-Legendre, per axis and cell: densities hardly bend in one


def below_pole(w: Floats) -> Floats:
    """Return 1 - cos θ (n,) of unit vectors (n, 3)."""
    sin2 = np.minimum(w[:, 0] ** 2 + w[:, 1] ** 2, 1.0)
    return np.where(w[:, 2] < 0.5, 1 - w[:, 2], sin2 / (1 + np.sqrt(1 - sin2)))


def directions(below: Floats, phi: Floats) -> Floats:
    """Return unit vectors (n, 3) from 1 - cos θ and φ (n,)."""
    sin_theta = np.sqrt(below * (2 - below))
    return np.stack([sin_theta * np.cos(phi), sin_theta * np.sin(phi), 1 - below], axis=1)


def lobe_edges(exponent: float) -> Floats:
    """Return edges of cells in 1 - cos θ from 0 to 1: even on a log scale around the axis."""
    edges = np.geomspace(1e-3, 60, CELLS) / (exponent + 1)
    return np.array([0, *edges[edges < 1], 1])


def integral(pdf: Density, edges: Floats) -> float:
    """Return the integral of a density over the cap within the last edge."""
    return float(_probability(pdf, edges, np.linspace(0, 2 * np.pi, 9)).sum())


def p_value(w: Floats, pdf: Density, edges: Floats) -> float:
    """Return the least p-value of chi² tests over (1 - cos θ, φ) and over each of them alone.

    Directions beyond the last edge make one more cell. The test of 1 - cos θ alone detects a
    density that ripples by 1 % with 1e6 directions, that of all cells 3 %.
    """
    counts = _count(w, edges)
    expected = len(w) * _probability(pdf, edges, np.linspace(0, 2 * np.pi, CELLS + 1))
    beyond = len(w) - counts.sum(), max(len(w) - expected.sum(), 0.0)
    tests = (
        chi2_of_counts(np.append(c, beyond[0]), np.append(e, beyond[1]))
        for c, e in (
            (counts.ravel(), expected.ravel()),
            (counts.sum(axis=0), expected.sum(axis=0)),
            (counts.sum(axis=1), expected.sum(axis=1)),
        )
    )
    return min(test.p_value for test in tests)


def _count(w: Floats, edges: Floats) -> Floats:
    """Return how many directions are in each cell (n, CELLS)."""
    row = np.searchsorted(edges, below_pole(w), side="right") - 1
    column = np.arctan2(w[:, 1], w[:, 0]) % (2 * np.pi) * (CELLS / (2 * np.pi))
    cell = CELLS * row + np.minimum(column.astype(int), CELLS - 1)
    counts = np.bincount(cell, minlength=CELLS * len(edges)).astype(np.float64)
    return counts.reshape(-1, CELLS)[: len(edges) - 1]


def _probability(pdf: Density, edges: Floats, phi_edges: Floats) -> Floats:
    """Return the integral of a density over each cell, by Gauss-Legendre."""
    nodes, weights = np.polynomial.legendre.leggauss(QUADRATURE_NODES)
    half, half_phi = np.diff(edges)[:, None] / 2, np.diff(phi_edges)[:, None] / 2
    below = edges[:-1, None] + half * (1 + nodes)
    phi = phi_edges[:-1, None] + half_phi * (1 + nodes)
    grid = np.broadcast_arrays(below[:, :, None, None], phi)
    values = pdf(grid[0].ravel(), grid[1].ravel()).reshape(grid[0].shape)
    return np.asarray(np.einsum("iajb,ia,jb->ij", values, half * weights, half_phi * weights))
