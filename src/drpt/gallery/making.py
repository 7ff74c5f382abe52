"""Makes the gallery: renders, measures, answers, and writes the page."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter, process_time
from typing import TYPE_CHECKING

from drpt.files import replacing
from drpt.gallery.figures import course_plan
from drpt.gallery.page import Page
from drpt.gallery.questions import QUESTIONS
from drpt.gallery.rendering import Darkroom

if TYPE_CHECKING:
    from collections.abc import Callable
    from os import PathLike

    from drpt.gallery.answers import Answer
    from drpt.gallery.figures import Plan

PAGE = "index.html"


def make_gallery(
    folder: str | PathLike[str],
    plan: Plan | None = None,
    on_step: Callable[[str], object] = lambda _: None,
) -> Path:
    """Render the gallery and write its page.

    Parameters
    ----------
    folder
        Where ``index.html`` goes; it must exist.
    plan
        What to render; the course's figures by default.
    on_step
        Called before each of the `steps` with words for what comes; what it raises ends the work.

    Returns
    -------
    Path
        The page. However this ends, by Ctrl-C for instance, the page shows what is finished.

    Raises
    ------
    OSError
        The page cannot be written.
    """
    making = _Making(Path(folder), plan or course_plan(), on_step)
    try:
        making.run()
    finally:
        making.write_page()
    return making.path


def steps(plan: Plan) -> int:
    """How many pictures, references and answers there are to come."""
    settings = plan.settings
    references = {(setting.scene, setting.bounces) for setting in settings}
    return len(settings) + len(references) + len(QUESTIONS)


class _Making:
    """A gallery that is being made."""

    def __init__(self, folder: Path, plan: Plan, on_step: Callable[[str], object]) -> None:
        self.path = folder / PAGE
        self._plan = plan
        self._on_step = on_step
        self._darkroom = Darkroom(plan.size, on_step)
        self._answers: list[Answer] = []
        self._start = perf_counter(), process_time()
        self._complete = False

    def run(self) -> None:
        """Render and measure everything."""
        for setting in self._plan.settings:
            self._darkroom.picture(setting)
        for question in QUESTIONS:
            self._on_step(question.__name__)
            self._answers.append(question(self._darkroom))
        self._complete = True

    def write_page(self) -> None:
        """Write what there is."""
        seconds, cpu_seconds = perf_counter() - self._start[0], process_time() - self._start[1]
        page = Page(self._plan, self._darkroom, self._answers, seconds, cpu_seconds, self._complete)
        with replacing(self.path) as stream:
            stream.write(page.html().encode())
