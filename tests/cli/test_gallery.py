"""`drpt gallery`: bad folders, the page, signals."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from drpt import cli
from drpt.gallery import figures, making, rendering
from drpt.gallery.figures import DIFFUSE, Figure, Plan, Row, Setting
from drpt.render import Mode
from tests.cli.running import files, status_of

if TYPE_CHECKING:
    from drpt.result import Result


@pytest.fixture(autouse=True)
def _two_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    def plan(size: int) -> Plan:
        row = Row(tuple(Setting(DIFFUSE, Mode.EXPLICIT, "sobol", spp, 1) for spp in (1, 2)))
        return Plan(size // 16, (Figure("A figure", "", (row,), ()),), ())

    monkeypatch.setattr(figures, "course_plan", plan)
    monkeypatch.setattr(making, "QUESTIONS", ())


def test_the_page_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["gallery", "-o", "new/folder", "--quick"]) == 0
    assert capsys.readouterr() == ("new/folder/index.html\n", "")
    assert 'width="4" height="4"' in Path("new/folder/index.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("folder", ["good.toml", "good.toml/under"])
def test_a_file_is_no_folder(folder: str, capsys: pytest.CaptureFixture[str]) -> None:
    before = files()
    assert status_of(cli.main, ["gallery", "-o", folder]) == 2
    printed, complaint = capsys.readouterr()
    assert printed == ""
    assert complaint.startswith(f"drpt gallery: error: {folder}: ")
    assert complaint.count("\n") == 1
    assert files() == before


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_after_a_signal_there_is_a_page_of_what_is_finished(
    number: signal.Signals,
    status: int,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """It comes in the first picture, after which the second is not begun."""
    render = rendering.Darkroom.render

    def signalled(self: rendering.Darkroom, *args: Any, **settings: Any) -> Result:
        if self.references:
            signal.raise_signal(number)
            monkeypatch.setattr(rendering.Darkroom, "render", render)
        return render(self, *args, **settings)

    monkeypatch.setattr(rendering.Darkroom, "render", signalled)
    assert cli.main(["gallery", "-o", "."]) == status
    printed, said = capsys.readouterr()
    assert (printed, said.count("\n")) == ("index.html\n", 1)
    assert "it has 1 of 2 pictures" in Path("index.html").read_text(encoding="utf-8")


def test_a_second_signal_does_not_wait(monkeypatch: pytest.MonkeyPatch) -> None:
    def signalled(*_: object, **__: object) -> None:
        signal.raise_signal(signal.SIGTERM)
        signal.raise_signal(signal.SIGTERM)

    monkeypatch.setattr(rendering.Darkroom, "render", signalled)
    assert status_of(cli.main, ["gallery", "-o", "."]) == 143
    assert "it has 0 of 2 pictures" in Path("index.html").read_text(encoding="utf-8")
