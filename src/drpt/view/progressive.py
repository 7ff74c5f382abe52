"""A render that is watched: it goes on in steps short enough to be interrupted by a change."""

from __future__ import annotations

from contextlib import closing
from time import perf_counter
from typing import TYPE_CHECKING

from drpt.plan import LAUNCH_PATHS
from drpt.render import Rendering

if TYPE_CHECKING:
    from drpt.result import Result
    from drpt.scene import Scene
    from drpt.view.state import Half

STEP_SECONDS = 0.1
"""How long a step should take: ten pictures a second."""
FIRST_PATHS = 2**18
"""Paths of the first step, whose time is not known yet."""


class Progressive:
    """One estimator of one scene.

    Attributes
    ----------
    paths_per_second
        Of the last step; 0 before.
    """

    def __init__(self, scene: Scene, half: Half, spp: int, seed: int) -> None:
        self.rendering = Rendering(
            scene, spp, half.bounces, half.mode, sampler=half.sampler, seed=seed
        )
        self.paths_per_second = 0.0
        self._paths = FIRST_PATHS

    def does_the_same_as(self, other: Progressive) -> bool:
        """Whether both render the same."""
        return vars(self.rendering.settings) == vars(other.rendering.settings)

    @property
    def spp(self) -> int:
        """Samples that each pixel has got so far."""
        return self.rendering.spp

    @property
    def done(self) -> bool:
        """Whether all samples are there."""
        return self.spp == self.rendering.settings.spp

    def step(self) -> None:
        """Take some more samples of every pixel."""
        before, start = self.spp, perf_counter()
        with closing(self.rendering.passes(self._paths)) as passes:
            next(passes)
        traced = (self.spp - before) * self.rendering.settings.pixels
        self.paths_per_second = traced / (perf_counter() - start)
        self._paths = min(int(self.paths_per_second * STEP_SECONDS), LAUNCH_PATHS)

    def result(self) -> Result:
        """The picture so far."""
        return self.rendering.result()
