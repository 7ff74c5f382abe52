"""The question why fireflies stand on the ceiling of the glossy box, and what MIS does to them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from drpt.crosscheck.colours import signed_colours
from drpt.gallery.answers import Answer, Finding, Shown, Table, rounded
from drpt.gallery.figures import GLOSSY, MODE_NAMES, Setting
from drpt.gallery.parts import Part, coverage, with_material
from drpt.render import Mode
from drpt.scene import Diffuse

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from drpt.gallery.rendering import Darkroom

    Floats = NDArray[np.float64]
    Mask = NDArray[np.bool_]

QUESTION = "Why do fireflies stand on the right of the ceiling in the explicit glossy picture?"
TEXT = """They are caustics: light that the lamp sends to the large, polished box, and the box
to the ceiling, to the floor, or to a wall. A path runs the other way, from the eye to the ceiling
and on in a random direction. Few paths meet the box just so that it mirrors them into the lamp, and
explicit sampling weights those few with the full height of the lobe (exponent 1000): most samples
miss the caustic, and a few are bright spots. The box stands on the left of these pictures, at the
red wall, and its top mirrors the lamp to the ceiling above it: so the fireflies are on the left
here. In mirrored pictures, with the red wall on the right, they are on the right. MIS leaves those
paths to the direction that the box reflects into, which runs into the lamp, and weights the light
sample with next to nothing. What remains with every mode is the edge of the lamp, a ring in the
pictures below."""
BOUNCES, SPP = 4, 1024
FIREFLY = 0.2
"""Error, as a mean over the channels, from which a pixel counts as one; white is 1."""
END = 0.2
"""Error from which the colours of its picture are full."""
CAUSE_BOUNCES, CAUSE_SPP = 2, 256
"""Light, box, ceiling, eye: the caustic is there with 2 bounces, and its noise without truth."""
MANY = 0.5
MODES = (Mode.IMPLICIT, Mode.EXPLICIT, Mode.MIS)


def fireflies(darkroom: Darkroom) -> Answer:
    """Find the largest errors, and render once more without the polish."""
    errors = {mode: _error(darkroom, mode) for mode in MODES}
    scene = darkroom.scene(GLOSSY)
    shows = {part: coverage(scene, part) > MANY for part in Part}
    width = darkroom.size
    left = np.broadcast_to(np.arange(width) < width // 2, (width, width))
    return Answer(
        QUESTION,
        TEXT,
        (
            _where(errors[Mode.EXPLICIT], shows[Part.CEILING], left),
            _cause(darkroom, shows[Part.CEILING] & left),
            *_cure(errors),
        ),
        _table(errors, shows, left),
        pictures=tuple(_shown(mode, error) for mode, error in errors.items()),
    )


def _error(darkroom: Darkroom, mode: Mode) -> Floats:
    """Signed error, as a mean over the channels, of a picture of the gallery."""
    image = darkroom.picture(Setting(GLOSSY, mode, "sobol", SPP, BOUNCES)).image
    truth = darkroom.reference(GLOSSY, BOUNCES).image.astype(np.float64)
    error: Floats = (image - truth).mean(axis=2)
    return error


def _where(error: Floats, ceiling: Mask, left: Mask) -> Finding:
    squares = np.where(ceiling, error**2, 0)
    share = float(squares[left].sum() / squares.sum())
    spots = (error > FIREFLY) & ceiling
    return Finding(
        f"On the ceiling, {100 * share:.0f} % of the squared error and {(spots & left).sum()} of "
        f"{spots.sum()} fireflies are in the left half: not on the right, in these pictures.",
        share > MANY,
    )


def _cause(darkroom: Darkroom, place: Mask) -> Finding:
    """How much less noise there is where the box is not polished."""
    polished = darkroom.scene(GLOSSY)
    rough = with_material(polished, Part.LARGE_BOX, Diffuse(0.86))
    way = CAUSE_SPP, CAUSE_BOUNCES, Mode.EXPLICIT, "independent"
    runs = [darkroom.render(scene, *way) for scene in (polished, rough)]
    noise = [float(np.square(run.standard_error[place]).mean()) for run in runs]
    gain = noise[0] / noise[1]
    return Finding(
        "The polished box makes them: with a diffuse one in its place, the variance on the left of "
        f"the ceiling is about {rounded(gain)} times lower ({CAUSE_BOUNCES} bounces).",
        gain > 1,
    )


def _cure(errors: dict[Mode, Floats]) -> tuple[Finding, ...]:
    counts = {mode: int((error > FIREFLY).sum()) for mode, error in errors.items()}
    squares = {mode: float((error**2).mean()) for mode, error in errors.items()}
    gain = squares[Mode.EXPLICIT] / squares[Mode.MIS]
    return (
        Finding(
            f"With MIS {counts[Mode.MIS]} pixels are too bright by more than {FIREFLY:g}; "
            f"with explicit sampling {counts[Mode.EXPLICIT]}, with implicit sampling "
            f"{counts[Mode.IMPLICIT]}.",
            counts[Mode.MIS] < counts[Mode.EXPLICIT],
        ),
        Finding(
            f"The mean squared error of MIS is {rounded(gain)} times lower than that of explicit "
            "sampling.",
            gain > 1,
        ),
    )


def _table(errors: dict[Mode, Floats], shows: dict[Part, Mask], left: Mask) -> Table:
    """Where the error is: shares of the sum of its squares."""
    rows = []
    for part, mask in shows.items():
        for side, half in (("left", left), ("right", ~left)):
            place = mask & half
            shares = [
                100 * (error[place] ** 2).sum() / (error**2).sum() for error in errors.values()
            ]
            if place.any():
                cells = (100 * place.mean(), *shares)
                rows.append((f"{part}, {side}", *(f"{cell:.1f} %" for cell in cells)))
    modes = (f"error, {MODE_NAMES.get(mode, mode)}" for mode in errors)
    return Table(
        f"Where the squared error is, {BOUNCES} bounces", ("", "area", *modes), tuple(rows)
    )


def _shown(mode: Mode, error: Floats) -> Shown:
    name = MODE_NAMES.get(mode, mode)
    return Shown(
        f"Error of {name}: too bright is red, too dark blue, full from ±{END:g}",
        signed_colours(error, END),
    )
