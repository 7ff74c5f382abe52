"""All lights of a scene: a sample of one of them, and the density with which it would be found."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import drjit as dr

from drpt.kernel.emitters.light_tree import Choice

if TYPE_CHECKING:
    from collections.abc import Callable

    from drjit.auto import Array2f, Array3f, Bool, Float, UInt32

    from drpt.kernel.camera import Ray
    from drpt.kernel.emitters.base import EmitterKind, LightRows, Receiver
    from drpt.kernel.emitters.light_tree import LightTree
    from drpt.kernel.intersect import Hit


class LightSample(NamedTuple):
    """A direction to a chosen light; ``inverse_pdf`` counts the choice, too."""

    direction: Array3f
    distance: Float
    radiance: Array3f
    inverse_pdf: Float


@dataclass
class Emitters:
    """The lights of a scene, by number.

    Attributes
    ----------
    rows
        The rows of all lights.
    kinds
        The kinds of lights in the scene, in the order of their numbers.
    tree
        Which light is chosen, where there are several.
    """

    rows: LightRows
    kinds: tuple[EmitterKind, ...]
    tree: LightTree | None

    @property
    def count(self) -> int:
        """Number of lights."""
        return sum(kind.count for kind in self.kinds)

    def radiance(self, light: UInt32) -> Array3f:
        """Radiance of the front of a light."""
        return self.rows.of(light).radiance

    def choose(self, at: Receiver, active: Bool, u: Callable[[], Float]) -> Choice:
        """Discrete: one of the lights; ``u()`` is asked for where there are several."""
        if self.tree is None:
            types = self.rows.types
            return Choice(types.UInt32(0), types.Float32(1))
        return self.tree.choose(at, active, u())

    def sample(self, at: Receiver, choice: Choice, u: Array2f, *, visible: bool) -> LightSample:
        """Solid angle: a direction from a receiver to a chosen light."""
        light = choice.light
        direction, distance, inverse_pdf = self._by_kind(
            light, lambda kind: tuple(kind.sample(at, light, u, visible=visible))
        )
        return LightSample(direction, distance, self.radiance(light), inverse_pdf / choice.pmf)

    def inverse_pdf(self, at: Receiver, light: UInt32, ray: Ray, hit: Hit) -> Float:
        """1 / density with which :meth:`sample` finds a receiver's ray that hits a light."""
        inverse = self._by_kind(light, lambda kind: kind.inverse_pdf(at, light, ray, hit))
        return inverse if self.tree is None else inverse / self.tree.pmf(at, hit.valid, light)

    def _by_kind(self, light: UInt32, ask: Callable[[EmitterKind], Any]) -> Any:
        """The answer of the light's kind; the kernel has no code for a kind that is missing."""
        *others, last = self.kinds
        ends = [sum(kind.count for kind in self.kinds[: k + 1]) for k in range(len(others))]
        answers = [ask(kind) for kind in others]
        found = ask(last)
        for end, answer in reversed(list(zip(ends, answers, strict=True))):
            found = dr.select(light < end, answer, found)
        return found


def power_heuristic(ratio: Float) -> Float:
    """Weight of a sample whose density is 1 / ``ratio`` times that of the other technique.

    Source: Veach & Guibas 1995, exponent 2, in the form that holds for ratios of 0 and infinity.
    """
    return dr.rcp(1 + dr.square(ratio))
