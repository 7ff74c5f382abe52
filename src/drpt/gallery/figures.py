"""Which pictures the gallery shows, and in which order."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

from drpt.render import SAMPLERS, Mode

DIFFUSE = "cornell-box"
GLOSSY = "cornell-box-glossy"
RADII = {DIFFUSE: 60, "cornell-box-medium-light": 30, "cornell-box-small-light": 10}
"""Scenes by the radius of their lamp, whose power is the same."""
SAMPLER_NAMES = {"sobol": "Sobol'", "independent": "independent"}
MODE_NAMES = {Mode.MIS: "MIS"}
"""Of modes that are not called as they are written."""
LADDER = (1, 4, 16, 64)
"""Samples per pixel of the curves, beside those of the pictures."""
CURVE_BOUNCES = 3


@dataclass(frozen=True)
class Setting:
    """What makes a picture."""

    scene: str
    mode: Mode
    sampler: str
    spp: int
    bounces: int

    @property
    def way(self) -> str:
        """Mode and sampler."""
        return f"{MODE_NAMES.get(self.mode, self.mode)}, {SAMPLER_NAMES[self.sampler]}"

    @property
    def short(self) -> str:
        """What tells it from pictures of the same mode and sampler."""
        lamp = f", radius {RADII[self.scene]}" if self.scene in RADII else ""
        return f"{self.spp} spp, {self.bounces} bounces{lamp}"

    def __str__(self) -> str:
        return f"{self.scene}, {self.way}, {self.spp} spp, {self.bounces} bounces"


class Crop(NamedTuple):
    """A square of a picture: left and upper edge, and side, as shares of the picture's side."""

    name: str
    left: float
    top: float
    side: float


@dataclass(frozen=True)
class Row:
    """Pictures of one mode and sampler that stand beside each other."""

    settings: tuple[Setting, ...]

    @property
    def label(self) -> str:
        """Mode and sampler."""
        return self.settings[0].way


@dataclass(frozen=True)
class Figure:
    """Pictures to compare, and the places to look at."""

    title: str
    text: str
    rows: tuple[Row, ...]
    crops: tuple[Crop, ...]

    @property
    def settings(self) -> list[Setting]:
        """Of all its pictures."""
        return [setting for row in self.rows for setting in row.settings]


@dataclass(frozen=True)
class Curve:
    """Error against time of all modes and samplers in a scene."""

    title: str
    scene: str
    bounces: int = CURVE_BOUNCES
    modes: tuple[Mode, ...] = (Mode.IMPLICIT, Mode.EXPLICIT, Mode.MIS)
    ladder: tuple[int, ...] = LADDER

    @property
    def settings(self) -> list[Setting]:
        """Of all pictures that are measured for it."""
        ways = product(self.modes, SAMPLERS, self.ladder)
        return [Setting(self.scene, *way, self.bounces) for way in ways]


@dataclass(frozen=True)
class Plan:
    """What a gallery holds: pictures of ``size`` × ``size`` pixels."""

    size: int
    figures: tuple[Figure, ...]
    curves: tuple[Curve, ...]

    @property
    def settings(self) -> list[Setting]:
        """Of all pictures, each once."""
        shown = (setting for figure in self.figures for setting in figure.settings)
        plotted = (setting for curve in self.curves for setting in curve.settings)
        return list(dict.fromkeys((*shown, *plotted)))

    @property
    def course(self) -> list[Setting]:
        """Of the course's own pictures, which know neither MIS nor Sobol' points."""
        shown = dict.fromkeys(setting for figure in self.figures for setting in figure.settings)
        return [s for s in shown if s.sampler == "independent" and s.mode != Mode.MIS]


SHADOW = Crop("shadow of the large box", 0.1, 0.45, 0.2)
CORNER = Crop("corner of ceiling and red wall", 0.1, 0.04, 0.2)
MIRROR = Crop("reflection of the small box", 0.34, 0.58, 0.2)
SATIN = Crop("satin back wall", 0.5, 0.38, 0.2)
CAUSTIC = Crop("caustic on the ceiling", 0.2, 0.1, 0.2)


def course_plan(size: int = 256) -> Plan:
    """Return the course's set of figures, MIS and independent samples beside them."""
    few = tuple(
        Figure(
            f"Diffuse box, few samples, {bounces} bounces",
            "Explicit sampling lights every vertex, so that some tens of samples show what "
            "implicit sampling needs a thousand for. On diffuse surfaces MIS has nothing to add.",
            _rows((Mode.EXPLICIT, Mode.MIS), [(DIFFUSE, spp, bounces) for spp in samples]),
            (SHADOW, CORNER),
        )
        for bounces, samples in ((2, (1, 10)), (3, (1, 10, 100)), (4, (1, 10, 100)))
    )
    return Plan(
        size,
        (_implicit(), *few, _lights(), _glossy()),
        (Curve("Diffuse box", DIFFUSE), Curve("Glossy box", GLOSSY)),
    )


def _rows(modes: tuple[Mode, ...], columns: list[tuple[str, int, int]]) -> tuple[Row, ...]:
    """A row for each mode and sampler, with a picture for each scene, spp and bounces."""
    return tuple(
        Row(tuple(Setting(scene, mode, sampler, spp, bounces) for scene, spp, bounces in columns))
        for mode, sampler in product(modes, SAMPLERS)
    )


def _implicit() -> Figure:
    return Figure(
        "Diffuse box, implicit",
        "Paths find the lamp only where they run into it. Twice the samples halve the squared "
        "error, which the eye hardly sees; more bounces brighten what the lamp does not see.",
        _rows((Mode.IMPLICIT,), [(DIFFUSE, 512, 2), *((DIFFUSE, 1024, b) for b in (2, 3, 4))]),
        (SHADOW, CORNER),
    )


def _lights() -> Figure:
    return Figure(
        "Lamps of radius 60, 30 and 10, of equal power, 2 bounces",
        "The smaller the lamp, the fewer paths run into it, and the brighter each of them is. "
        "Explicit sampling aims at it, whatever its size, and shadows get sharper.",
        (
            *_rows((Mode.IMPLICIT,), [(scene, 1024, 2) for scene in RADII]),
            *_rows((Mode.EXPLICIT, Mode.MIS), [(scene, 10, 2) for scene in RADII]),
        ),
        (SHADOW, CORNER),
    )


def _glossy() -> Figure:
    return Figure(
        "Glossy box, 1024 spp, 2, 3 and 4 bounces",
        "The back wall is satin (Phong exponent 50), the large box polished (1000). Implicit "
        "sampling is good where a mirror shows the lamp, explicit sampling where the lamp lights a "
        "rough wall; MIS takes of both what is good.",
        _rows((Mode.IMPLICIT, Mode.EXPLICIT, Mode.MIS), [(GLOSSY, 1024, b) for b in (2, 3, 4)]),
        (MIRROR, SATIN, CAUSTIC),
    )
