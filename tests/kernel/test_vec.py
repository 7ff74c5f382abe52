import numpy as np
import pytest

from drpt.kernel.vec import frame, horner, reflect, sincos_2pi, vec2, vec3
from tests.conftest import to_device, to_host
from tests.oracle.arrays import Floats, dot, sample_uniform_sphere

ROUNDINGS = 4e-7  # of sums and products of numbers up to 1, some half ulps of 6e-8 each
SINCOS = 1e-7  # what sincos_2pi promises


def normals() -> Floats:
    """Return unit vectors all over the sphere, on its equator, at its poles and close to them."""
    special = np.array(
        [(0, 0, 1), (0, 0, -1), (1, 0, 0.0), (1, 0, -0.0), (0, -1, 0.0), (0, -1, -0.0)], float
    )
    tilt = np.logspace(-10, 0, 400)
    azimuth = 2.4 * np.arange(400)
    near = [tilt * np.cos(azimuth), tilt * np.sin(azimuth), np.sqrt(1 - tilt**2)]
    north, south = np.stack(near, axis=1), np.stack([*near[:2], -near[2]], axis=1)
    around = sample_uniform_sphere(np.random.default_rng(1), 100_000)
    return np.concatenate([special, north, south, around]).astype(np.float32).astype(np.float64)


def test_frames_are_orthonormal_and_right_handed() -> None:
    n = normals()
    s, t, axis = (to_host(v) for v in frame(to_device(n)))
    np.testing.assert_array_equal(axis, n)
    for a, b, expected in ((s, s, 1), (t, t, 1), (s, t, 0), (s, n, 0), (t, n, 0)):
        np.testing.assert_allclose(dot(a, b), expected, rtol=0, atol=ROUNDINGS)
    np.testing.assert_allclose(np.cross(s, t), n, rtol=0, atol=ROUNDINGS)


@pytest.mark.parametrize("pole", [1, -1])
def test_frames_are_continuous_at_the_poles(pole: int) -> None:
    tilts = np.array([(0, 0), (1e-6, -1e-6), (-1e-6, 0), (0, 1e-5)])
    for axis in frame(to_device(np.column_stack([tilts, np.full(4, pole)]))):
        v = to_host(axis)
        np.testing.assert_allclose(v, np.tile(v[0], (4, 1)), rtol=0, atol=2e-5)


def test_to_world_is_linear_in_the_basis() -> None:
    n = normals()
    local = np.random.default_rng(2).standard_normal(n.shape).astype(np.float32)
    basis = frame(to_device(n))
    expected = np.einsum("nk,knc->nc", local, np.stack([to_host(v) for v in basis]))
    world = to_host(basis.to_world(to_device(local)))
    np.testing.assert_allclose(world, expected, rtol=0, atol=6 * ROUNDINGS)


def test_to_local_is_what_to_world_undoes() -> None:
    n = normals()
    world = np.random.default_rng(4).standard_normal(n.shape).astype(np.float32)
    basis = frame(to_device(n))
    expected = np.einsum("nc,knc->nk", world, np.stack([to_host(v) for v in basis]))
    local = basis.to_local(to_device(world))
    np.testing.assert_allclose(to_host(local), expected, rtol=0, atol=6 * ROUNDINGS)
    back = to_host(basis.to_world(local))
    np.testing.assert_allclose(back, world, rtol=0, atol=12 * ROUNDINGS)


def test_reflect_mirrors_at_the_normal() -> None:
    n, w = normals(), np.random.default_rng(3).permutation(normals())
    mirrored = to_host(reflect(to_device(w), to_device(n)))
    np.testing.assert_allclose(mirrored, 2 * dot(n, w)[:, None] * n - w, rtol=0, atol=ROUNDINGS)
    np.testing.assert_allclose(dot(mirrored, n), dot(w, n), rtol=0, atol=ROUNDINGS)


def test_sincos_2pi() -> None:
    u = np.append(np.arange(0, 2**24, 37), 2**24 - 1) * 2.0**-24
    sin, cos = (to_host(v) for v in sincos_2pi(to_device(u)))
    np.testing.assert_allclose(sin, np.sin(2 * np.pi * u), rtol=0, atol=SINCOS)
    np.testing.assert_allclose(cos, np.cos(2 * np.pi * u), rtol=0, atol=SINCOS)


def test_sincos_2pi_is_exact_at_quarter_turns() -> None:
    sin, cos = (to_host(v) for v in sincos_2pi(to_device([0, 0.25, 0.5, 0.75, 1])))
    np.testing.assert_array_equal(sin, [0, 1, 0, -1, 0])
    np.testing.assert_array_equal(cos, [1, 0, -1, 0, 1])


def test_horner_takes_coefficients_from_the_constant_upward() -> None:
    x = to_device([0, 1, 2, -3])
    np.testing.assert_array_equal(to_host(horner(x, 5, 0, 2, -1)), [5, 6, 5, 50])


def test_vectors_follow_the_backend_of_their_components() -> None:
    x = to_device([1, 2])
    np.testing.assert_array_equal(to_host(vec2(x, 3 * x)), [[1, 3], [2, 6]])
    np.testing.assert_array_equal(to_host(vec3(x, -x, 2 * x)), [[1, -1, 2], [2, -2, 4]])
    assert type(vec3(x, x, x)).__module__ == type(x).__module__
