from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from drpt.gallery.figures import DIFFUSE, Setting
from drpt.gallery.rendering import REPEATS, SHORT, Darkroom
from drpt.render import Mode, render

if TYPE_CHECKING:
    from drpt.result import Result
    from drpt.scene import Scene


@pytest.mark.parametrize(
    ("seconds", "counts"),
    [([0.9, 0.1, 0.1], 0.9), ([0.9 * SHORT, *[2.0] * (REPEATS - 1), 0.5 * SHORT], 0.5 * SHORT)],
)
def test_the_fastest_render_of_a_short_picture_counts(
    seconds: list[float], counts: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    darkroom = Darkroom(4, lambda _: None)
    setting = Setting(DIFFUSE, Mode.EXPLICIT, "sobol", 1, 1)
    darkroom.reference(setting.scene, setting.bounces)
    left = iter(seconds)

    def timed(scene: Scene, *way: object) -> Result:
        return replace(render(scene, 1, 1), seconds=next(left))

    monkeypatch.setattr(darkroom, "render", timed)
    assert darkroom.picture(setting).seconds == counts
