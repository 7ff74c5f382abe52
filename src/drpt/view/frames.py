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


def pack(header: Mapping[str, Any], payload: bytes) -> bytes:
    """Return a message: the header's length in 4 bytes, the header, padded with blanks, the rest.

    The length is little-endian, the header UTF-8; numbers in it are finite or None.
    """
    text = json.dumps(header, allow_nan=False).encode()
    text += b" " * (-(4 + len(text)) % ALIGNMENT)
    return struct.pack("<I", len(text)) + text + payload


def half_floats(image: NDArray[np.float32]) -> bytes:
    """Return an image as IEEE half floats, little-endian; what is too large is infinite."""
    with np.errstate(over="ignore"):
        return image.astype("<f2").tobytes()


def finite(value: float) -> float | None:
    """Return a number as JSON has it: None if it is not finite."""
    return float(value) if np.isfinite(value) else None
