"""The documentation: every code block in it runs, every link leads somewhere, and it builds.

Comments that a reader does not see stand right before a block:

    <!-- not run: why -->            for what a test cannot run; NOT_RUN below lists all of them
    <!-- file: NAME -->              the block is the content of a file
    <!-- in tests: OLD => NEW -->    in a test, NEW stands for OLD, to take less time
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import pytest
from markdown_it import MarkdownIt

from drpt.kernel import backend

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.rglob("*.md"))]

QUICK = {"docs/reference/scene-files.md", "docs/reference/pictures.md", "docs/how-to/notebooks.md"}
"""Pages whose blocks take a second in all, of those with blocks that run."""

NOT_RUN = {
    ("README.md", "make demo"),
    ("docs/performance.md", ".venv/bin/python -m"),
    ("docs/tutorial.md", "make demo"),
    ("docs/how-to/install.md", "sudo apt"),
    ("docs/how-to/install.md", "python -m"),
    ("docs/how-to/layers.md", "python -m"),
    ("README.md", "drpt view"),
    ("docs/how-to/preview.md", "drpt-render veach"),
    ("docs/how-to/view.md", "drpt view"),
    ("docs/how-to/view.md", "ssh -L"),
    ("docs/how-to/merge.md", "drpt-render veach"),
}
"""Page and first two words of each block that does not run: installers, what needs other programs
or machines, and whole benchmarks."""

LANGUAGES = {"python", "sh", "console", "toml", "text", "math", ""}
TIMEOUT = 60.0
"""Seconds that a command may take before something must be wrong."""
NOTE = re.compile(r"<!-- (not run|file|in tests): (.*) -->")
NUMBER = re.compile(r"[-+]?\d[\d.]*(e[-+]?\d+)?")
INTERRUPT = "^C"
"""In a console, where the reader presses Ctrl-C; a test does as soon as there is a checkpoint."""


class Block(NamedTuple):
    """A fenced block of code."""

    page: str
    line: int
    language: str
    text: str
    notes: dict[str, str]

    @property
    def code(self) -> str:
        """What a test runs."""
        code = self.text
        for change in filter(None, self.notes.get("in tests", "").split("; ")):
            old, new = change.split(" => ")
            assert old in code, f"{self.page}:{self.line}: {old!r} is not in the block"
            code = code.replace(old, new)
        return code

    @property
    def is_console(self) -> bool:
        return self.language in ("console", "") and self.text.startswith("$ ")

    @property
    def runs(self) -> bool:
        return "not run" not in self.notes and (self.is_console or self.language in RUNNERS)

    def __str__(self) -> str:
        return f"{self.page}:{self.line}"


def name_of(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


def blocks(page: str, text: str) -> Iterator[Block]:
    notes: dict[str, str] = {}
    for token in MarkdownIt().parse(text):
        if token.type == "html_block" and (note := NOTE.match(token.content)):
            notes[note[1]] = note[2]
            continue
        if token.type == "fence" and not token.info.startswith("{"):
            line = token.map[0] + 1 if token.map else 0
            yield Block(page, line, token.info.strip(), token.content, notes)
        notes = {}


BLOCKS = {page: list(blocks(name_of(page), page.read_text(encoding="utf-8"))) for page in PAGES}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder, which is home, too, with the references that the repository has."""
    monkeypatch.setenv("DRJIT_CACHE_DIR", str(backend.describe().cache))
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    (tmp_path / "reference").symlink_to(ROOT / "reference")
    return tmp_path


def run_python(block: Block, names: dict[str, Any]) -> None:
    exec(compile("\n" * block.line + block.code, ROOT / block.page, "exec"), names)


def run_shell(block: Block, _: dict[str, Any]) -> None:
    done = execute(block.code)
    assert done.returncode == 0, f"{block}: {done.stdout}"


def run_console(block: Block, _: dict[str, Any]) -> None:
    """Run each command; what it says is the same in all but numbers, and fails as it says."""
    for part in re.split(r"^\$ ", block.code, flags=re.MULTILINE)[1:]:
        command, *expected = re.sub(r"\\\n *", "", part).rstrip().splitlines()
        interrupted = INTERRUPT in expected
        done = (interrupt if interrupted else execute)(command)
        lines = [line for line in expected if line != INTERRUPT]
        assert (done.returncode != 0) == (interrupted or "error:" in part), f"{block}: {done}"
        if lines:
            assert says(done.stdout, lines), f"{block}: {command}\n{done.stdout}"


