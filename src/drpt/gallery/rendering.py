"""Renders pictures, each once, and measures them against references."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from drpt.error import DARK
from drpt.render import Mode, render
from drpt.scene import load_scene

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from drpt.gallery.figures import Setting
    from drpt.result import Result
    from drpt.scene import Scene

REFERENCE_SPP = 1024
REFERENCE_SEED = 1
"""Another one than that of the pictures, which must not share their noise with a reference."""
SHORT, REPEATS = 0.1, 2
"""Of pictures that take less, in seconds, the fastest of it and so many more renders counts."""
WARM_UP_SIZE = 16
"""Pixels along the sides of a picture that is rendered for its kernel alone."""


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture and its measures.

    Attributes
    ----------
    image
        Linear radiance, float32 (height, width, 3).
    seconds
        What it took once its kernel was compiled, undisturbed.
    rel_mse
        Mean of (x − x̂)² / (x̂² + 0.01) against the reference x̂, less what that itself is off.
    """

    setting: Setting
    image: NDArray[np.float32]
    seconds: float
    rel_mse: float


class Darkroom:
    """Renders pictures of some size, and keeps what it has rendered.

    Attributes
    ----------
    pictures, references
        What there is so far: by setting, and by scene and bounces.
    paths
        Paths traced in pictures and references, and for questions.
    """

    def __init__(self, size: int, on_picture: Callable[[str], object]) -> None:
        """``on_picture`` is called before each picture, with words that say what comes."""
        self.size = size
        self.pictures: dict[Setting, Picture] = {}
        self.references: dict[tuple[str, int], Result] = {}
        self.paths = 0
        self._on_picture = on_picture

    def picture(self, setting: Setting) -> Picture:
        """Return the picture of a setting."""
        if setting not in self.pictures:
            reference = self.reference(setting.scene, setting.bounces)
            self._on_picture(str(setting))
            result, seconds = self._timed(setting)
            error = rel_mse(result.image, reference)
            self.pictures[setting] = Picture(setting, result.image, seconds, error)
        return self.pictures[setting]

    def _timed(self, setting: Setting) -> tuple[Result, float]:
        """Render a picture, and measure its seconds."""
        scene = self.scene(setting.scene)
        way = setting.spp, setting.bounces, setting.mode, setting.sampler
        _warm_up(setting)
        result = self.render(scene, *way)
        repeats = REPEATS if result.seconds < SHORT else 0
        seconds = [result.seconds, *(self.render(scene, *way).seconds for _ in range(repeats))]
        return result, min(seconds)

    def reference(self, scene: str, bounces: int) -> Result:
        """Return the picture that those of a scene are measured against."""
        if (scene, bounces) not in self.references:
            self._on_picture(f"reference, {scene}, {bounces} bounces")
            self.references[scene, bounces] = self.render(
                self.scene(scene), REFERENCE_SPP, bounces, Mode.MIS, seed=REFERENCE_SEED
            )
        return self.references[scene, bounces]

    def scene(self, name: str) -> Scene:
        """Return a built-in scene with a camera of the gallery's size."""
        return load_scene(name).resized(self.size, self.size)

    def render(
        self,
        scene: Scene,
        spp: int,
        bounces: int,
        mode: Mode,
        sampler: str = "sobol",
        seed: int = 0,
    ) -> Result:
        """Render what is not kept."""
        result = render(scene, spp, bounces, mode, sampler=sampler, seed=seed)
        self.paths += result.paths
        return result


def rel_mse(image: NDArray[np.float32], reference: Result) -> float:
    """Return the relMSE of a picture, without that of the reference, which is estimated."""
    truth = reference.image.astype(np.float64)
    return float(np.mean((image - truth) ** 2 / (truth**2 + DARK))) - reference.error


def _warm_up(setting: Setting) -> None:
    """Have a scene prepared and its kernel compiled: seconds are those of the picture alone."""
    scene = load_scene(setting.scene).resized(WARM_UP_SIZE, WARM_UP_SIZE)
    render(scene, 1, setting.bounces, setting.mode, sampler=setting.sampler)
