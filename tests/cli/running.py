"""What the tests of the command line share: a scene, and how they run a program."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from drpt import cli

if TYPE_CHECKING:
    from collections.abc import Callable

    import pytest

MESH = """vertices = [[-2, -1, 0], [2, -1, 0], [0, -1, 2]]
faces = [[0, 1, 2]]"""

SCENE = f"""
[camera]
eye = [0, 0, 5]
target = [0, 0, 0]
up = [0, 1, 0]
fov = 40
width = 8
height = 6

[[shapes]]
type = "sphere"
center = [0, 0, 0]
radius = 1
material = {{ type = "phong", albedo = 0.5, exponent = 10 }}

[[shapes]]
type = "sphere"
center = [0, 3, 0]
radius = 0.5
radiance = 10

[[shapes]]
type = "mesh"
{MESH}
material = {{ type = "diffuse", albedo = 0.5 }}
"""


def status_of(run: Callable[[list[str]], int], argv: list[str]) -> int | str | None:
    try:
        return run(argv)
    except SystemExit as leave:
        return leave.code


def files() -> list[str]:
    return sorted(path.name for path in Path().iterdir())


def assert_refused(
    capsys: pytest.CaptureFixture[str], argv: list[str], says: tuple[str, ...]
) -> None:
    before = files()
    assert status_of(cli.render_main, argv) == 2
    printed, complaint = capsys.readouterr()
    assert printed == ""
    assert complaint.startswith("drpt-render: error: ")
    assert complaint.count("\n") == 1
    assert complaint.endswith("\n")
    for words in says:
        assert words in complaint
    assert files() == before
