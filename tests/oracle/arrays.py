"""Array types and vector algebra shared by the oracle's modules."""

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

Floats: TypeAlias = npt.NDArray[np.float64]
Ints: TypeAlias = npt.NDArray[np.int64]
Bools: TypeAlias = npt.NDArray[np.bool_]


def dot(a: Floats, b: Floats) -> Floats:
    """Return the scalar products (...,) of vectors (..., 3)."""
    return np.asarray(np.sum(a * b, axis=-1))


def normalize(v: Floats) -> Floats:
    """Return vectors (..., 3) scaled to unit length."""
    unit: Floats = v / np.linalg.norm(v, axis=-1, keepdims=True)
    return unit


def basis(axis: Floats) -> Floats:
    """Return right-handed orthonormal bases (n, 3, 3); the last row of each is `axis` (n, 3)."""
    helper = np.where(np.abs(axis[:, :1]) < 0.5, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    s = normalize(np.cross(helper, axis))
    return np.stack([s, np.cross(axis, s), axis], axis=1)


def sample_uniform_sphere(rng: np.random.Generator, n: int) -> Floats:
    """Draw n unit vectors (n, 3), uniform in solid angle: density 1/(4π)."""
    return normalize(rng.standard_normal((n, 3)))
