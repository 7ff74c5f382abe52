"""Small vectors on the device: constructors that follow their arguments' backend, and frames."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any, NamedTuple

import drjit as dr

if TYPE_CHECKING:
    from drjit.auto import Array2f, Array3f, Float, UInt32


def types_of(x: Any) -> Any:
    """The module of array types that ``x`` belongs to: ``drjit.llvm``, ``drjit.cuda``, ….ad."""
    return sys.modules[type(x).__module__]


def vec2(x: Float, y: Float) -> Array2f:
    """Vector of two components, of the backend of ``x``."""
    return types_of(x).Array2f(x, y)


def vec3(x: Float, y: Float, z: Float) -> Array3f:
    """Vector of three components, of the backend of ``x``."""
    return types_of(x).Array3f(x, y, z)


def greater(a: Any, b: Any) -> Any:
    """The greater of two; b where one is not a number, so that it takes a single instruction."""
    return dr.select(a > b, a, b)


def lesser(a: Any, b: Any) -> Any:
    """The lesser of two; b where one is not a number."""
    return dr.select(a < b, a, b)


def largest(v: Array3f) -> Float:
    """The size of the largest component."""
    return greater(greater(dr.abs(v.x), dr.abs(v.y)), dr.abs(v.z))


def gather_row(table: Any, row: UInt32, width: int, active: Any = True) -> list[Any]:
    """The numbers of a row of a table, in one piece, where ``width`` is a power of two.

    A gather is a call in the kernel, which moves all that is in registers out of the way.
    """
    types = types_of(table)
    kind = types.ArrayXf if isinstance(table, types.Float32) else types.ArrayXu
    return list(dr.gather(kind, table, row, active, shape=(width, len(row))))


class Frame(NamedTuple):
    """Right-handed orthonormal basis (s, t, n)."""

    s: Array3f
    t: Array3f
    n: Array3f

    def to_world(self, v: Array3f) -> Array3f:
        """Coordinates ``v`` in this basis, in world space."""
        return dr.fma(self.s, v.x, dr.fma(self.t, v.y, self.n * v.z))

    def to_local(self, v: Array3f) -> Array3f:
        """Coordinates in this basis of a vector in world space."""
        return vec3(dr.dot(self.s, v), dr.dot(self.t, v), dr.dot(self.n, v))


def frame(n: Array3f) -> Frame:
    """Basis around the unit vector ``n``, continuous but for the sign of n.z.

    Source: Duff et al. 2017, "Building an Orthonormal Basis, Revisited".
    """
    sign: Any = dr.copysign(type(n.z)(1), n.z)
    a = -dr.rcp(sign + n.z)
    b = n.x * n.y * a
    s = vec3(dr.fma(sign * n.x * n.x, a, 1), sign * b, -sign * n.x)
    t = vec3(b, dr.fma(n.y * n.y, a, sign), -n.y)
    return Frame(s, t, n)


def reflect(w: Array3f, n: Array3f) -> Array3f:
    """Mirror image of the direction ``w`` at the normal ``n``; both point away from the surface."""
    return dr.fma(n, 2 * dr.dot(n, w), -w)


def sincos_2pi(u: Float) -> tuple[Float, Float]:
    """Sine and cosine of 2πu for u in [0, 1], to 1e-7.

    The quarter turn nearest to u is taken off exactly; on what is left, |r| ≤ 1/2 quarter turns,
    the Taylor series of sin(πr/2) and cos(πr/2) are below 2e-9 after five terms.
    """
    quarters = 4 * u
    k = dr.round(quarters)
    r = quarters - k
    r2 = r * r
    sin_r = r * horner(r2, 1.5707963268, -0.6459640975, 0.0796926262, -0.0046817541, 0.0001604412)
    cos_r = horner(r2, 1.0, -1.2337005501, 0.2536695079, -0.0208634808, 0.0009192603, -0.0000252020)
    quadrant = dr.int32_array_t(u)(k)
    swap = (quadrant & 1) != 0
    sin = _flip_sign(dr.select(swap, cos_r, sin_r), quadrant)
    cos = _flip_sign(dr.select(swap, sin_r, cos_r), quadrant + 1)
    return sin, cos


def horner(x: Float, *coefficients: float) -> Float:
    """Polynomial in ``x``, coefficients from the constant upward."""
    value = type(x)(coefficients[-1])
    for c in reversed(coefficients[:-1]):
        value = dr.fma(value, x, c)
    return value


def _flip_sign(x: Float, quadrant: Any) -> Float:
    """``-x`` in the quadrants 2 and 3 (modulo 4), ``x`` in the others."""
    sign_bit = (quadrant & 2) << 30
    bits: Any = dr.reinterpret_array(type(sign_bit), x)
    flipped: Any = dr.reinterpret_array(type(x), bits ^ sign_bit)
    return flipped
