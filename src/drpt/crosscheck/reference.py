"""References from Mitsuba, with their errors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from drpt.crosscheck.convert import to_mitsuba
from drpt.crosscheck.variant import scoped_variant

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from drpt.scene import Scene

PASSES = 16
"""Independent passes of a reference: as many as tell its standard error to a fifth."""


def reference(
    scene: Scene, spp: int, bounces: int = 3, seed: int = 0
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Render a scene in Mitsuba, in its variant ``llvm_ad_rgb``.

    Parameters
    ----------
    scene, bounces
        What to render; see :func:`drpt.crosscheck.to_mitsuba`.
    spp
        Samples per pixel, a multiple of `PASSES`; a pass takes 2³² samples at the most, all in all.
    seed
        Whole number ≥ 0; another one gives other noise.

    Returns
    -------
    mean, standard_error
        Of the passes' images, (height, width, 3). Pixels are independent of each other.

    Raises
    ------
    ValueError
        ``spp`` is not allowed.
    drpt.kernel.backend.BackendError
        No usable libLLVM was found.
    """
    if spp < PASSES or spp % PASSES:
        raise ValueError(f"spp: {spp!r} is not allowed; it must be a multiple of {PASSES}")
    seeds = np.random.SeedSequence(seed).generate_state(PASSES)
    with scoped_variant() as mi:
        copy = to_mitsuba(scene, bounces)
        images = np.array(
            [
                mi.render(copy, spp=spp // PASSES, seed=mi.UInt32(int(word))).numpy()
                for word in seeds
            ],
            np.float64,
        )
    return images.mean(axis=0), images.std(axis=0, ddof=1) / np.sqrt(PASSES)
