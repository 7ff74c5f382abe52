from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from drpt.gallery import making
from drpt.gallery.answers import Answer, Finding, Shown, Table
from drpt.gallery.making import make_gallery, steps
from drpt.output import to_display
from tests.gallery.checker import checked

if TYPE_CHECKING:
    from pathlib import Path

    from drpt.gallery.figures import Plan
    from drpt.gallery.rendering import Darkroom

DARKROOMS: list[Darkroom] = []


def question(darkroom: Darkroom) -> Answer:
    DARKROOMS.append(darkroom)
    findings = Finding("Yes.", holds=True), Finding("1 < 0.", holds=False)
    table = Table("A table", ("", "x"), (("row", "2"),))
    picture = Shown("A picture", np.full((4, 4, 3), 0.5))
    return Answer("Why?", "Because of `x`.", findings, table, pictures=(picture,))


@pytest.fixture(autouse=True)
def _one_question(monkeypatch: pytest.MonkeyPatch) -> None:
    DARKROOMS.clear()
    monkeypatch.setattr(making, "QUESTIONS", (question,))


def test_the_page_shows_all_that_was_measured(plan: Plan, tmp_path: Path) -> None:
    seen: list[str] = []
    page = checked(make_gallery(tmp_path, plan, seen.append))
    pictures = DARKROOMS[0].pictures
    assert len(seen) == steps(plan)
    assert set(pictures) == set(plan.settings)
    for figure in plan.figures:
        for setting in figure.settings:
            picture = pictures[setting]
            measures = f"{picture.seconds:.2g} s, relMSE {picture.rel_mse:.2g}"
            assert f"{setting.short} {measures}" in page.text
    for setting in plan.curves[0].settings:
        picture = pictures[setting]
        row = f"{setting.way} {setting.spp} {picture.seconds:.3f} {picture.rel_mse:.2g}"
        assert row in page.text
    assert "Words & <more>." in page.text
    assert "✓ holds: Yes." in page.text
    assert "✗ does not hold: 1 < 0." in page.text
    assert "not complete" not in page.text


def test_the_page_holds_pictures_and_their_details(plan: Plan, tmp_path: Path) -> None:
    """A quarter of each picture, from a quarter to the right and a half down, is a detail."""
    pictures = iter(checked(make_gallery(tmp_path, plan)).pictures)
    for setting in plan.figures[0].settings:
        expected = to_display(DARKROOMS[0].picture(setting).image)
        for words, part in ((str(setting), expected), ("detail: a place", expected[8:12, 4:8])):
            name, shown = next(pictures)
            assert name == words
            np.testing.assert_array_equal(shown, part)
    assert [name for name, _ in pictures] == ["A picture"]


def test_an_interrupt_leaves_a_page_of_what_is_finished(plan: Plan, tmp_path: Path) -> None:
    """The reference and two pictures are."""
    seen: list[str] = []

    def interrupt(words: str) -> None:
        if len(seen) == 3:
            raise KeyboardInterrupt
        seen.append(words)

    with pytest.raises(KeyboardInterrupt):
        make_gallery(tmp_path, plan, interrupt)
    page = checked(tmp_path / "index.html")
    assert "This page is not complete: it has 2 of 6 pictures." in page.text
    first, second, third, *_ = plan.settings
    shown = [words for words, _ in page.pictures]
    assert str(first) in shown
    assert str(second) in shown
    assert str(third) not in shown
    assert "Why?" not in page.text


def test_an_interrupt_at_once_leaves_a_page(plan: Plan, tmp_path: Path) -> None:
    def interrupt(_: str) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        make_gallery(tmp_path, plan, interrupt)
    assert checked(tmp_path / "index.html").pictures == []
