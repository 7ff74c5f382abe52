"""`drpt gallery`: bad folders, the page, Ctrl-C."""

from __future__ import annotations

from pathlib import Path

import pytest

from drpt import cli
from drpt.gallery import figures, making, rendering
from drpt.gallery.figures import DIFFUSE, Figure, Plan, Row, Setting
from drpt.render import Mode
from tests.cli.running import files, status_of


@pytest.fixture(autouse=True)
def _one_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    def plan(size: int) -> Plan:
        row = Row((Setting(DIFFUSE, Mode.EXPLICIT, "sobol", 1, 1),))
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


def test_after_ctrl_c_there_is_a_page(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(rendering.Darkroom, "render", interrupted)
    assert cli.main(["gallery", "-o", "."]) == 130
    assert capsys.readouterr().err == "drpt gallery: interrupted\n"
    assert "not complete" in Path("index.html").read_text(encoding="utf-8")
