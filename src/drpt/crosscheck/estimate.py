"""Images with the errors that they say they have, from independent passes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from drpt.crosscheck.convert import to_mitsuba
from drpt.crosscheck.variant import scoped_variant
from drpt.immutable import Immutable
from drpt.kernel import backend
from drpt.render import Mode, Rendering

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from typing import Any

    from numpy.typing import NDArray

    from drpt.scene import Scene

    OnPass = Callable[[int], None]

PASSES = 64
"""Independent passes of an estimate: enough to know each pixel's error to 9 %."""
MAX_SPP = 2**30
FILM_SPP = 256
"""Samples that Mitsuba's film adds up at a time, in float32: 1024 are off by 1e-5 already."""
LAUNCH_PATHS = 2**24
"""Paths of a launch, where a pass has no more than that."""


@dataclass(frozen=True, eq=False)
class Estimate(Immutable):
    """An image that is the mean of independent passes.

    Attributes
    ----------
    mean
        Linear radiance, float64 (height, width, 3), row 0 at the top.
    variance
        Variance of that mean, estimated from the passes; float64 (height, width, 3). Pixels are
        independent of each other. Not a number where it is unknown.
    passes, spp
        How many passes, and how many samples each pixel has got in all of them. No passes and
        variance 0 stand for an exact image.
    """

    mean: NDArray[np.float64]
    variance: NDArray[np.float64]
    passes: int
    spp: int

    @property
    def is_noise_known(self) -> bool:
        """Whether every variance is a number."""
        return not np.isnan(self.variance).any()


def measure(
    scene: Scene,
    spp: int,
    bounces: int = 3,
    mode: str = Mode.MIS,
    *,
    sampler: str = "sobol",
    seed: int = 0,
    on_pass: OnPass = lambda passes: None,
) -> Estimate:
    """Render a scene with drpt, in `PASSES` independent passes.

    Parameters are those of :func:`drpt.render`, but ``spp`` is a multiple of `PASSES`; for
    ``on_pass`` see :func:`reference`. Raises `ValueError` like it.
    """
    per_pass = check_spp(spp) // PASSES
    with backend.interrupts_put_off():
        launcher = Rendering(scene, per_pass, bounces, mode, sampler=sampler).launcher
    pixels = range(scene.camera.width * scene.camera.height)
    at_once = max(1, LAUNCH_PATHS // (len(pixels) * per_pass))

    def sums() -> Iterator[NDArray[np.float64]]:
        for first in range(0, PASSES, at_once):
            group = range(first, min(first + at_once, PASSES))
            with backend.interrupts_put_off():
                passes = launcher.launch_passes(pixels, range(per_pass), group, seed).radiance
            yield from passes

    return _estimate(scene, spp, sums(), on_pass)


def reference(
    scene: Scene,
    spp: int,
    bounces: int = 3,
    seed: int = 0,
    *,
    on_pass: OnPass = lambda passes: None,
) -> Estimate:
    """Render a scene with Mitsuba, in `PASSES` passes, in its variant ``llvm_ad_rgb``.

    Its sampler is the independent one: the means of ``ldsampler`` are off by 0.05 % in a Cornell
    box, those of ``multijitter`` with 4 samples a pass by up to 1.5 % among several lights.

    Parameters
    ----------
    scene, bounces
        What to render; see :func:`drpt.crosscheck.to_mitsuba`.
    spp
        Samples per pixel, a multiple of `PASSES`.
    seed
        Whole number ≥ 0; another one gives other noise.
    on_pass
        Called after each pass with the number of passes done.

    Raises
    ------
    ValueError
        ``spp`` is not allowed.
    drpt.kernel.backend.BackendError
        No usable libLLVM was found.
    """
    per_pass = check_spp(spp) // PASSES
    with scoped_variant() as mi:
        with backend.interrupts_put_off():
            copy = to_mitsuba(scene, bounces)
        shares = [min(FILM_SPP, per_pass - first) for first in range(0, per_pass, FILM_SPP)]

        def render(spp: int, word: int) -> NDArray[np.float64]:
            with backend.interrupts_put_off():
                image: Any = mi.render(copy, spp=spp, seed=mi.UInt32(int(word)))
            return np.array(image, np.float64).reshape(-1, 3) * spp

        def sums() -> Iterator[NDArray[np.float64]]:
            words = np.random.SeedSequence(seed).generate_state(PASSES * len(shares))
            for group in words.reshape(PASSES, -1):
                yield np.sum([render(*part) for part in zip(shares, group, strict=True)], axis=0)

        return _estimate(scene, spp, sums(), on_pass)


def check_spp(spp: int) -> int:
    """Return the samples per pixel of an estimate, or raise `ValueError` if not allowed."""
    whole = isinstance(spp, int | np.integer) and not isinstance(spp, bool)
    if not whole or not PASSES <= spp <= MAX_SPP or spp % PASSES:
        allowed = f"a multiple of {PASSES} up to {MAX_SPP}"
        raise ValueError(f"spp: {spp!r} is not allowed; it must be {allowed}")
    return int(spp)


def _estimate(
    scene: Scene, spp: int, sums: Iterator[NDArray[np.float64]], on_pass: OnPass
) -> Estimate:
    """Take the mean and its variance of the sums of equal passes, (pixels, 3) each.

    Source: Welford 1962, "Note on a Method for Calculating Corrected Sums of Squares and Products".
    """
    camera = scene.camera
    shape = camera.height, camera.width, 3
    mean, spread = np.zeros(shape), np.zeros(shape)
    with np.errstate(invalid="ignore"):  # an infinite sample leaves a spread that is NaN
        for number, radiance in enumerate(sums, start=1):
            deviation = radiance.reshape(shape) * (PASSES / spp) - mean
            mean += deviation / number
            spread += deviation**2 * (1 - 1 / number)
            on_pass(number)
    return Estimate(mean, spread / ((PASSES - 1) * PASSES), PASSES, spp)