def says(output: str, expected: list[str]) -> bool:
    """Whether lines are the expected ones, whatever their numbers; "..." stands for any lines."""
    pattern = "".join(
        "(.*\n)*?" if e.strip() == "..." else re.escape(plain(e)) + "\n" for e in expected
    )
    return bool(re.fullmatch(pattern, "".join(plain(x) + "\n" for x in output.splitlines())))


def plain(line: str) -> str:
    return " ".join(NUMBER.sub("#", line).split())


def execute(command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["bash", "-euo", "pipefail", "-c", command],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=TIMEOUT,
        check=False,
    )


def interrupt(command: str) -> subprocess.CompletedProcess[str]:
    """Run a command until its checkpoint is there, and interrupt it."""
    process = subprocess.Popen(
        ["bash", "-c", f"exec {command}"],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    start = time.monotonic()
    while not list(Path.cwd().glob("*.drpt")) and time.monotonic() - start < TIMEOUT:
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    output, _ = process.communicate(timeout=TIMEOUT)
    assert process.returncode == 128 + signal.SIGINT, output
    return subprocess.CompletedProcess(command, process.returncode, output)


def write_file(block: Block, _: dict[str, Any]) -> None:
    tomllib.loads(block.code)
    if name := block.notes.get("file"):
        Path(name).write_text(block.code, encoding="utf-8")


RUNNERS = {"python": run_python, "sh": run_shell, "console": run_console, "toml": write_file}


def cases() -> list[Any]:
    """Pages with something to run."""
    pages = {name_of(page): page for page in PAGES if any(block.runs for block in BLOCKS[page])}
    assert pages.keys() >= QUICK
    slow = pytest.mark.slow
    return [
        pytest.param(page, id=name, marks=() if name in QUICK else slow)
        for name, page in pages.items()
    ]


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize("page", cases())
def test_code_runs(page: Path) -> None:
    names: dict[str, Any] = {}
    for block in BLOCKS[page]:
        if block.runs:
            RUNNERS["console" if block.is_console else block.language](block, names)


def test_nothing_is_left_out_in_silence() -> None:
    every = [block for found in BLOCKS.values() for block in found]
    left_out = [(b.page, " ".join(b.text.split()[:2])) for b in every if "not run" in b.notes]
    assert sorted(left_out) == sorted(NOT_RUN)
    assert {block.language for block in every} <= LANGUAGES
    assert sum(block.runs for block in every) > len(NOT_RUN)


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_links_within_the_repository_lead_somewhere(page: Path) -> None:
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)
    for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", text):
        if "://" not in target:
            assert (page.parent / target).exists(), target


@pytest.mark.slow
def test_pages_build_without_a_warning(tmp_path: Path) -> None:
    pytest.importorskip("sphinx")
    command = [sys.executable, "-m", "sphinx", "-b", "html", "-W", "--keep-going", "-q"]
    done = subprocess.run(
        [*command, str(DOCS), str(tmp_path)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    commands = (tmp_path / "reference/commands.html").read_text(encoding="utf-8")
    assert all(flag in commands for flag in ("--target-error E", "--against REF"))


class TestTheTestItself:
    """It must be able to fail."""

    def test_numbers_may_differ_and_words_may_not(self) -> None:
        assert says("box  64 spp\n0.1 s\n", ["box  16 spp", "22.5 s"])
        assert not says("box  64 spp\n", ["box  64 bounces"])
        assert not says("a\nb\n", ["a"])
        assert says("a\nb\nc\n", ["a", "..."])

    def test_a_command_that_fails_is_seen(self) -> None:
        with pytest.raises(AssertionError):
            run_shell(Block("p", 1, "sh", "false | true", {}), {})
        with pytest.raises(AssertionError):
            run_console(Block("p", 1, "console", "$ false\n", {}), {})

    def test_notes_are_of_the_next_block(self) -> None:
        text = "<!-- file: a.toml -->\n```toml\na = 1\n```\n\n```sh\ntrue\n```\n"
        assert [block.notes for block in blocks("p", text)] == [{"file": "a.toml"}, {}]
