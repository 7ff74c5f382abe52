"""Pictures of a comparison, to find by eye what the tests have found."""

from __future__ import annotations

from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from drpt.crosscheck.colours import colour_end, signed_colours
from drpt.crosscheck.compare import SIGNIFICANCE, sidak
from drpt.crosscheck.stored import save_estimate
from drpt.output import write

if TYPE_CHECKING:
    from os import PathLike

    from numpy.typing import NDArray

    from drpt.crosscheck.compare import Comparison
    from drpt.crosscheck.stored import Metadata

    Floats = NDArray[np.float64]

FAILED = (1.0, 0.0, 0.0)
NAMES = ("image", "reference", "difference", "p-value")


def save_maps(
    comparison: Comparison,
    folder: str | PathLike[str],
    prefix: str = "",
    *,
    image_metadata: Metadata = MappingProxyType({}),
    reference_metadata: Metadata = MappingProxyType({}),
) -> list[Path]:
    """Write the pictures into a folder, which is made if it is missing; return their paths.

    As float32 EXR: ``image`` and ``reference``, with their noise and metadata, so that each can be
    the reference of another check; ``difference`` (signed, image − reference) and ``p-value`` (the
    least of the blocks that hold a pixel). And for the eye, as PNG: both pictures, ``difference``
    (red where the image is too bright, blue where it is too dark) and ``p-value`` (white 1, darker
    the smaller; red where the test fails).
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    image, reference = comparison.image.mean, comparison.reference.mean
    signed = (image - reference).mean(axis=2)
    test = comparison.of_blocks
    limit = sidak(SIGNIFICANCE, max(test.comparisons, 1))
    arrays = {
        "image.png": image,
        "reference.png": reference,
        "difference.exr": image - reference,
        "difference.png": signed_colours(signed, colour_end(signed)),
        "p-value.exr": _grey(test.p_map),
        "p-value.png": _p_colours(test.p_map, limit),
    }
    estimates = {
        "image.exr": (comparison.image, image_metadata),
        "reference.exr": (comparison.reference, reference_metadata),
    }
    for name, (estimate, metadata) in estimates.items():
        save_estimate(estimate, folder / f"{prefix}{name}", metadata)
    for name, values in arrays.items():
        write(folder / f"{prefix}{name}", values.astype(np.float32), {})
    return [folder / f"{prefix}{name}{suffix}" for name in NAMES for suffix in (".exr", ".png")]


def _p_colours(p_value: Floats, limit: float) -> Floats:
    """Grey by the logarithm, from white at 1 to black at the limit; red below."""
    shade = 1 - np.log(np.maximum(p_value, limit)) / np.log(limit)
    return np.where((p_value < limit)[..., None], FAILED, _grey(shade))


def _grey(values: Floats) -> Floats:
    return np.repeat(values[..., None], 3, axis=2)
