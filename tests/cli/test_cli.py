"""What all subcommands share: usage, help, version, and text that nobody gets."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

import drpt
from drpt import cli
from tests.cli.running import status_of

if TYPE_CHECKING:
    from types import ModuleType


@pytest.mark.parametrize(
    ("argv", "starts"),
    [
        ([], "drpt: error: "),
        (["paint"], "drpt: error: COMMAND: invalid choice: 'paint'"),
        (["scenes", "--all"], "drpt scenes: error: unknown arguments: --all"),
        (["explain", "no-such-scene"], "drpt explain: error: "),
        (["explain", "good.toml", "--mode", "fast"], "drpt explain: error: mode"),
    ],
)
def test_to_another_command_is_refused(
    argv: list[str], starts: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert status_of(cli.main, argv) == 2
    printed, complaint = capsys.readouterr()
    assert printed == ""
    assert complaint.startswith(starts)
    assert complaint.count("\n") == 1


@pytest.mark.parametrize("argv", [["--help"], ["render", "--version"], ["scenes"]])
@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_text_that_nobody_gets_is_a_failed_run(argv: list[str], unbuffered: str) -> None:
    with Path("/dev/full").open("w") as full:
        run = subprocess.run(
            [sys.executable, "-m", "drpt", *argv],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONUNBUFFERED": unbuffered},
            check=False,
        )
    assert run.returncode != 0
    assert "error: [Errno 28] No space left on device" in run.stderr


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_reader_that_has_enough_is_no_error(unbuffered: str) -> None:
    theirs, ours = os.pipe()
    os.close(theirs)
    run = subprocess.run(
        [sys.executable, "-m", "drpt", "scenes"],
        stdout=ours,
        stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONUNBUFFERED": unbuffered},
        check=False,
    )
    os.close(ours)
    assert (run.returncode, run.stderr) == (0, b"")


@pytest.mark.parametrize(
    ("argv", "says"),
    [
        (["--help"], ("render", "scenes", "doctor", "explain", "drpt scenes")),
        (["render", "--help"], ("--spp", "SCENE.exr", "implicit-uniform", "drpt-render ")),
        (["--version"], (f"drpt {drpt.__version__}",)),
        (["render", "--version"], (f"drpt-render {drpt.__version__}",)),
    ],
)
def test_help_and_version_are_printed(
    argv: list[str], says: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    assert status_of(cli.main, argv) == 0
    printed = capsys.readouterr().out
    for words in says:
        assert words in printed


@pytest.mark.parametrize("command", cli.COMMANDS)
def test_every_command_has_examples_and_tells_its_statuses(
    command: ModuleType, capsys: pytest.CaptureFixture[str]
) -> None:
    name = command.__name__.rpartition(".")[2]
    assert status_of(cli.main, [name, "--help"]) == 0
    printed = capsys.readouterr().out
    _, examples = printed.split("examples:\n")
    assert f"drpt{'-' if name == 'render' else ' '}{name}" in examples
    assert "exit status: 0" in printed
    assert "2 for bad input" in printed


NAMES = {"letters": "bild-ä-日本", "bytes": os.fsdecode(b"byte-\xff\xfe")}
ENCODINGS = {
    "C": {"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"},
    "ascii": {"PYTHONIOENCODING": "ascii"},
    "UTF-8": {"LC_ALL": "C.UTF-8"},
}


@pytest.mark.parametrize("encoding", ENCODINGS.values(), ids=ENCODINGS)
@pytest.mark.parametrize("name", NAMES.values(), ids=NAMES)
def test_names_that_a_terminal_cannot_encode_are_escaped(
    name: str, encoding: dict[str, str]
) -> None:
    script = """
import sys
from drpt.cli import main
_, name = sys.argv
statuses = [
    main(["render", "good.toml", "--spp", "1", "-o", f"{name}.exr", "-o", f"{name}.png"]),
    main(["convert", f"{name}.exr", f"{name}.npy"]),
    main(["compare", f"{name}.exr", f"{name}.npy"]),
]
try:
    main(["render", f"{name}.toml"])
except SystemExit as leave:
    statuses.append(leave.code)
print(*statuses)
"""
    command = [sys.executable, "-c", script, name]
    done = subprocess.run(command, env={**os.environ, **encoding}, capture_output=True, check=True)
    assert done.stdout.splitlines()[-1] == b"0 0 0 2"
    assert done.stderr.count(b"\n") == 1
    assert done.stderr.endswith(b".toml: there is no such file\n")
    made = {os.fsencode(path.name) for path in Path().iterdir()}
    stem = os.fsencode(name)
    assert made == {b"good.toml", stem + b".exr", stem + b".png", stem + b".npy"}
