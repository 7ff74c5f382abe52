"""Changes of valid files that fuzzers share."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from random import Random

NUMBERS = (0, 1, -1, 2, 3, 255, 256, 2**15, 2**16, 2**31 - 1, 2**31, 2**32 - 1, 2**63, 10**30)
"""Integers at which formats and programs differ."""
HUGE = ("9" * 5000, "0x" + "f" * 5000)
"""Integers of thousands of digits."""
WORDS = ("", "0", "-1", "1e400", "nan", "inf", "-inf", *HUGE, "\0", "\x1b[31m")
"""Texts that stand for numbers or names in files of text."""


def mutate_bytes(content: bytes, random: Random, changes: int = 1) -> bytes:
    """Change, remove, repeat or add some bytes at random places."""
    data = bytearray(content)
    for _ in range(changes):
        start = random.randrange(len(data) + 1)
        stop = min(len(data), start + random.choice((1, 2, 4, 16, 256)))
        match random.randrange(6):
            case 0:
                data[start:stop] = random.randbytes(stop - start)
            case 1 if start < len(data):
                data[start] ^= 1 << random.randrange(8)
            case 2:
                del data[start:stop]
            case 3:
                data[start:start] = data[start:stop]
            case 4:
                data[start:stop] = bytes([random.choice((0, 1, 0x7F, 0x80, 0xFF))]) * (stop - start)
            case 5 if random.random() < 0.2:
                del data[start:]
    return bytes(data)


def mutate_integer(content: bytes, random: Random, size: int = 4) -> bytes:
    """Replace a little-endian integer somewhere by one of `NUMBERS`."""
    start = random.randrange(max(1, len(content) - size))
    value: int = random.choice(NUMBERS) % 2 ** (8 * size)
    return content[:start] + value.to_bytes(size, "little") + content[start + size :]


def mutate_words(text: str, random: Random, words: tuple[str, ...] = WORDS) -> str:
    """Replace, remove, swap or repeat a word of a text, or one of its lines."""
    separator = random.choice((" ", "\n", None))
    parts = list(text) if separator is None else text.split(separator)
    place = random.randrange(len(parts)) if parts else 0
    match random.randrange(4):
        case 0:
            parts[place : place + 1] = [random.choice(words)]
        case 1:
            del parts[place : place + 1]
        case 2:
            parts[place:place] = parts[place : place + 1] * random.choice((1, 2, 50))
        case 3 if len(parts) > 1:
            other = random.randrange(len(parts))
            parts[place], parts[other] = parts[other], parts[place]
    return (separator or "").join(parts)
