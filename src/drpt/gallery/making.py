"""Makes the gallery: renders, measures, answers, and writes the page."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter, process_time
from typing import TYPE_CHECKING

from drpt.gallery.figures import course_plan
from drpt.gallery.markup import PICTURES
from drpt.gallery.page import Page
from drpt.gallery.questions import QUESTIONS
from drpt.gallery.rendering import Darkroom
from drpt.output import replacing, write

if TYPE_CHECKING:
    from collections.abc import Callable
    from os import PathLike

    import numpy as np
    from numpy.typing import NDArray

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
        Where ``index.html`` and the folder ``pictures`` go; it must exist.
    plan
        What to render; the course's figures by default.
    on_step
        Called before each of the `steps` with words for what comes.

    Returns
    -------
    Path
        The page. However this ends, by Ctrl-C for instance, the page shows what is finished.

    Raises
    ------
    OSError
        A file cannot be written.
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
        self._pictures = folder / PICTURES
        self._pictures.mkdir(exist_ok=True)
        self._plan = plan
        self._on_step = on_step
        self._darkroom = Darkroom(plan.size, on_step)
        self._answers: list[Answer] = []
        self._start = perf_counter(), process_time()
        self._complete = False

    def run(self) -> None:
        """Render and measure everything."""
        for figure in self._plan.figures:
            for setting in figure.settings:
                self._save(setting.name, self._darkroom.picture(setting).image)
        for setting in self._plan.settings:
            self._darkroom.picture(setting)
        for question in QUESTIONS:
            self._on_step(question.__name__)
            answer = question(self._darkroom)
            for picture in answer.pictures:
                self._save(picture.name, picture.image)
            self._answers.append(answer)
        self._complete = True

    def write_page(self) -> None:
        """Write what there is."""
        seconds, cpu_seconds = perf_counter() - self._start[0], process_time() - self._start[1]
        page = Page(self._plan, self._darkroom, self._answers, seconds, cpu_seconds, self._complete)
        with replacing(self.path) as stream:
            stream.write(page.html().encode())

    def _save(self, name: str, image: NDArray[np.floating]) -> None:
        write(self._pictures / f"{name}.png", image, {})
