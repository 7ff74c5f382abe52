"""What an answer is made of: findings that measurements decide, tables, curves and pictures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


class Finding(NamedTuple):
    """A claim with its numbers, and whether they bear it out."""

    text: str
    holds: bool


def rounded(value: float, digits: int = 2) -> str:
    """Return a number in a few digits that count, as people write it."""
    return f"{float(f'{value:.{digits}g}'):,g}"


class Table(NamedTuple):
    """Words and numbers in rows; the first of a row names it."""

    caption: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


class Shown(NamedTuple):
    """A picture for display: linear colours (height, width, 3)."""

    caption: str
    image: NDArray[np.floating]


@dataclass(frozen=True, eq=False)
class Answer:
    """A question of the course, and what the pictures say.

    Attributes
    ----------
    text
        Why it is so, in plain words.
    findings
        What was measured.
    chart
        An SVG, or nothing.
    """

    question: str
    text: str
    findings: tuple[Finding, ...]
    table: Table
    chart: str = ""
    pictures: tuple[Shown, ...] = ()
