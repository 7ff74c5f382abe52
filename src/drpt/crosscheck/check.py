"""Checks of drpt's pictures against references, and their reports."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from drpt.crosscheck.compare import Comparison, compare
from drpt.crosscheck.estimate import measure
from drpt.crosscheck.flip import has_flip, mean_flip
from drpt.crosscheck.maps import save_maps
from drpt.crosscheck.references import SPP, Reference
from drpt.immutable import immutable
from drpt.render import Mode
from drpt.scene import Phong, Scene
from drpt.scene.saving import to_toml

if TYPE_CHECKING:
    from os import PathLike
    from pathlib import Path

    from numpy.typing import NDArray

    from drpt.crosscheck.estimate import OnPass
    from drpt.crosscheck.stored import Metadata

TELLING = 0.01
"""Difference of the means, relative, that a check must be able to detect to say "agrees"."""
MIN_EVENTS = 1000
"""Samples of the rarest kind that matters: fewer do not tell how much they vary."""
RARE = "the samples that meet sharp lobes are too few to tell how much they vary"
FEW = "with {:.2g} times the samples in both pictures, a difference of {:g} % would show"
UNKNOWN = "the reference does not tell its noise, so no difference can be told from it"


class Verdict(StrEnum):
    """What a check says of a picture."""

    AGREES = "agrees"
    DIFFERS = "differs"
    CANNOT_TELL = "cannot tell"

    PASS = AGREES
    """An alias, as are the next two."""
    FAIL = DIFFERS
    OPEN = CANNOT_TELL


@dataclass(frozen=True, eq=False)
class Report:
    """A picture by one mode, held against a reference.

    Attributes
    ----------
    mode, sampler
        How the picture was made.
    reference
        What it was held against.
    comparison
        Both images, and the tests.
    flip
        Mean FLIP, from 0 to 1, for the eye; None without the package ``flip-evaluator``.
    """

    mode: Mode
    sampler: str
    reference: Reference
    comparison: Comparison
    flip: float | None

    @property
    def verdict(self) -> Verdict:
        """Whether the picture has the reference's expectation, as far as can be told."""
        if not self.comparison.passed:
            return Verdict.DIFFERS
        test = self.comparison.of_image
        telling = test.resolved & (test.detectable <= TELLING * np.abs(test.reference))
        return Verdict.AGREES if telling.all() else Verdict.CANNOT_TELL

    @property
    def more_samples(self) -> float:
        """How many times the samples of both pictures it takes to detect `TELLING`.

        Infinite where samples do not help: in black pictures, and beyond the reference's own error.
        """
        test = self.comparison.of_image
        if not np.all(test.reference):
            return np.inf
        known = self.reference.tolerance * np.abs(test.reference)
        left = TELLING * np.abs(test.reference) - known
        if not (left > 0).all():
            return np.inf
        return float(np.square((test.detectable - known) / left).max())

    def __str__(self) -> str:
        lines = [self._row("mean", "drpt", "reference", "difference", "std. error", "detects")]
        test = self.comparison.of_image
        columns = test.mean, test.reference, test.difference, test.standard_error, test.detectable
        for channel, (ours, theirs, *rest) in zip("RGB", zip(*columns, strict=True), strict=True):
            shares = (f"{_percent(value, theirs)} %" for value in rest)
            lines.append(self._row(channel, f"{ours:.6g}", f"{theirs:.6g}", *shares))
        lines.append(f"  means    {self._means()}")
        lines.append(f"  blocks   {self._blocks()}")
        if self.flip is not None:
            lines.append(f"  FLIP     {self.flip:.4f}")
        if not test.resolved:
            lines.append(f"  {RARE if self.reference.estimate.is_noise_known else UNKNOWN}")
        elif self.verdict is Verdict.CANNOT_TELL and self.more_samples < np.inf:
            lines.append(f"  {FEW.format(self.more_samples, 100 * TELLING)}")
        spp = self.comparison.image.spp
        return "\n".join([f"{self.mode}, {self.sampler}, {spp} spp: {self.verdict}", *lines])

    def save(self, folder: str | PathLike[str]) -> list[Path]:
        """Write both pictures and maps of their differences into a folder; return their paths.

        See :func:`drpt.crosscheck.maps.save_maps`. Each picture has its noise, its bounces and its
        scene, as a reference must.
        """
        scene = to_toml(self.reference.scene)
        common: Metadata = {"bounces": self.reference.bounces, "scene": scene}
        renderer = self.reference.renderer
        return save_maps(
            self.comparison,
            folder,
            f"{self.mode}-{self.reference.bounces}-",
            image_metadata={**common, "mode": str(self.mode), "sampler": self.sampler},
            reference_metadata={**common, **({"renderer": renderer} if renderer else {})},
        )

    @staticmethod
    def _row(name: str, *cells: str) -> str:
        return f"  {name:8}" + "".join(f"{cell:>13}" for cell in cells)

    def _means(self) -> str:
        p_value = self.comparison.of_image.p_value
        if np.isnan(p_value):
            return "not compared"
        edges = self.comparison.of_blocks.p_map.size - self.comparison.of_image.pixels
        left_out = f", without {edges} pixels at the edges of lights" if edges else ""
        return f"p = {p_value:.2g}{left_out}"

    def _blocks(self) -> str:
        test = self.comparison.of_blocks
        if test.worst is None:
            black = not (self.comparison.image.mean.any() or self.reference.estimate.mean.any())
            return "both are black" if black else "none is certain enough to be compared"
        parts = [
            f"p = {test.p_value:.2g}, {100 * test.passing:.4g} % of the pixels pass",
            f"worst: {test.worst} ({test.worst.errors:+.3g} standard errors)",
        ]
        if test.side:
            size = "one pixel" if test.side == 1 else f"{test.side}x{test.side} pixels"
            parts.append(
                f"{test.comparisons} compared; {100 * test.detectable:.2g} % would show in {size}"
            )
        return "\n           ".join(parts)


