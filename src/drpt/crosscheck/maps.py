"""Pictures of a comparison, to find by eye what the tests have found."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from drpt.crosscheck.colours import colour_end, signed_colours
from drpt.crosscheck.compare import SIGNIFICANCE, sidak
from drpt.output import write

if TYPE_CHECKING:
    from os import PathLike

    from numpy.typing import NDArray

    from drpt.crosscheck.compare import Comparison

    Floats = NDArray[np.float64]

FAILED = (1.0, 0.0, 0.0)


def save_maps(comparison: Comparison, folder: str | PathLike[str], prefix: str = "") -> list[Path]:
    """Write the pictures into a folder, which is made if it is missing; return their paths.

    As float32 EXR: ``image``, ``reference``, ``difference`` (signed, image − reference) and
    ``p-value`` (the least of the blocks that hold a pixel). And for the eye, as PNG: both pictures,
    ``difference`` (red where the image is too bright, blue where it is too dark) and ``p-value``
    (white 1, darker the smaller; red where the test fails).
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    image, reference = comparison.image.mean, comparison.reference.mean
    signed = (image - reference).mean(axis=2)
    test = comparison.of_blocks
    limit = sidak(SIGNIFICANCE, max(test.comparisons, 1))
    maps = {
        "image": (image, image),
        "reference": (reference, reference),
        "difference": (image - reference, signed_colours(signed, colour_end(signed))),
        "p-value": (_grey(test.p_map), _p_colours(test.p_map, limit)),
    }
    paths = []
    for name, pair in maps.items():
        for suffix, values in zip((".exr", ".png"), pair, strict=True):
            paths.append(folder / f"{prefix}{name}{suffix}")
            write(paths[-1], values.astype(np.float32), {})
    return paths


def _p_colours(p_value: Floats, limit: float) -> Floats:
    """Grey by the logarithm, from white at 1 to black at the limit; red below."""
    shade = 1 - np.log(np.maximum(p_value, limit)) / np.log(limit)
    return np.where((p_value < limit)[..., None], FAILED, _grey(shade))


def _grey(values: Floats) -> Floats:
    return np.repeat(values[..., None], 3, axis=2)
