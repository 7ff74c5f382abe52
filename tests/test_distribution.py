"""The name that pip knows, and the commands that install an extra from where drpt came."""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from importlib.metadata import PackageNotFoundError
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import pytest

import drpt
from drpt.distribution import EXTRAS, NAME, VERSION, install_command, versions

if TYPE_CHECKING:
    from collections.abc import Callable

ROOT = Path(__file__).parents[1]


@pytest.fixture
def installed_from(monkeypatch: pytest.MonkeyPatch) -> Callable[[Any], None]:
    """Let pip have recorded a source; None for an index."""

    def record(source: Any) -> None:
        text = None if source is None else json.dumps(source)
        found = SimpleNamespace(read_text={"direct_url.json": text}.get)
        monkeypatch.setattr("importlib.metadata.distribution", {NAME: found}.__getitem__)

    return record


class TestProject:
    """The tables of `pyproject.toml`."""

    PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]

    def test_has_the_same_name(self) -> None:
        assert self.PROJECT["name"] == NAME
        assert drpt.__version__ == VERSION

    def test_has_the_same_extras(self) -> None:
        needs = self.PROJECT["optional-dependencies"]
        found = {extra: tuple(n.partition(">=")[0] for n in needs[extra]) for extra in needs}
        assert found == EXTRAS


class TestVersions:
    def test_are_drpts_and_those_of_others(self) -> None:
        assert versions("drjit") == {"drpt": VERSION, "drjit": "1.5.0"}

    def test_of_what_is_not_installed_are_unknown(self) -> None:
        with pytest.raises(PackageNotFoundError, match="no-such-package"):
            versions("no-such-package")

    def test_take_no_metadata_at_import(self) -> None:
        code = "import runpy, sys; runpy.run_path(sys.argv[1]); print(*sys.modules)"
        command = [sys.executable, "-S", "-c", code, drpt.distribution.__file__]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        assert "importlib.metadata" not in done.stdout.split()


class TestInstallCommand:
    def test_names_the_distribution_on_an_index(
        self, installed_from: Callable[[Any], None]
    ) -> None:
        installed_from(None)
        assert install_command("view") == "python -m pip install 'drpt-render[view]'"
        assert install_command() == "python -m pip install drpt-render"

    @pytest.mark.parametrize(
        ("editable", "option"), [(True, "--editable "), (False, "")], ids=["editable", "copied"]
    )
    def test_enters_a_folder(
        self, editable: bool, option: str, tmp_path: Path, installed_from: Callable[[Any], None]
    ) -> None:
        folder = tmp_path / "it's here"
        folder.mkdir()
        installed_from({"url": folder.as_uri(), "dir_info": {"editable": editable}})
        entered, command = install_command("view").split(" && ")
        assert entered == f"cd '{tmp_path}/it'\"'\"'s here'"
        assert command == f"python -m pip install {option}'.[view]'"

    def test_names_an_archive(self, tmp_path: Path, installed_from: Callable[[Any], None]) -> None:
        wheel = tmp_path / "x.whl"
        wheel.touch()
        installed_from({"url": wheel.as_uri(), "archive_info": {}})
        assert install_command("flip", "--no-deps") == (
            f"python -m pip install --no-deps 'drpt-render[flip] @ file://{wheel}'"
        )

    @pytest.mark.parametrize("info", ["dir_info", "archive_info"])
    def test_names_no_source_that_is_gone(
        self, info: str, tmp_path: Path, installed_from: Callable[[Any], None]
    ) -> None:
        installed_from({"url": (tmp_path / "gone").as_uri(), info: {}})
        assert install_command("flip") == "python -m pip install 'drpt-render[flip]'"

    def test_names_the_commit_of_a_repository(self, installed_from: Callable[[Any], None]) -> None:
        info = {"vcs": "git", "commit_id": "abc", "requested_revision": "main"}
        installed_from({"url": "https://example.org/drpt.git", "vcs_info": info})
        assert install_command("view") == (
            "python -m pip install 'drpt-render[view] @ git+https://example.org/drpt.git@abc'"
        )

    def test_names_the_distribution_where_none_is_installed(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("drpt.distribution.NAME", "no-such-package")
        assert install_command("view") == "python -m pip install 'no-such-package[view]'"


@pytest.mark.parametrize("folder", ["src", "docs", "tools", "benchmarks"])
def test_nobody_is_sent_to_another_project(folder: str) -> None:
    stranger = "drpt" + "["
    for path in [*(ROOT / folder).rglob("*"), ROOT / "README.md"]:
        if path.suffix in {".py", ".md", ".sh", ".js", ".html"}:
            assert stranger not in path.read_text(), path
