"""The page: one HTML file that holds its pictures and asks no network for anything."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.resources import files
from string import Template
from typing import TYPE_CHECKING

from drpt.distribution import VERSION
from drpt.gallery import markup
from drpt.gallery.answers import Table
from drpt.gallery.charts import log_log
from drpt.gallery.rendering import REFERENCE_SPP

if TYPE_CHECKING:
    from collections.abc import Sequence

    from drpt.gallery.answers import Answer
    from drpt.gallery.figures import Curve, Figure, Plan
    from drpt.gallery.rendering import Darkroom, Picture

NUMPY_PATHS_PER_SECOND = 0.0365e6
"""Of the float64 path tracer of the tests in the course's own pictures, on two cores of a Zen 4.
Source: ``python -m tests.gallery.course_in_numpy``."""


@dataclass(frozen=True)
class Page:
    """All that stands on the page.

    Attributes
    ----------
    answers
        Those that there are so far.
    seconds, cpu_seconds
        What all of it has taken: by the clock, and by the processors together.
    complete
        Whether everything of the plan is there.
    """

    plan: Plan
    darkroom: Darkroom
    answers: Sequence[Answer]
    seconds: float
    cpu_seconds: float
    complete: bool

    def html(self) -> str:
        """Return the page."""
        bodies = {
            **{figure.title: self._figure(figure) for figure in self.plan.figures},
            **{f"Error against time: {c.title}": self._curve(c) for c in self.plan.curves},
            **{answer.question: markup.answer(answer) for answer in self.answers},
        }
        sections = [
            (number, *item) for number, item in enumerate(bodies.items(), start=1) if item[1]
        ]
        return _template("page.html").substitute(
            style=_template("style.css").template,
            script=_template("zoom.js").template,
            size=self.plan.size,
            lead="\n".join(map(markup.paragraph, self._lead())),
            contents="\n".join(markup.link(number, title) for number, title, _ in sections),
            sections="\n".join(markup.section(*section) for section in sections),
            reference_spp=REFERENCE_SPP,
            version=VERSION,
        )

    def _lead(self) -> list[str]:
        """What it took, and what the course's own way takes."""
        darkroom, course = self.darkroom, self.plan.course
        numpy_seconds = self.plan.size**2 * sum(s.spp for s in course) / NUMPY_PATHS_PER_SECOND
        there = f"{len(darkroom.pictures)} of {len(self.plan.settings)} pictures"
        return [
            *([] if self.complete else [f"This page is not complete: it has {there}."]),
            f"{len(darkroom.pictures)} pictures, {len(darkroom.references)} references and the "
            f"measurements below, {darkroom.paths / 1e9:.2f} billion paths, took "
            f"{self.seconds:.0f} s, compilation included, and {self.cpu_seconds:.0f} s of "
            "processor time.",
            f"The course's own {len(course)} pictures take NumPy {numpy_seconds / 3600:.1f} hours: "
            "one sample of each pixel of each was traced in float64, and the seconds taken times "
            "the samples (measured on two cores of a Zen 4, not in this run).",
        ]

    def _figure(self, figure: Figure) -> str:
        pictures = self.darkroom.pictures
        rows = {
            row.label: [
                markup.card(pictures[s], figure.crops) for s in row.settings if s in pictures
            ]
            for row in figure.rows
        }
        shown = [markup.row(label, cards) for label, cards in rows.items() if cards]
        return "".join((markup.paragraph(figure.text), "\n", *shown)) if shown else ""

    def _curve(self, curve: Curve) -> str:
        """A chart of what is measured of a scene, and its numbers."""
        title = f"relMSE against seconds, {curve.bounces} bounces"
        measured: dict[str, list[Picture]] = {}
        for picture in sorted(self.darkroom.pictures.values(), key=lambda p: p.setting.spp):
            if (picture.setting.scene, picture.setting.bounces) == (curve.scene, curve.bounces):
                measured.setdefault(picture.setting.way, []).append(picture)
        if not measured:
            return ""
        points = {way: [(p.seconds, p.rel_mse) for p in ladder] for way, ladder in measured.items()}
        rows = tuple(
            (way, str(p.setting.spp), f"{p.seconds:.3f}", f"{p.rel_mse:.2g}")
            for way, ladder in measured.items()
            for p in ladder
        )
        chart = log_log(title, "seconds", "relMSE", dict(sorted(points.items())))
        table = markup.table(Table(title, ("", "spp", "seconds", "relMSE"), rows))
        return f"{markup.wide('Chart', chart)}\n{markup.folded('Numbers', table)}"


def _template(name: str) -> Template:
    return Template((files("drpt.gallery") / "templates" / name).read_text(encoding="utf-8"))