def check(
    against: Reference,
    mode: str = Mode.MIS,
    spp: int = SPP,
    *,
    sampler: str = "sobol",
    seed: int = 0,
    on_pass: OnPass = lambda passes: None,
) -> Report:
    """Render a scene with drpt, and compare the picture with a reference.

    Parameters
    ----------
    against
        The reference, from :func:`render_reference` or :func:`stored_reference`.
    mode, spp, sampler, seed
        How drpt renders; ``spp`` is a multiple of 64.
    on_pass
        Called after each pass with the number of passes done.

    Raises
    ------
    ValueError
        A setting is not allowed.
    drpt.kernel.backend.BackendError
        Neither a usable libLLVM nor CUDA was found.
    """
    scene, bounces = against.scene, against.bounces
    image = measure(scene, spp, bounces, mode, sampler=sampler, seed=seed, on_pass=on_pass)
    edges = light_edges(scene, spp) if bounces else None
    comparison = compare(
        image,
        against.estimate,
        edges=edges,
        tolerance=against.tolerance,
        min_samples=samples_needed(scene, bounces, Mode(mode)),
    )
    flip = mean_flip(image.mean, against.estimate.mean) if has_flip() else None
    return Report(Mode(mode), sampler, against, comparison, flip)


def samples_needed(scene: Scene, bounces: int, mode: Mode) -> int:
    """How many samples must have been drawn to tell how much they vary, if that matters.

    Of directions that know nothing of a lobe of exponent α, as few as one in α + 1 meet it, and
    those weigh as much; of k of them one after the other, one in (α + 1)^k. Such are the directions
    to sampled points of lights, where no MIS weighs them, and uniform ones.
    """
    lobes = [s.material.exponent for s in scene.shapes if isinstance(s.material, Phong)]
    if not lobes or mode in (Mode.IMPLICIT, Mode.MIS, Mode.GUIDED):
        return 0
    choices = min(bounces, 1) if mode.samples_brdf else bounces
    return int(MIN_EVENTS * (int(max(lobes)) + 1) ** choices)


@lru_cache(maxsize=1)  # the modes of a check share them
def light_edges(scene: Scene, spp: int) -> NDArray[np.bool_]:
    """Pixels (height, width) that show the edge of a light, as far as so many samples tell."""
    return immutable(measure(scene, spp, 0).variance.max(axis=2) > 0)


def _percent(value: float, whole: float) -> str:
    return f"{100 * value / whole:.4f}" if whole and not np.isnan(value) else "-"
