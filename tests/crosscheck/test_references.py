from dataclasses import replace
from pathlib import Path

import pytest

from drpt import Diffuse, Mesh, render
from drpt.crosscheck import check, measure, render_reference, stored_reference
from drpt.crosscheck.check import Verdict
from drpt.crosscheck.stored import save_estimate
from tests.crosscheck.lit import HEIGHT, WIDTH, lit
from tests.measuring import with_picture

SPP = 256
TRIANGLE = [[-1, -1, 0], [1, -1, 0], [0, 1, 0]]


def test_interpolated_normals_are_remarked_on() -> None:
    smooth = Mesh(TRIANGLE, [[0, 1, 2]], [[0, 0, 1]] * 3, Diffuse(0.5))
    scene = replace(lit(), shapes=(*lit().shapes, smooth))
    assert "interpolated normals" in str(render_reference(scene, 64, 0))


def test_a_stored_one_is_what_was_rendered(tmp_path: Path) -> None:
    reference = render_reference(lit(), SPP, 1)
    path = tmp_path / "a.exr"
    save_estimate(reference.estimate, path, {"renderer": "Mitsuba", "bounces": 1})
    larger = with_picture(lit(), 4 * WIDTH, 4 * HEIGHT)
    stored = stored_reference(larger, path)
    assert (stored.scene.camera.width, stored.bounces) == (WIDTH, 1)
    assert stored.tolerance == reference.tolerance
    assert check(stored, spp=SPP).verdict != Verdict.FAIL


def test_a_stored_one_may_be_of_anyone(tmp_path: Path) -> None:
    save_estimate(measure(lit(), SPP, 3), tmp_path / "a.exr", {})
    stored = stored_reference(lit(), tmp_path / "a.exr")
    assert (stored.bounces, stored.tolerance, stored.remarks) == (3, 0, ())


def test_one_without_variances_is_taken_as_exact(tmp_path: Path) -> None:
    render(lit(), 4096, 1).save(tmp_path / "a.exr")
    stored = stored_reference(lit(), tmp_path / "a.exr")
    assert stored.bounces == 1
    assert "tells no variances: it is taken as exact" in str(stored)


def test_one_tells_of_another_scene(tmp_path: Path) -> None:
    render(lit(radius=0.9), 64, 1).save(tmp_path / "a.exr")
    assert "not quite this one" in str(stored_reference(lit(), tmp_path / "a.exr"))


def test_one_with_other_bounces_is_refused(tmp_path: Path) -> None:
    save_estimate(measure(lit(), SPP, 1), tmp_path / "a.exr", {"bounces": 1})
    with pytest.raises(ValueError, match="bounces: 2 is not allowed; it must be 1, as in"):
        stored_reference(lit(), tmp_path / "a.exr", 2)


def test_one_of_another_shape_is_refused(tmp_path: Path) -> None:
    save_estimate(measure(lit(), SPP, 1), tmp_path / "a.exr", {})
    square = with_picture(lit(), 16, 16)
    with pytest.raises(ValueError, match="its size, 24x16, has not the shape of"):
        stored_reference(square, tmp_path / "a.exr")
