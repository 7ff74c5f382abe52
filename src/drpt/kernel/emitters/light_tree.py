"""Choice of one of several lights, by the light that a receiver is likely to get from it.

A complete tree of balls around the lights is walked from the root to a leaf; at each node, one
child is chosen at random by its importance. Few lights are all children of the root.

Source: Conty Estevez & Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree
Splitting"; here the nodes' numbers tell their children, and an even share of each choice keeps a
light that seems unimportant from being missed, such as a lamp beside an occluded sun.
"""

from __future__ import annotations

from itertools import accumulate
from typing import TYPE_CHECKING, Any, NamedTuple

import drjit as dr
import numpy as np

from drpt.kernel.sphere_tree import arrange
from drpt.kernel.vec import gather_row, greater, lesser, vec3

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

    from drjit.auto import Array4f, Bool, Float, UInt32
    from numpy.typing import NDArray

    from drpt.kernel.emitters.base import Receiver

    Array = NDArray[np.float64]

FEW = 16
"""Up to so many lights are compared with each other, without nodes that stand for several."""
WIDTH = 4
"""Children of a node where there are more; a power of two."""
EVEN = 1 / 32
"""Share of each choice that is the same for all lights."""
TINY = 2.0**-100
"""Importance against which that of any light that can matter is large, and 0 is not."""
_BELOW_ONE = 1 - 2.0**-24


class Choice(NamedTuple):
    """A light, and the probability that it is chosen."""

    light: UInt32
    pmf: Float


class LightTree:
    """A distribution over two lights or more.

    Parameters
    ----------
    balls
        Centre and radius (n, 4) of a ball around each light.
    power
        Of each light (n,), relative to the others': the irradiance that it gives a receiver that
        faces it, times its squared distance.
    types, upload
        The backend, and what brings numbers there, to memory from which rows are gathered.
    """

    def __init__(
        self, balls: Array, power: Array, types: ModuleType, upload: Callable[[Array], Float]
    ) -> None:
        count = len(power)
        few = count <= FEW
        self._types = types
        self._width = count if few else WIDTH
        self._levels = 1 if few else _levels(count)
        lights = np.full((self._width**self._levels, 5), np.nan)
        lights[:count] = np.column_stack([balls, power / power.sum()])
        order = np.arange(count) if few else arrange(lights[:, :3])
        levels = [nodes_of(lights[order], self._width**n) for n in range(1, self._levels + 1)]
        extent = nodes_of(lights, 1)[0, 3]
        nodes = np.concatenate(levels)
        nodes[:, 4] *= extent**2
        nodes[:, 5] = EVEN / (1 - EVEN) * _among_siblings(nodes[:, 5], self._width)
        if few:
            self._constants = [_constants(node, types) for node in nodes]
        else:
            self._balls = upload(nodes[:, :4])
            self._weights = upload(nodes[:, 4:])
            self._lights = types.UInt32(order.astype(np.uint32))
            self._leaves = types.UInt32(np.argsort(order).astype(np.uint32))

    def choose(self, at: Receiver, active: Bool, u: Float) -> Choice:
        """Discrete: one of the lights, by a number from [0, 1) that is used up."""

        def step(node: UInt32, pmf: Float, u: Float) -> tuple[UInt32, Float, Float]:
            shares = self._shares(at, node)
            ends = list(accumulate(shares))
            goal = u * ends[-1]
            child, start, share = self._types.UInt32(0), self._types.Float32(0), shares[0]
            for k, end in enumerate(ends[:-1], 1):
                passed = (goal >= end) & (end < ends[-1])
                child = dr.select(passed, k, child)
                start = dr.select(passed, end, start)
                share = dr.select(passed, shares[k], share)
            u = lesser((goal - start) / share, _BELOW_ONE)
            return self._child(node, child), pmf * (share / ends[-1]), u

        node, pmf, _ = self._descend(step, active, u)
        light = node - self._first_leaf
        if self._levels > 1:
            light = dr.gather(self._types.UInt32, self._lights, light, active)
        return Choice(light, pmf)

    def pmf(self, at: Receiver, active: Bool, light: UInt32) -> Float:
        """Discrete: the probability with which :meth:`choose` finds a light."""
        bits = self._width.bit_length() - 1
        leaf = light
        if self._levels > 1:
            leaf = dr.gather(self._types.UInt32, self._leaves, light, active)

        def step(node: UInt32, pmf: Float, shift: UInt32) -> tuple[UInt32, Float, UInt32]:
            shares = self._shares(at, node)
            child = leaf if self._levels == 1 else (leaf >> shift) & (self._width - 1)
            share = shares[0]
            for k in range(1, self._width):
                share = dr.select(child == k, shares[k], share)
            return self._child(node, child), pmf * (share / sum(shares)), shift - bits

        return self._descend(step, active, self._types.UInt32(bits * (self._levels - 1)))[1]

    def _descend(self, step: Callable[..., Any], active: Bool, state: Any) -> tuple[Any, ...]:
        """Node, probability and state where a walk from the root ends."""
        start = self._types.UInt32(0), self._types.Float32(1), state
        if self._levels == 1:
            return tuple(step(*start))
        goes_on = lambda node, *_: active & (node < self._first_leaf)  # noqa: E731
        return tuple(dr.while_loop(start, goes_on, step))

    def _child(self, node: UInt32, number: UInt32) -> UInt32:
        return node * self._width + number + 1

    @property
    def _first_leaf(self) -> int:
        return sum(self._width**level for level in range(self._levels))

    def _shares(self, at: Receiver, node: UInt32) -> list[Float]:
        """To what each child of a node is chosen in proportion; 0 where there is no light."""
        children = self._children(node)
        importances = [child.power * geometric_importance(at, child.ball) for child in children]
        total = sum(importances) + TINY
        return [
            dr.fma(total, child.even, importance)
            for child, importance in zip(children, importances, strict=True)
        ]

    def _children(self, node: UInt32) -> list[_Node]:
        if self._levels == 1:
            return self._constants
        balls = gather_row(self._balls, node, 4 * self._width)
        weights = gather_row(self._weights, node, 2 * self._width)
        return [
            _Node(self._types.Array4f(balls[4 * k : 4 * k + 4]), *weights[2 * k : 2 * k + 2])
            for k in range(self._width)
        ]


