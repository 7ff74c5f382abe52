"""Black pictures: the reason that is told is the true one."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np
import pytest

import drpt
from drpt import cli
from drpt.black import SIDE
from tests.scenes import BALL, LAMP, scene_of

if TYPE_CHECKING:
    from pathlib import Path

    from drpt.scene import Shape

GREY, BLACK = drpt.Diffuse(0.5), drpt.Diffuse(0)
FLOOR = [(-3, -1, -3), (-3, -1, 3), (3, -1, 3), (3, -1, -3)]
PANEL = [(-1, 2, -1), (-1, 2, 1), (1, 2, 1), (1, 2, -1)]
SQUARE, TURNED = [(0, 1, 2), (0, 2, 3)], [(0, 2, 1), (0, 3, 2)]


def floor(material: drpt.Diffuse = GREY) -> drpt.Mesh:
    return drpt.Mesh(FLOOR, SQUARE, material=material)


def panel(height: float = 0, faces: list[tuple[int, int, int]] = SQUARE) -> drpt.Mesh:
    """A light above, which faces up; `TURNED`, it faces down."""
    return drpt.Mesh(np.add(PANEL, (0, height, 0)), faces, radiance=10)


LID = drpt.Mesh(np.add(FLOOR, (0, 2.5, 0)), SQUARE, material=BLACK)
BEHIND = drpt.Sphere((0, 1, 9), 1, radiance=3)
SCENES: dict[str, tuple[list[Shape], int, str]] = {
    "no light": ([BALL], 3, "no shape emits light"),
    "no area": (
        [drpt.Mesh(PANEL, [(0, 0, 1)], material=GREY), BEHIND],
        3,
        "no shape is in front of the camera",
    ),
    "nothing in sight": ([BEHIND], 3, "no shape is in front of the camera"),
    "in the lamp": (
        [floor(), drpt.Sphere((0, 1, 5), 1, radiance=3)],
        3,
        "the camera is inside shapes[1], a light that emits outward only",
    ),
    "its back": ([panel(-2.5, TURNED)], 3, f"the camera sees only the back of shapes[0]; {SIDE}"),
    "0 bounces": (
        [floor(), BEHIND],
        0,
        "0 bounces show lights only, and the camera sees the front of none",
    ),
    "black": ([floor(BLACK), LAMP], 1, "everything that the camera sees has an albedo of 0"),
    "turned away": (
        [floor(), panel(3)],
        3,
        f"shapes[1], the only light, faces away from everything that the camera sees; {SIDE}",
    ),
    "both turned away": (
        [floor(), panel(3), panel(4)],
        3,
        "shapes[1] and shapes[2], the only lights, face away from everything that the camera sees; "
        + SIDE,
    ),
    "blocked": (
        [floor(), LID, panel(3, TURNED)],
        1,
        "no light arrives; likely something blocks it, or surfaces reflect none to the camera",
    ),
}


def warned(scene: drpt.Scene, **settings: object) -> list[str]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        result = drpt.render(scene, 4, **settings)  # type: ignore[arg-type]
    assert all(issubclass(one.category, RuntimeWarning) for one in caught)
    assert [result.warning] * len(caught) == [str(one.message) for one in caught]
    return [str(one.message) for one in caught]


def dark(shapes: list[Shape]) -> drpt.Scene:
    """A narrow view of what is below, past everything above."""
    camera = drpt.Camera((0, 1, 5), (0, -1, 0), (0, 1, 0), 20, 12, 8)
    return drpt.Scene(camera, shapes)


@pytest.mark.parametrize("name", SCENES)
def test_the_reason_is_told(name: str) -> None:
    shapes, bounces, reason = SCENES[name]
    told = warned(dark(shapes), bounces=bounces)
    assert told == [f"the picture is black: {reason}"]


@pytest.mark.parametrize("mode", drpt.Mode)
def test_every_mode_has_the_same_reason(mode: drpt.Mode) -> None:
    shapes, bounces, reason = SCENES["turned away"]
    told = warned(dark(shapes), bounces=bounces, mode=mode)
    assert told == [f"the picture is black: {reason}"]


def test_what_turns_round_is_seen() -> None:
    """The lights that are said to face away, turned, light the same picture."""
    assert warned(dark([floor(), panel(3, TURNED)])) == []
    assert warned(dark([panel(-2.5)])) == []


def test_chance_alone_may_find_no_light() -> None:
    far = drpt.Sphere((0, 900, 0), 0.5, radiance=1e6)
    for mode in ("implicit", "implicit-uniform"):
        (told,) = warned(dark([floor(), far]), bounces=1, mode=mode)
        words = f"mode {mode} finds lights by chance only, and no path has found one"
        assert told == f"the picture is black: {words}; take more spp, or mode mis"
    assert warned(dark([floor(), far]), bounces=1) == []


def test_a_picture_that_is_not_black_is_not_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(drpt.Rendering, "_why_black", None)
    assert warned(scene_of(BALL, LAMP)) == []


def test_the_command_line_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    dark(SCENES["turned away"][0]).save("scene.toml")
    assert cli.main(["render", "scene.toml", "--spp", "4", "--quiet", "-o", "a.exr"]) == 0
    printed, complaint = capsys.readouterr()
    assert printed == ""
    reason = SCENES["turned away"][2]
    assert complaint == f"drpt-render: warning: the picture is black: {reason}\n"
