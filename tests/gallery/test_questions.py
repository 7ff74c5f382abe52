from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from drpt.gallery.figures import GLOSSY
from drpt.gallery.mirror import BOUNCES, make_views, mirror
from drpt.gallery.parts import Part, coverage, with_material
from drpt.gallery.questions import QUESTIONS
from drpt.gallery.rendering import Darkroom, rel_mse
from drpt.render import Mode, render
from drpt.scene import Diffuse, Mesh, Phong, load_scene

if TYPE_CHECKING:
    from collections.abc import Callable

    from drpt.gallery.answers import Answer
    from drpt.result import Result

SIZE = 64


@pytest.fixture
def result() -> Result:
    return render(load_scene(GLOSSY).resized(4, 4), 16, 1, Mode.EXPLICIT)


@pytest.mark.slow
@pytest.mark.parametrize("question", QUESTIONS, ids=lambda question: question.__name__)
def test_the_pictures_bear_the_answers_out(question: Callable[[Darkroom], Answer]) -> None:
    answer = question(Darkroom(SIZE, lambda _: None))
    assert [finding.text for finding in answer.findings if not finding.holds] == []


def test_findings_can_fail(result: Result, monkeypatch: pytest.MonkeyPatch) -> None:
    """A mirror that takes no bounce shows the spot with all of its light."""
    darkroom = Darkroom(SIZE, lambda _: None)
    even = replace(result, image=np.full((4, 4, 3), 0.25, np.float32))
    monkeypatch.setattr(darkroom, "render", lambda *_: even)
    answer = mirror(darkroom)
    assert not any(finding.holds for finding in answer.findings)
    assert len(answer.table.rows[0]) == BOUNCES + 1


def test_the_mirrored_ray_is_a_reflection() -> None:
    """Angles on both sides of the normal are equal, and the way meets the mirror."""
    scene = load_scene(GLOSSY)
    views = make_views(scene, side=30, size=4)
    eye, seen = views.reflected.camera, views.direct.camera
    arriving = np.subtract(eye.target, eye.eye)
    leaving = np.subtract(seen.target, seen.eye)
    bisector = leaving / np.linalg.norm(leaving) - arriving / np.linalg.norm(arriving)
    box = scene.shapes[Part.LARGE_BOX]
    assert isinstance(box, Mesh)
    edge = box.vertices[1] - box.vertices[0]
    on_mirror = np.subtract(eye.target, box.vertices[0])
    assert bisector @ edge == pytest.approx(0, abs=0.1)  # mm, of an edge of 165
    assert bisector[1] == pytest.approx(0, abs=1e-3)
    assert 0 < on_mirror @ edge < edge @ edge
    assert -330 < on_mirror[1] < 0


def test_parts_are_those_of_the_scene() -> None:
    scene = load_scene(GLOSSY)
    assert scene.shapes[Part.LAMP].is_light
    assert scene.shapes[Part.BACK_WALL].material == Phong(0.76, 50)
    assert scene.shapes[Part.LARGE_BOX].material == Phong(0.86, 1000)
    assert scene.shapes[Part.RED_WALL].material == Diffuse((0.76, 0.16, 0.16))
    assert [len(shape.vertices) for shape in scene.shapes[1:] if isinstance(shape, Mesh)] == [
        *[4] * 5,
        *[8] * 2,
    ]


def test_coverage_adds_up_and_tells_left_from_right() -> None:
    """The room fills the picture; the red wall is on its left."""
    scene = load_scene(GLOSSY).resized(16, 16)
    shares = {part: coverage(scene, part) for part in Part}
    np.testing.assert_allclose(sum(shares.values()), 1, atol=1e-6)
    assert shares[Part.RED_WALL][:, :8].sum() > 0
    assert shares[Part.RED_WALL][:, 8:].sum() == 0


def test_a_material_is_exchanged_alone() -> None:
    scene = load_scene(GLOSSY)
    other = with_material(scene, Part.BACK_WALL, Diffuse(0.5))
    assert other.shapes[Part.BACK_WALL].material == Diffuse(0.5)
    assert with_material(other, Part.BACK_WALL, Phong(0.76, 50)) == scene


def test_rel_mse_is_that_of_the_picture_alone(result: Result) -> None:
    """Without what a white reference is estimated to be off itself."""
    white = replace(result, image=np.ones((4, 4, 3), np.float32))
    image = np.full((4, 4, 3), 1.5, np.float32)
    assert white.error > 0
    assert rel_mse(image, white) == pytest.approx(0.25 / 1.01 - white.error)
