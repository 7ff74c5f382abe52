"""Checks of drpt's pictures against references, and their reports."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from importlib.metadata import version
from typing import TYPE_CHECKING

import numpy as np

from drpt.crosscheck.compare import Comparison, compare
from drpt.crosscheck.domain import caveats, tolerance
from drpt.crosscheck.estimate import Estimate, check_spp, measure, reference
from drpt.crosscheck.flip import has_flip, mean_flip
from drpt.crosscheck.stored import load_estimate
from drpt.crosscheck.variant import VARIANT
from drpt.render import Mode, Rendering
from drpt.scene import Mesh, Phong, Scene
from drpt.scene.saving import to_toml

if TYPE_CHECKING:
    from os import PathLike

    from numpy.typing import NDArray

    from drpt.crosscheck.estimate import OnPass

SPP = 1024
"""Samples per pixel of a check, if nothing else is asked for."""
TELLING = 0.01
"""Difference of the means, relative, that a check must be able to detect to say "pass"."""
MIN_EVENTS = 1000
"""Of the rarest samples that matter: fewer do not tell how much they vary."""
MITSUBA = "Mitsuba"
NORMALS = (
    "interpolated normals: Mitsuba looks at shading normals alone, drpt at both, so their pictures "
    "differ where the two disagree on the side of a direction"
)

UNIFORM = "uniform directions meet sharp lobes too seldom to tell how uncertain the picture is"


class Verdict(StrEnum):
    """What a check says of a picture."""

    PASS = "pass"
    FAIL = "FAIL"
    OPEN = "cannot tell"


@dataclass(frozen=True, eq=False)
class Reference:
    """What pictures of a scene are checked against.

    Attributes
    ----------
    scene
        The scene, with the camera's width and height of the reference.
    bounces
        With how many bounces.
    estimate
        The picture and its errors.
    source
        Where it comes from, for people.
    tolerance
        Its own relative error that is known; infinite where it may be anything.
    remarks
        Sentences on what it is not good for.
    """

    scene: Scene
    bounces: int
    estimate: Estimate
    source: str
    tolerance: float
    remarks: tuple[str, ...]

    def __str__(self) -> str:
        height, width, _ = self.estimate.mean.shape
        what = f"{width}x{height}, {self.bounces} bounce{'' if self.bounces == 1 else 's'}"
        return "\n".join([f"reference: {self.source}, {what}", *self.remarks])


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
        if not self.knows_its_errors:
            return Verdict.OPEN
        if not self.comparison.passed:
            return Verdict.FAIL
        test = self.comparison.of_image
        telling = test.detectable <= TELLING * np.abs(test.reference)
        return Verdict.PASS if telling.all() else Verdict.OPEN

    @property
    def knows_its_errors(self) -> bool:
        """Whether the image has samples enough to estimate its own errors.

        Of uniform directions, one in (α + 1) meets a lobe of exponent α, and weighs as much: of k
        of them one after the other, one in (α + 1)^k. Where these are hardly ever drawn, the image
        is too dark and seems more certain than it is.
        """
        scene, bounces = self.reference.scene, self.reference.bounces
        lobes = [s.material.exponent for s in scene.shapes if isinstance(s.material, Phong)]
        if self.mode.samples_brdf or not lobes:
            return True
        choices = bounces if self.mode.counts_hits else max(bounces - 1, 0)
        paths = scene.camera.width * scene.camera.height * self.comparison.image.spp
        return bool(paths >= MIN_EVENTS * (max(lobes) + 1) ** choices)

    def __str__(self) -> str:
        lines = [self._row("mean", "drpt", "reference", "difference", "std. error", "detects")]
        test = self.comparison.of_image
        columns = test.mean, test.reference, test.difference, test.standard_error, test.detectable
        for channel, (ours, theirs, *rest) in zip("RGB", zip(*columns, strict=True), strict=True):
            shares = (f"{_percent(value, theirs)} %" for value in rest)
            lines.append(self._row(channel, f"{ours:.6g}", f"{theirs:.6g}", *shares))
        lines.append(f"  means    p = {test.p_value:.2g}")
        lines.append(f"  blocks   {self._blocks()}")
        if self.flip is not None:
            lines.append(f"  FLIP     {self.flip:.4f}")
        if not self.knows_its_errors:
            lines.append(f"  {UNIFORM}")
        spp = self.comparison.image.spp
        return "\n".join([f"{self.mode}, {self.sampler}, {spp} spp: {self.verdict}", *lines])

    @staticmethod
    def _row(name: str, *cells: str) -> str:
        return f"  {name:8}" + "".join(f"{cell:>13}" for cell in cells)

    def _blocks(self) -> str:
        test = self.comparison.of_blocks
        if test.worst is None:
            return "none is certain enough to be compared"
        errors = (test.worst.mean - test.worst.reference) / test.worst.standard_error
        parts = [
            f"p = {test.p_value:.2g}, {test.passing:.5g} of the pixels pass",
            f"worst: {test.worst} ({errors:+.1f} standard errors)",
        ]
        if test.side:
            size = "one pixel" if test.side == 1 else f"{test.side}x{test.side} pixels"
            parts.append(
                f"{test.comparisons} compared, a median of {test.detectable:.2g} "
                f"would show in {size}"
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
    comparison = compare(image, against.estimate, edges=edges, tolerance=against.tolerance)
    flip = mean_flip(image.mean, against.estimate.mean) if has_flip() else None
    return Report(Mode(mode), sampler, against, comparison, flip)


def render_reference(
    scene: Scene,
    spp: int = SPP,
    bounces: int = 3,
    seed: int = 0,
    *,
    on_pass: OnPass = lambda passes: None,
) -> Reference:
    """Render a reference with Mitsuba; see :func:`drpt.crosscheck.reference`."""
    Rendering(scene, check_spp(spp), bounces, seed=seed)  # refuses what is not allowed
    estimate = reference(scene, spp, bounces, seed, on_pass=on_pass)
    source = f"{MITSUBA} {version('mitsuba')} ({VARIANT}), {spp} spp"
    return Reference(scene, bounces, estimate, source, tolerance(scene), _remarks(scene))


def stored_reference(
    scene: Scene, path: str | PathLike[str], bounces: int | None = None
) -> Reference:
    """Read a reference from an EXR file, with the variances that are a layer of it if there are.

    Without that layer it is taken as exact. The scene is rendered in its size.

    Parameters
    ----------
    scene
        The scene that the file shows.
    path
        The file.
    bounces
        How many there are in the file; by default what its metadata says, or else 3.

    Raises
    ------
    OSError, ValueError
        The file is unreadable, has the wrong shape or, it says, another number of bounces.
    """
    estimate, metadata = load_estimate(path)
    stored = metadata.get("bounces")
    if bounces is None:
        bounces = 3 if stored is None else int(stored)
    if stored not in (None, bounces):
        raise ValueError(f"bounces: {bounces} is not allowed; it must be {stored}, as in {path}")
    scene = _resized(scene, estimate, path)
    remarks = () if estimate.passes else (f"{path} tells no variances: it is taken as exact",)
    if metadata.get("scene") not in (None, to_toml(scene)):
        remarks = (*remarks, f"{path} was made of a scene that is not quite this one")
    if metadata.get("renderer") != MITSUBA:
        return Reference(scene, bounces, estimate, str(path), 0.0, remarks)
    remarks = (*remarks, *_remarks(scene))
    return Reference(scene, bounces, estimate, str(path), tolerance(scene), remarks)


def light_edges(scene: Scene, spp: int) -> NDArray[np.bool_]:
    """Pixels (height, width) that show the edge of a light, as far as so many samples tell."""
    return np.asarray(measure(scene, spp, 0).variance.max(axis=2) > 0)


def _resized(scene: Scene, estimate: Estimate, path: str | PathLike[str]) -> Scene:
    height, width, _ = estimate.mean.shape
    camera = scene.camera
    if width * camera.height != height * camera.width:
        raise ValueError(
            f"{path}: its size, {width}x{height}, has not the shape of the scene's "
            f"{camera.width}x{camera.height}"
        )
    return replace(scene, camera=replace(camera, width=width, height=height))


def _remarks(scene: Scene) -> tuple[str, ...]:
    shades = any(isinstance(s, Mesh) and s.normals is not None and s.material for s in scene.shapes)
    return (*map(str, caveats(scene)), *([NORMALS] if shades else []))


def _percent(value: float, whole: float) -> str:
    return f"{100 * value / whole:.4f}" if whole else "-"
