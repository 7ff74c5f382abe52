"""Texts in messages: each is made one line of printable characters, and not too long."""

from __future__ import annotations

_UNITS = ("bytes", "kB", "MB", "GB", "TB", "PB", "EB")


def one_line(text: str) -> str:
    """Return a text as one line, with single spaces and unprintable characters escaped."""
    line = " ".join(text.split())
    if line.isprintable():
        return line
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in line)


def shortened(text: str, most: int) -> str:
    """Return a text of at most ``most`` characters; a longer one loses its middle."""
    if len(text) <= most:
        return text
    head = (most - 3) // 2
    return f"{text[:head]}...{text[len(text) - (most - 3 - head) :]}"


def size_in_words(size: int) -> str:
    """Return a number of bytes in decimal units, with four significant digits."""
    power = min((len(str(size)) - 1) // 3, len(_UNITS) - 1)
    return f"{size / 1000**power:.4g} {_UNITS[power]}"
