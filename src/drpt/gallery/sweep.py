"""The question whether explicit sampling keeps its advantage as surfaces get more specular."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from drpt.gallery.answers import Answer, Finding, Table, rounded
from drpt.gallery.charts import log_log
from drpt.gallery.figures import GLOSSY, MODE_NAMES
from drpt.gallery.parts import Part, coverage, with_material
from drpt.gallery.rendering import REFERENCE_SEED
from drpt.render import Mode
from drpt.scene import Phong

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from drpt.gallery.rendering import Darkroom
    from drpt.scene import Scene

QUESTION = "Does explicit sampling keep its advantage as surfaces get more specular?"
TEXT = """No. A direction towards the lamp is a good guess where a surface reflects into all
directions alike. The narrower the lobe, the fewer such directions lie in it, and the higher is the
reflection where they do: the mean stays, and the variance grows about in proportion to the
exponent. A direction out of the lobe, as implicit sampling takes it, gets the better the narrower
the lobe is. MIS weights each sample by how good a guess it is, and so follows the better of both.
Here the back wall of the glossy box changes its exponent, with 1 bounce: the lamp and its
reflection."""
MODES = (Mode.IMPLICIT, Mode.EXPLICIT, Mode.MIS)
EXPONENTS = tuple(round(10 ** (step / 2)) for step in range(11))
ALBEDO = 0.76
"""Of the back wall."""
BOUNCES = 1
SPP = 1024
SIZE = 64
"""Pixels along the sides: the variance is a mean over the wall, and needs no details."""
TAIL = 5
"""Exponents at the end, from which the growth is read."""
GROWTH = (0.8, 1.2)
"""What passes for proportional: the last variances come from a few bright samples."""
CLOSE = 1.25
"""MIS may have so many times the variance of the better one; its estimate is as uncertain."""


def sweep(darkroom: Darkroom) -> Answer:
    """Measure the variance of one sample, averaged over the back wall, for all exponents.

    Pixels at its edges are left out: a few samples of the lamp would decide about them.
    """
    from scipy.ndimage import binary_erosion

    scene = darkroom.scene(GLOSSY).resized(SIZE, SIZE)
    wall = binary_erosion(coverage(scene, Part.BACK_WALL) == 1)
    rows = [_variances(darkroom, scene, wall, exponent) for exponent in EXPONENTS]
    by_mode = {mode: [row[mode] for row in rows] for mode in MODES}
    names = {mode: MODE_NAMES.get(mode, str(mode)) for mode in MODES}
    return Answer(
        QUESTION,
        TEXT,
        _findings(by_mode),
        Table(
            "Variance of one sample on the back wall",
            ("exponent", *names.values()),
            tuple(
                (f"{exponent:,}", *(rounded(row[mode], 3) for mode in MODES))
                for exponent, row in zip(EXPONENTS, rows, strict=True)
            ),
        ),
        log_log(
            "Variance against exponent",
            "Phong exponent of the back wall",
            "variance of one sample",
            {
                names[mode]: list(zip(EXPONENTS, values, strict=True))
                for mode, values in by_mode.items()
            },
        ),
    )


def _variances(
    darkroom: Darkroom, scene: Scene, wall: NDArray[np.bool_], exponent: float
) -> dict[Mode, float]:
    """Variance of one independent sample in each mode."""
    painted = with_material(scene, Part.BACK_WALL, Phong(ALBEDO, exponent))
    reference = darkroom.render(painted, SPP, BOUNCES, Mode.MIS, seed=REFERENCE_SEED)
    truth = reference.image[wall].astype(np.float64)
    images = {
        mode: darkroom.render(painted, SPP, BOUNCES, mode, "independent").image for mode in MODES
    }
    return {mode: SPP * float(((x[wall] - truth) ** 2).mean()) for mode, x in images.items()}


def _findings(by_mode: dict[Mode, list[float]]) -> tuple[Finding, ...]:
    implicit, explicit, mis = (np.array(by_mode[mode]) for mode in MODES)
    gain = implicit / explicit
    crossed = int(np.argmax(gain < 1))
    slope = np.polyfit(np.log(EXPONENTS[-TAIL:]), np.log(explicit[-TAIL:]), 1)[0]
    excess = float((mis / np.minimum(implicit, explicit)).max())
    return (
        Finding(
            f"At exponent {EXPONENTS[0]} explicit sampling has {rounded(gain[0])} times less "
            "variance than implicit sampling.",
            bool(gain[0] > 1),
        ),
        Finding(
            f"The advantage ends between exponents {EXPONENTS[crossed - 1]:,} and "
            f"{EXPONENTS[crossed]:,}.",
            bool(gain[0] > 1 and (gain[crossed:] < 1).all()),
        ),
        Finding(
            f"At exponent {EXPONENTS[-1]:,} it has {rounded(1 / gain[-1])} times more.",
            bool(gain[-1] < 1),
        ),
        Finding(
            f"Its variance grows like the exponent to the power of {slope:.2f}.",
            bool(GROWTH[0] < slope < GROWTH[1]),
        ),
        Finding(
            f"MIS never has more than {excess:.2f} times the variance of the better of both.",
            excess < CLOSE,
        ),
    )
