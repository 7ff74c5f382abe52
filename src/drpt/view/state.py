"""What a browser asks to be shown: plain values, checked as far as no scene is needed for it."""

from __future__ import annotations

import re
from dataclasses import asdict, dataclass, field, fields
from typing import TYPE_CHECKING, Any, TypeVar

from drpt.render import SAMPLERS, Mode
from drpt.settings import check_choice, check_mode, check_number, check_whole, refuse

if TYPE_CHECKING:
    from collections.abc import Mapping

    T = TypeVar("T")

MAX_SPP = 2**20
MAX_BOUNCES = 64
"""A pass of so many still ends soon enough for the next change."""
MAX_SEED = 2**53 - 1
"""Up to here a browser's numbers count by ones."""
MAX_PATHS = 256
MAX_DEGREES = 360.0
MAX_ZOOM = 16.0
DIFFERENCES = ("none", "reference", "other")


@dataclass(frozen=True)
class Half:
    """How one half of the picture is rendered; see :func:`drpt.render`."""

    mode: str = Mode.MIS
    sampler: str = SAMPLERS[0]
    bounces: int = 3

    def __post_init__(self) -> None:
        check_mode(self.mode)
        check_choice("sampler", self.sampler, SAMPLERS)
        check_whole("bounces", self.bounces, 0, MAX_BOUNCES)


@dataclass(frozen=True)
class Orbit:
    """Where the camera has gone: degrees around the scene and up, and stops towards it.

    Each stop halves the distance to what it goes around.
    """

    azimuth: float = 0.0
    elevation: float = 0.0
    zoom: float = 0.0

    def __post_init__(self) -> None:
        check_number("azimuth", self.azimuth, -MAX_DEGREES, MAX_DEGREES)
        check_number("elevation", self.elevation, -MAX_DEGREES, MAX_DEGREES)
        check_number("zoom", self.zoom, -MAX_ZOOM, MAX_ZOOM)


@dataclass(frozen=True)
class State:
    """All that decides about what is rendered for a browser.

    Attributes
    ----------
    scene
        Name of one of the scenes that are served.
    halves
        One estimator for the whole picture, or one for each half.
    spp
        Samples per pixel after which it is finished.
    edits
        What is changed about shapes, by their number; see :func:`drpt.view.edits.edited`.
    camera
        Where the camera has gone from its place in the scene.
    pixel
        Column and row of the pixel that is looked into, or None.
    paths
        So many paths through it are traced.
    difference
        From what the difference is shown: a ``reference`` of the same bounces, the ``other``
        half, or ``none``.
    """

    scene: str
    halves: tuple[Half, ...] = (Half(),)
    spp: int = 4096
    seed: int = 0
    edits: Mapping[int, Mapping[str, Any]] = field(default_factory=dict)
    camera: Orbit = Orbit()
    pixel: tuple[int, int] | None = None
    paths: int = 16
    difference: str = DIFFERENCES[0]

    def __post_init__(self) -> None:
        check_whole("spp", self.spp, 1, MAX_SPP)
        check_whole("seed", self.seed, 0, MAX_SEED)
        check_whole("paths", self.paths, 1, MAX_PATHS)
        check_choice("difference", self.difference, DIFFERENCES)
        if self.difference == "other" and len(self.halves) == 1:
            raise refuse(
                "difference", self.difference, "reference or none, since there is one half"
            )

    @property
    def json(self) -> dict[str, Any]:
        """The same as a browser gets and sends it."""
        edits = {str(number): dict(edit) for number, edit in self.edits.items()}
        return {**asdict(self), "edits": edits}


def read_state(value: object) -> State:
    """Return the state that a browser sent; raises `ValueError`, which names the field."""
    table = dict(_table("state", value, State))
    table["halves"] = _halves(table["halves"])
    table["camera"] = _read("camera", table["camera"], Orbit)
    table["edits"] = _edits(table["edits"])
    table["pixel"] = _pixel(table["pixel"])
    if not isinstance(table["scene"], str):
        raise refuse("scene", table["scene"], "a name")
    return State(**table)


def _halves(value: object) -> tuple[Half, ...]:
    if not isinstance(value, list) or len(value) not in (1, 2):
        raise refuse("halves", value, "a list of one or two")
    return tuple(_read(f"halves[{number}]", half, Half) for number, half in enumerate(value))


def _edits(value: object) -> dict[int, Mapping[str, Any]]:
    if not isinstance(value, dict):
        raise refuse("edits", value, "an object")
    for number, edit in value.items():
        if not re.fullmatch("[0-9]{1,9}", number) or not isinstance(edit, dict):
            raise refuse("edits", {number: edit}, "an object for each number of a shape")
    return {int(number): edit for number, edit in value.items()}


def _pixel(value: object) -> tuple[int, int] | None:
    if value is None:
        return None
    if not isinstance(value, list) or len(value) != 2:
        raise refuse("pixel", value, "null, or a column and a row")
    column, row = (check_whole("pixel", number, 0, None) for number in value)
    return column, row


def _read(where: str, value: object, kind: type[T]) -> T:
    table = _table(where, value, kind)
    try:
        return kind(**table)
    except ValueError as error:
        raise ValueError(f"{where}.{error}") from None


def _table(where: str, value: object, kind: Any) -> Mapping[str, Any]:
    """The value, if it is an object with just the fields of a kind."""
    names = [field.name for field in fields(kind)]
    if not isinstance(value, dict) or set(value) != set(names):
        raise refuse(where, value, f"an object with {', '.join(names)}")
    return value
