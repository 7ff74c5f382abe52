"""Sizes of files and of memory, as messages tell them."""

from __future__ import annotations

_UNITS = ("bytes", "kB", "MB", "GB", "TB", "PB", "EB")


def in_words(size: int) -> str:
    """Return a number of bytes in decimal units, with four digits."""
    power = min((len(str(size)) - 1) // 3, len(_UNITS) - 1)
    return f"{size / 1000**power:.4g} {_UNITS[power]}"
