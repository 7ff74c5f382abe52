"""A case of the stress suite: a parameter swept over its range, an expected value, a bound."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

Measure: TypeAlias = Callable[[float, int], float]
"""Error at a value of the parameter, with so many samples."""

QUICK_SHARE = 2**-4
"""Of the samples, where only the quick values are asked for."""


@dataclass(frozen=True)
class Case:
    """One sweep.

    Attributes
    ----------
    name, parameter
        What is measured, and what is swept.
    values, quick
        Of the parameter, and those among them for a quick run.
    error
        Relative error of drpt, or what else should be 0, as the share of rays that go wrong.
    bound, reason
        What the error may be, and why.
    naive
        What naive float32 code does here.
    samples, long
        Samples or rays for each value; the same in a long run, where that has more. 0 if they are
        the parameter.
    mitsuba
        The same error of Mitsuba, where it is cheap to have.
    """

    name: str
    parameter: str
    values: tuple[float, ...]
    quick: tuple[float, ...]
    error: Measure
    bound: float
    reason: str
    naive: str
    samples: int = 2**20
    long: int = 0
    mitsuba: Measure | None = None


@dataclass(frozen=True)
class Point:
    """What was measured of a case at one value."""

    case: Case
    value: float
    samples: int
    error: float
    mitsuba: float | None

    @property
    def passed(self) -> bool:
        """Whether the error is within the bound; not a number never is."""
        return self.error <= self.case.bound


def run(
    case: Case, *, quick: bool = False, long: bool = False, with_mitsuba: bool = True
) -> Iterator[Point]:
    """Measure a case at each of its values; Mitsuba gets no more samples for a long run."""
    plain = int(case.samples * QUICK_SHARE) if quick else case.samples
    samples = max(plain, case.long) if long else plain
    for value in case.quick if quick else case.values:
        beside = case.mitsuba(value, plain) if with_mitsuba and case.mitsuba else None
        yield Point(case, value, samples, _error(case, value, samples), beside)


def _error(case: Case, value: float, samples: int) -> float:
    """With the arithmetic of renders, also where a case calls parts of their kernels."""
    from drpt.kernel.arithmetic import same_bits

    with same_bits():
        return case.error(value, samples)


HEADER = (
    "| case | parameter | samples | relative error | bound | pass | Mitsuba |\n"
    "|---|---|--:|--:|--:|---|--:|"
)


def row(point: Point) -> str:
    """A line of the Markdown table under `HEADER`."""
    cells = (
        point.case.name,
        f"{point.case.parameter} = {point.value:g}",
        f"{point.samples:.1e}" if point.samples else "",
        f"{point.error:.1e}",
        f"{point.case.bound:g}",
        "yes" if point.passed else "**no**",
        "" if point.mitsuba is None else f"{point.mitsuba:.1e}",
    )
    return f"| {' | '.join(cells)} |"


def notes(cases: Iterable[Case]) -> str:
    """A Markdown list of what bounds the error of each case, and what naive code does."""
    return "\n".join(
        f"- **{case.name}**: within {case.bound:g}, {case.reason}. Naive code: {case.naive}."
        for case in cases
    )


FLOOR = 1e-9
"""Where plots show an error of 0."""


def plot(points: list[Point], folder: Path) -> None:
    """Draw the errors of a case's sweep against its parameter, as a PNG named after the case."""
    from matplotlib.figure import Figure

    case = points[0].case
    figure = Figure(figsize=(6, 4), dpi=100, layout="constrained")
    axes = figure.subplots()
    values = [point.value for point in points]
    errors = [max(point.error, FLOOR) for point in points]
    beside = [max(point.mitsuba, FLOOR) for point in points if point.mitsuba is not None]
    bound = max(case.bound, FLOOR)
    if beside:
        axes.plot(values, beside, "C1s-", ms=4, label="Mitsuba")
    axes.plot(values, errors, "C0o-", ms=4, label="drpt")
    axes.axhline(bound, color="0.3", lw=1, ls="--", label="bound")
    top = 2 * max(*errors, *beside, bound)
    axes.set(ylim=(FLOOR / 2, top), xscale="log", yscale="log")
    axes.set(xlabel=case.parameter, ylabel="relative error", title=case.name)
    axes.legend(frameon=False)
    name = re.sub(r"[^\w.+]+", "-", case.name)
    figure.savefig(folder / f"{name}.png")
