"""Pictures and metadata that the tests of output share."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

METADATA: dict[str, str | int | float] = {
    "scene": "cornell-box",
    "mode": "explicit",
    "comment": "",
    "spp": 256,
    "seed": -1,
    "rays": 2**40 + 1,
    "seconds": 0.1,
    "tiny": 5e-324,
    "text that looks like a number": "12",
    "text that looks like JSON": '{"a": [true]}',
    "quoted": '"12"',
    "name": "Küche\nλ",
    "name that is no Unicode": os.fsdecode(b"k\xfcche"),
}


def grey(value: float) -> NDArray[np.float32]:
    return np.full((2, 2, 3), value, np.float32)