class _Node(NamedTuple):
    """A ball around lights, their power, and their even share relative to the rest of a choice."""

    ball: Array4f
    power: Float
    even: Float


def _constants(row: Array, types: ModuleType) -> _Node:
    """A node whose numbers are inputs of the kernel, the same for all lanes."""
    *ball, power, even = (dr.opaque(types.Float32, float(value)) for value in row)
    return _Node(types.Array4f(ball), power, even)


def geometric_importance(at: Receiver, ball: Array4f) -> Float:
    """About what irradiance a ball of unit power gives; 0 if no part is above the horizon.

    Exact for a sphere light that is wholly above the horizon and not occluded, too much for one
    that crosses it. In a ball of several lights all are taken to be at its centre, but never below
    half of what is the highest of them at most, nor nearer than the ball's surface is to it.
    """
    radius = ball[3]
    to_center = vec3(ball[0], ball[1], ball[2]) - at.point
    middle = dr.dot(to_center, at.normal)
    height = greater(greater(middle, (middle + radius) / 2), 0)
    squared = greater(dr.squared_norm(to_center), dr.square(radius))
    return height / (squared * dr.sqrt(squared))


def nodes_of(lights: Array, count: int) -> Array:
    """Ball, power and number of the lights (count, 6) in so many runs of the same length.

    ``lights`` are rows of (centre, radius, power), not a number where there is none.
    """
    groups = lights.reshape(count, -1, 5)
    centers, radii = groups[..., :3], groups[..., 3:4]
    low = np.fmin.reduce(centers - radii, axis=1)
    high = np.fmax.reduce(centers + radii, axis=1)
    middle = (low + high) / 2
    reach = np.linalg.norm(centers - middle[:, None], axis=2) + radii[..., 0]
    radius = np.fmax.reduce(reach, axis=1)
    number = np.isfinite(reach).sum(axis=1)
    nodes = np.column_stack([middle, radius, np.nansum(groups[..., 4], axis=1), number])
    return np.where(number[:, None] > 0, nodes, [0, 0, 0, 1, 0, 0])


def _among_siblings(numbers: Array, width: int) -> Array:
    """The share (n,) of each node in the numbers of all children that its parent has."""
    families = numbers.reshape(-1, width)
    return np.asarray(families / np.maximum(families.sum(axis=1, keepdims=True), 1)).ravel()


def _levels(count: int) -> int:
    """Levels below the root, so that there are as many leaves as lights at least."""
    levels = 1
    while WIDTH**levels < count:
        levels += 1
    return levels
