"""The question why more bounces make the picture brighter and noisier."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from drpt.error import DARK
from drpt.gallery.answers import Answer, Finding, Shown, Table
from drpt.gallery.figures import DIFFUSE, Setting
from drpt.gallery.parts import Part, coverage
from drpt.render import Mode

if TYPE_CHECKING:
    from drpt.gallery.rendering import Darkroom

QUESTION = "Why do more bounces make the picture brighter and noisier?"
TEXT = """Each further bounce adds the light of longer paths. Light is never negative, so the
picture can only get brighter, and as walls absorb a part of all light, each bounce adds less than
the one before. A longer path also takes one more random direction: what it adds varies from sample
to sample, and so does the sum. The lamp itself is left out of these numbers, as its edge is noisy
with any number of bounces."""
BOUNCES = (2, 3, 4)
AMPLIFICATION = 4
"""Of the light that a bounce adds, to be seen."""
WAYS = ((Mode.IMPLICIT, 1024), (Mode.EXPLICIT, 10))
"""Of which the pictures with independent samples are measured: their errors are variances."""


def brightness(darkroom: Darkroom) -> Answer:
    """Measure means and noise of the diffuse box."""
    no_lamp = coverage(darkroom.scene(DIFFUSE), Part.LAMP) == 0
    references = [darkroom.reference(DIFFUSE, bounces).image for bounces in BOUNCES]
    truths = [reference[no_lamp].astype(np.float64) for reference in references]
    means = [float(truth.mean()) for truth in truths]
    noise, relative = {}, {}
    for mode, spp in WAYS:
        settings = [Setting(DIFFUSE, mode, "independent", spp, bounces) for bounces in BOUNCES]
        images = [darkroom.picture(setting).image[no_lamp] for setting in settings]
        squares = [(image - truth) ** 2 for image, truth in zip(images, truths, strict=True)]
        noise[f"{mode}, {spp} spp"] = [float(np.sqrt(square.mean())) for square in squares]
        relative[f"{mode}, {spp} spp"] = [
            float((square / (truth**2 + DARK)).mean())
            for square, truth in zip(squares, truths, strict=True)
        ]
    return Answer(
        QUESTION,
        TEXT,
        _findings(means, noise, relative),
        _table(means, noise, relative),
        pictures=tuple(
            Shown(
                f"What bounce {number} adds, {AMPLIFICATION} times as bright", AMPLIFICATION * light
            )
            for number, light in zip(BOUNCES[1:], np.diff(references, axis=0), strict=True)
        ),
    )


def _findings(
    means: list[float], noise: dict[str, list[float]], relative: dict[str, list[float]]
) -> tuple[Finding, ...]:
    steps = [later - earlier for earlier, later in pairwise(means)]
    brighter = ", then ".join(
        f"{100 * step / mean:.1f} %" for step, mean in zip(steps, means, strict=False)
    )
    implicit, explicit = relative.values()
    return (
        Finding(f"From 2 bounces on, each further one adds light: {brighter}.", min(steps) > 0),
        Finding("Each adds less than the one before.", _falls(steps)),
        *(
            Finding(f"The noise of {way} grows: RMSE {_arrow(values)}.", _falls(values[::-1]))
            for way, values in noise.items()
        ),
        Finding(
            "Beside the brightness, the noise of explicit sampling grows, too "
            f"(relMSE {_arrow(explicit)}).",
            _falls(explicit[::-1]),
        ),
        Finding(
            "That of implicit sampling does not: most of it is the luck of meeting the lamp, which "
            f"no bounce changes, while the picture gets brighter (relMSE {_arrow(implicit)}).",
            _falls(implicit),
        ),
    )


def _table(
    means: list[float], noise: dict[str, list[float]], relative: dict[str, list[float]]
) -> Table:
    rows = {
        "mean radiance": means,
        **{f"RMSE, {way}": values for way, values in noise.items()},
        **{f"relMSE, {way}": values for way, values in relative.items()},
    }
    return Table(
        "Diffuse box without the lamp, independent samples",
        ("", *(f"{bounces} bounces" for bounces in BOUNCES)),
        tuple((name, *(f"{value:.3g}" for value in values)) for name, values in rows.items()),
    )


def _falls(values: list[float]) -> bool:
    return all(later < earlier for earlier, later in pairwise(values))


def _arrow(values: list[float]) -> str:
    return " → ".join(f"{value:.3g}" for value in values)
