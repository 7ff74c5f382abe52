"""Samplers: pure functions of (pixel, sample index, decision), so that any sample can be redrawn.

Every decision of a path has a number: 0 is the position in the pixel, and each vertex has a few of
its own. A sampler gives every decision a point of its own; nothing depends on the order in which
points are asked for, on passes or on threads.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import drjit as dr

from drpt.kernel.vec import types_of, vec2

if TYPE_CHECKING:
    from drjit.auto import Array2f, Float, UInt32

    _Four: TypeAlias = tuple[UInt32, UInt32, UInt32, UInt32]

_ONE_ULP_BELOW_ONE = 2.0**-24
_FIRST_ULP = 8


def hash4(x: UInt32, y: UInt32, z: UInt32, w: UInt32) -> _Four:
    """Bijective hash of 128 bits: no two inputs share their output.

    Source: ``pcg4d`` of Jarzynski & Olano 2020, "Hash Functions for GPU Rendering".
    """
    x, y, z, w = (v * 1664525 + 1013904223 for v in (x, y, z, w))
    x, y, z, w = _pcg4d_round(x, y, z, w)
    x, y, z, w = (v ^ (v >> 16) for v in (x, y, z, w))
    return _pcg4d_round(x, y, z, w)


def _pcg4d_round(x: UInt32, y: UInt32, z: UInt32, w: UInt32) -> _Four:
    x = x + y * w
    y = y + z * x
    z = z + x * y
    w = w + y * z
    return x, y, z, w


def unit_float(bits: UInt32) -> Float:
    """The top 24 bits as a number in [0, 1 − 2⁻²⁴]."""
    return types_of(bits).Float32(bits >> _FIRST_ULP) * _ONE_ULP_BELOW_ONE


@dataclass
class IndependentSampler:
    """Independent uniform numbers: a hash of (pixel, sample index, decision, seed)."""

    pixel: UInt32
    index: UInt32
    seed: UInt32

    def next_1d(self, decision: Any) -> Float:
        """A number in [0, 1) for this decision."""
        return unit_float(self._bits(decision)[2])

    def next_2d(self, decision: Any) -> Array2f:
        """A point in [0, 1)² for this decision."""
        x, y, _, _ = self._bits(decision)
        return vec2(unit_float(x), unit_float(y))

    def _bits(self, decision: Any) -> _Four:
        return hash4(self.pixel, self.index, type(self.pixel)(decision), self.seed)


@dataclass
class SobolSampler:
    """Owen-scrambled Sobol' points, shuffled and padded: one 2-D sequence per decision.

    Source: Burley 2020, "Practical Hash-based Owen Scrambling". All bits stand in reversed order
    here, in which the first Sobol' dimension is the index itself and the second is its product
    with Pascal's triangle modulo 2 (Ahmed 2024), so that most bit reversals cancel.
    """

    pixel: UInt32
    index: UInt32
    seed: UInt32

    def next_1d(self, decision: Any) -> Float:
        """A number in [0, 1) for this decision; stratified over each aligned run of 2ᵏ samples."""
        shuffle, _, _, scramble = self._seeds(decision)
        return unit_float(dr.brev(owen_scramble(self._shuffled(shuffle), scramble)))

    def next_2d(self, decision: Any) -> Array2f:
        """A point in [0, 1)² for this decision; a (0, 2)-sequence over the samples of a pixel."""
        shuffle, scramble_x, scramble_y, _ = self._seeds(decision)
        i = self._shuffled(shuffle)
        x = owen_scramble(i, scramble_x)
        y = owen_scramble(pascal_product(i), scramble_y)
        return vec2(unit_float(dr.brev(x)), unit_float(dr.brev(y)))

    def _seeds(self, decision: Any) -> _Four:
        return hash4(self.pixel, type(self.pixel)(decision), self.seed, type(self.pixel)(0))

    def _shuffled(self, seed: UInt32) -> UInt32:
        return dr.brev(owen_scramble(dr.brev(self.index), seed))


def owen_scramble(bits: UInt32, seed: UInt32) -> UInt32:
    """Nested uniform scramble of a number whose bits stand in reversed order.

    Source: Laine & Karras 2011, with the constants of Vegdahl 2021.
    """
    x = bits ^ (bits * 0x3D20ADEA)
    x = x + seed
    x = x * ((seed >> 16) | 1)
    x = x ^ (x * 0x05526C56)
    return x ^ (x * 0x53A22864)


def pascal_product(bits: UInt32) -> UInt32:
    """Product of Pascal's triangle modulo 2 with a vector of 32 bits.

    Source: Ahmed 2024, "An Implementation Algorithm of 2D Sobol Sequence Fast, Elegant, and
    Compact"; the matrix is the fivefold Kronecker power of [[1, 1], [0, 1]].
    """
    for shift, low_half in ((16, 0xFFFF), (8, 0xFF00FF), (4, 0xF0F0F0F), (2, 0x33333333)):
        bits = bits ^ ((bits >> shift) & low_half)
    return bits ^ ((bits >> 1) & 0x55555555)


Sampler: TypeAlias = IndependentSampler | SobolSampler
SAMPLERS: dict[str, type[Sampler]] = {"sobol": SobolSampler, "independent": IndependentSampler}
