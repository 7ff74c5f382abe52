"""Each test of the command line runs in an empty folder with a scene."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.running import SCENE


@pytest.fixture(autouse=True)
def in_folder_with_scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("good.toml").write_text(SCENE)
