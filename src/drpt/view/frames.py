"""Binary messages to browsers: a header in JSON, and what it is about."""

from __future__ import annotations

import json
import struct
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

ALIGNMENT = 8
"""What follows the header begins at a multiple of it, as typed arrays of browsers need it."""

ORDINARY_STOPS = 6
"""Half floats reach from 14 stops below 1 to 16 above, before they lose digits."""


def pack(header: Mapping[str, Any], payload: bytes) -> bytes:
    """Return a message: the header's length in 4 bytes, the header, padded with blanks, the rest.

    The length is little-endian, the header UTF-8; numbers in it are finite or None.
    """
    text = json.dumps(header, allow_nan=False).encode()
    text += b" " * (-(4 + len(text)) % ALIGNMENT)
    return struct.pack("<I", len(text)) + text + payload


def half_floats(image: NDArray[np.float32], stops: int = 0) -> bytes:
    """Return an image, times 2^-stops, as IEEE half floats, little-endian.

    What is too large for them is infinite.
    """
    with np.errstate(over="ignore"):
        return np.ldexp(image, -stops).astype("<f2").tobytes()


def stops_of(image: NDArray[np.float32]) -> int:
    """By how many stops an image is so bright, or so dark, that half floats would lose it; or 0."""
    mean = np.sum(image, where=np.isfinite(image), dtype=np.float64) / image.size
    stops = int(np.round(np.log2(mean))) if mean > 0 else 0
    return stops if abs(stops) > ORDINARY_STOPS else 0


def finite(value: float) -> float | None:
    """Return a number as JSON has it: None if it is not finite."""
    return float(value) if np.isfinite(value) else None
