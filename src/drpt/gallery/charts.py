"""Curves with logarithmic axes, as SVG that takes the colours of its page."""

from __future__ import annotations

from html import escape
from itertools import cycle
from math import ceil, floor, log10
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    Points = Sequence[tuple[float, float]]

WIDTH, HEIGHT = 690, 400
LEFT, RIGHT, TOP, BOTTOM = 70, 470, 20, 340
"""Edges of the area of the curves."""
DASHES = ("", "7 3", "2 3")
"""Curves differ in their dashes, too, for those who do not tell colours apart."""


class Axis:
    """Maps positive numbers to places, in whole decades."""

    def __init__(self, values: list[float], start: float, end: float) -> None:
        self._first = floor(log10(min(values)))
        self._last = max(ceil(log10(max(values))), self._first + 1)
        self._start, self._end = start, end

    def place(self, value: float) -> float:
        """Where a number stands."""
        share = (log10(value) - self._first) / (self._last - self._first)
        return self._start + share * (self._end - self._start)

    @property
    def decades(self) -> list[int]:
        """Exponents of the powers of ten."""
        return list(range(self._first, self._last + 1))


def log_log(title: str, x_label: str, y_label: str, curves: Mapping[str, Points]) -> str:
    """Draw curves by their names through points (x, y), all positive; others are left out."""
    drawn = {name: [p for p in points if min(p) > 0] for name, points in curves.items()}
    points = [point for curve in drawn.values() for point in curve]
    x = Axis([point[0] for point in points], LEFT, RIGHT)
    y = Axis([point[1] for point in points], BOTTOM, TOP)
    styles = cycle(DASHES)
    body = [
        _grid(x, y),
        *(
            _curve(number, name, [(x.place(a), y.place(b)) for a, b in curve], next(styles))
            for number, (name, curve) in enumerate(drawn.items())
        ),
        f'<text x="{(LEFT + RIGHT) / 2}" y="{HEIGHT - 15}" text-anchor="middle">'
        f"{escape(x_label)}</text>",
        f'<text transform="translate(16 {(TOP + BOTTOM) / 2}) rotate(-90)" text-anchor="middle">'
        f"{escape(y_label)}</text>",
    ]
    return (
        f'<svg class="chart" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" '
        f'aria-label="{escape(title)}">{"".join(body)}</svg>'
    )


def _grid(x: Axis, y: Axis) -> str:
    columns = (
        f'<path class="grid" d="M{x.place(10.0**n):.1f} {TOP}V{BOTTOM}"/>'
        f'<text x="{x.place(10.0**n):.1f}" y="{BOTTOM + 20}" text-anchor="middle">'
        f"{_power(n)}</text>"
        for n in x.decades
    )
    rows = (
        f'<path class="grid" d="M{LEFT} {y.place(10.0**n):.1f}H{RIGHT}"/>'
        f'<text x="{LEFT - 8}" y="{y.place(10.0**n) + 5:.1f}" text-anchor="end">{_power(n)}</text>'
        for n in y.decades
    )
    return "".join((*columns, *rows))


def _power(exponent: int) -> str:
    superscripts = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
    return f"10{str(exponent).translate(superscripts)}"


def _curve(number: int, name: str, places: Points, dash: str) -> str:
    """A curve, its points, and its line of the legend."""
    line = " ".join(f"{a:.1f},{b:.1f}" for a, b in places)
    marks = "".join(f'<circle cx="{a:.1f}" cy="{b:.1f}" r="3"/>' for a, b in places)
    height = TOP + 12 + 24 * number
    return (
        f'<g class="curve curve-{number}"><polyline points="{line}" stroke-dasharray="{dash}"/>'
        f'{marks}<path d="M{RIGHT + 15} {height}h28" stroke-dasharray="{dash}"/></g>'
        f'<text x="{RIGHT + 50}" y="{height + 5}">{escape(name)}</text>'
    )
