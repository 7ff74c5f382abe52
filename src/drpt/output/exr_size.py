"""Checks the size of the pictures in an EXR file by its header.

A small header can claim any size, and readers allocate memory before they find the pixels missing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from drpt.machine import require_memory
from drpt.messages import size_in_words

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    Header = Mapping[str, Any]

RATIOS = {"NO": 1, "RLE": 64, "ZIPS": 1032, "ZIP": 1032, "PXR24": 1376}
"""Largest compression ratio of each method: RLE stores a run of 127 bytes in 2, DEFLATE reaches
1032, and PXR24 drops one byte of four before DEFLATE."""
OTHER_RATIO = 2**17
"""Largest ratio of other methods; DWA compresses the mean of 64 half floats by DEFLATE."""
CHUNK = 16
"""Smallest size of a chunk in the file, in bytes: its offset, its first row and its size."""
MOST_ROWS = 256
"""Largest number of rows of a chunk."""
COPIES = 3
"""Number of copies of the pixels in memory while a picture is read."""
FLOAT = 4
"""Bytes of a value in memory."""
HALVES = 2
"""Ratio of bytes in memory to those of half floats in a file."""


def check_size(parts: Iterable[Header], file_size: int) -> None:
    """Raise `ValueError` unless a file can hold the pixels of its parts, and memory can, too."""
    needed = 0
    for header in parts:
        needed += _checked_size(header, file_size)
    require_memory(COPIES * needed, "its picture")


def _checked_size(header: Header, file_size: int) -> int:
    """Return the bytes that the pixels of a part take in memory."""
    if "deep" in str(header.get("type")):
        raise ValueError("it holds deep pixels, which are not read")
    (left, top), (right, bottom) = (corner.tolist() for corner in header["dataWindow"])
    width, height = right - left + 1, bottom - top + 1
    needed: int = width * height * len(header["channels"]) * FLOAT
    compression = str(header["compression"]).rpartition(".")[2].partition("_")[0]
    most = file_size * RATIOS.get(compression, OTHER_RATIO)
    if needed > HALVES * most or height * CHUNK > file_size * MOST_ROWS:
        size = f"{width}x{height} pixels in {len(header['channels'])} channels"
        raise ValueError(
            f"its header tells of {size}, {size_in_words(needed)}, "
            f"more than a file of {size_in_words(file_size)} can hold"
        )
    return needed
