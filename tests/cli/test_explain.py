"""`drpt explain`."""

import pytest

import drpt
from drpt import cli


def test_explain_prints_the_explanation(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def explain(scene: drpt.Scene, *, bounces: int, mode: str) -> str:
        return f"{len(scene.shapes)} shapes, {bounces}, {mode}"

    monkeypatch.setattr("drpt.cli.explain.explain", explain)
    assert cli.main(["explain", "good.toml", "--bounces", "2", "--mode", "explicit"]) == 0
    assert capsys.readouterr().out == "3 shapes, 2, explicit\n"
