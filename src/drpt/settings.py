"""Settings of a render, checked when they are made."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from numbers import Real

import numpy as np

from drpt.kernel.estimator import Mode
from drpt.scene import Scene
from drpt.scene.checks import show

SAMPLERS = ("sobol", "independent")
MAX_SPP = 2**48
MAX_BOUNCES = 2**16


@dataclass(frozen=True, eq=False)
class Settings:
    """What decides about every sample of a render; see :func:`drpt.render`.

    Raises `ValueError`, which names the setting, its value and what is allowed.
    """

    scene: Scene
    spp: int = 64
    bounces: int = 3
    mode: Mode | str = Mode.MIS
    sampler: str = "sobol"
    seed: int = 0
    jitter: bool = True

    def __post_init__(self) -> None:
        checked = {
            "scene": _check_scene(self.scene),
            "spp": check_whole("spp", self.spp, 1, MAX_SPP),
            "bounces": check_whole("bounces", self.bounces, 0, MAX_BOUNCES),
            "mode": check_mode(self.mode),
            "sampler": check_choice("sampler", self.sampler, SAMPLERS),
            "seed": check_whole("seed", self.seed, 0, None),
            "jitter": check_switch("jitter", self.jitter),
        }
        for name, value in checked.items():
            object.__setattr__(self, name, value)

    @property
    def pixels(self) -> int:
        """How many pixels the picture has."""
        return self.scene.camera.width * self.scene.camera.height


def check_whole(name: str, value: object, low: int, high: int | None) -> int:
    """Return a whole number in a range, or raise `ValueError`."""
    limits = f">= {low}" if high is None else f"from {low} to {high}"
    allowed = f"a whole number {limits}"
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        raise refuse(name, value, allowed)
    if value < low or (high is not None and value > high):
        raise refuse(name, value, allowed)
    return int(value)


def check_number(name: str, value: object, low: float, high: float) -> float:
    """Return a number in a range, or raise `ValueError`."""
    if isinstance(value, int | float) and not isinstance(value, bool) and low <= value <= high:
        return float(value)
    raise refuse(name, value, f"a number from {low:g} to {high:g}")


def check_positive(name: str, value: object) -> float:
    """Return a finite number above 0, or raise `ValueError`."""
    if isinstance(value, bool) or not isinstance(value, Real):
        raise refuse(name, value, "a finite number > 0")
    number = float(value)
    if not 0 < number < np.inf:
        raise refuse(name, value, "a finite number > 0")
    return number


def check_mode(mode: object) -> Mode:
    """Return a mode, given by itself or by its name, or raise `ValueError`."""
    if isinstance(mode, str):
        with suppress(ValueError):
            return Mode(mode)
    raise refuse("mode", mode, f"one of {', '.join(Mode)}")


def check_choice(name: str, value: object, choices: tuple[str, ...]) -> str:
    """Return one of some texts, or raise `ValueError`."""
    if not isinstance(value, str) or value not in choices:
        raise refuse(name, value, f"one of {', '.join(choices)}")
    return value


def check_switch(name: str, value: object) -> bool:
    """Return a truth value, or raise `ValueError`."""
    if not isinstance(value, bool | np.bool_):
        raise refuse(name, value, "True or False")
    return bool(value)


def refuse(name: str, value: object, allowed: str) -> ValueError:
    """An error that names a setting, its value and what is allowed."""
    return ValueError(f"{name}: {show(value)} is not allowed; it must be {allowed}")


def _check_scene(scene: object) -> Scene:
    if not isinstance(scene, Scene):
        raise refuse("scene", scene, "a drpt.Scene, as drpt.load_scene returns it")
    return scene
