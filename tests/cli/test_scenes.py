"""`drpt scenes`."""

import pytest

import drpt
from drpt import cli


def test_scenes_lists_each_with_a_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["scenes"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == list(drpt.scene.builtin_names())
    assert "cornell-box" in drpt.scene.builtin_names()
    assert all(len(line.split()) > 3 for line in lines)
