"""FLIP: how different two pictures look to people who flip between them.

Source: Andersson et al. 2020, "FLIP: A Difference Evaluator for Alternating Images", by their own
implementation, the package ``flip-evaluator``, which is optional.
"""

from __future__ import annotations

from importlib.util import find_spec
from typing import TYPE_CHECKING

import numpy as np

from drpt.output import to_display

if TYPE_CHECKING:
    from numpy.typing import NDArray


def has_flip() -> bool:
    """Whether the package is installed."""
    return find_spec("flip_evaluator") is not None


def mean_flip(image: NDArray[np.float64], reference: NDArray[np.float64]) -> float:
    """Mean FLIP of an image against a reference, from 0, the same, to 1.

    Both are linear radiance (height, width, 3); they are compared as a PNG would show them.
    """
    import flip_evaluator

    pair = (to_display(i).astype(np.float32) / 255 for i in (reference, image))
    _, mean, _ = flip_evaluator.evaluate(*pair, "LDR", applyMagma=False)
    return float(mean)
