"""`drpt completion`: what a shell offers after the script."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from drpt import cli
from drpt.output import CURVES
from drpt.render import Mode
from drpt.scene import builtin_names
from tests.cli.running import status_of

# Completes the words of its arguments, the last of which is unfinished, and prints the offers.
ASK_BASH = """source ./script
COMP_WORDS=("$@") COMP_CWORD=$(($# - 1)) COMPREPLY=()
complete=($(complete -p "$1"))
"${complete[-2]}" "$1" "${!#}" "${@: -2:1}" 2> /dev/null  # no completion is running to be changed
echo "${COMPREPLY[@]}"
"""


@pytest.mark.skipif(not shutil.which("bash"), reason="bash is not installed")
@pytest.mark.parametrize(
    ("words", "offers"),
    [
        (["drpt", "co"], {"compare", "convert", "completion"}),
        (["drpt", "render", ""], {*builtin_names(), "good.toml", "a.exr", "script"}),
        (["drpt-render", "go"], {"good.toml"}),
        (["drpt-render", "good.toml", "--mode", "im"], {Mode.IMPLICIT, Mode.IMPLICIT_UNIFORM}),
        (["drpt-render", "good.toml", "--curve", ""], set(CURVES)),
        (["drpt", "convert", "a.exr", "--expo"], {"--exposure"}),
        (["drpt", "compare", "a"], {"a.exr"}),
        (["drpt", "compare", "a.exr", "b.exr", "-o", "a"], {"a.exr"}),
    ],
)
def test_bash_offers_what_may_follow(
    words: list[str], offers: set[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["completion", "bash"]) == 0
    Path("script").write_text(capsys.readouterr().out)
    Path("a.exr").touch()
    ask = ["bash", "--norc", "-c", ASK_BASH, "bash", *words]
    answer = subprocess.run(ask, capture_output=True, text=True, check=True)
    assert set(answer.stdout.split()) == offers


def test_zsh_gets_its_own_script(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["completion", "zsh"]) == 0
    script = capsys.readouterr().out
    assert script.startswith("#compdef drpt\n")
    for words in (
        "compdef _shtab_render -N drpt-render",
        ":M:(implicit-uniform implicit",
        "_files",
    ):
        assert words in script
    if zsh := shutil.which("zsh"):
        subprocess.run([zsh, "-n"], input=script, text=True, check=True)


def test_another_shell_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert status_of(cli.main, ["completion", "fish"]) == 2
    assert "SHELL: invalid choice: 'fish'" in capsys.readouterr().err
