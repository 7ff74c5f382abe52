"""Signed values as colours: white where there is none, red above, blue below."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

PERCENTILE = 99.5
"""Of the sizes that are not 0: where the colours end."""


def colour_end(values: Floats) -> float:
    """Return the size from which on colours are full; 1 where all values are 0 or not finite."""
    sizes = np.abs(values[np.isfinite(values) & (values != 0)])
    return float(np.percentile(sizes, PERCENTILE)) if sizes.size else 1.0


def signed_colours(values: Floats, end: float) -> Floats:
    """Return linear colours (height, width, 3) for values (height, width), full from ±end on.

    They are NaN where the value is.
    """
    share = np.clip(values / end, -1, 1)
    less = 1 - np.abs(share)
    return np.stack([np.where(share > 0, 1, less), less, np.where(share < 0, 1, less)], axis=-1)
