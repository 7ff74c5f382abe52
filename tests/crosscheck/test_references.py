from dataclasses import replace
from pathlib import Path

import pytest

from drpt import Diffuse, Mesh, render
from drpt.crosscheck import check, measure, render_reference, stored_reference
from drpt.crosscheck.check import Verdict
from drpt.crosscheck.stored import save_estimate
from tests.crosscheck.lit import HEIGHT, WIDTH, lit
from tests.measuring import with_picture, with_radiance

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
    assert check(stored, spp=SPP).verdict != Verdict.DIFFERS


def test_a_stored_one_may_be_of_anyone(tmp_path: Path) -> None:
    save_estimate(measure(lit(), SPP, 3), tmp_path / "a.exr", {})
    stored = stored_reference(lit(), tmp_path / "a.exr")
    assert (stored.bounces, stored.tolerance, stored.remarks) == (3, 0, ())


@pytest.mark.parametrize("brightness", [1.0, 1.1])
def test_one_of_unknown_noise_cannot_tell(tmp_path: Path, brightness: float) -> None:
    render(with_radiance(lit(), brightness), 4096, 1, error=False).save(tmp_path / "a.exr")
    stored = stored_reference(lit(), tmp_path / "a.exr")
    assert stored.bounces == 1
    assert "tells nothing of its noise" in str(stored)
    report = check(stored, spp=SPP)
    assert report.verdict == "cannot tell"
    assert "means    not compared\n" in str(report)


@pytest.mark.parametrize("sampler", ["sobol", "independent"])
def test_a_render_agrees_with_drpts_next(tmp_path: Path, sampler: str) -> None:
    render(lit(), 1024, 1, sampler=sampler, seed=1).save(tmp_path / "a.exr")
    assert check(stored_reference(lit(), tmp_path / "a.exr"), spp=1024).verdict == "agrees"


def test_a_render_of_a_brighter_light_differs(tmp_path: Path) -> None:
    """A picture that is 5 % too bright; the test of the means detects 2 %."""
    render(with_radiance(lit(), 1.05), 1024, 1, seed=1).save(tmp_path / "a.exr")
    report = check(stored_reference(lit(), tmp_path / "a.exr"), spp=1024)
    assert report.verdict == "differs"
    test = report.comparison.of_image
    assert (test.detectable < 0.02 * test.reference).all()


@pytest.mark.parametrize("name", ["image", "reference"])
def test_what_a_report_saves_is_a_reference(tmp_path: Path, name: str) -> None:
    reference = render_reference(lit(), SPP, 1)
    report = check(reference, spp=SPP)
    assert tmp_path / f"mis-1-{name}.exr" in report.save(tmp_path)
    again = stored_reference(lit(), tmp_path / f"mis-1-{name}.exr")
    saved = getattr(report.comparison, name)
    assert (again.bounces, again.estimate.passes, again.estimate.spp) == (1, saved.passes, SPP)
    assert again.estimate.variance == pytest.approx(saved.variance, rel=1e-6)
    assert (again.renderer == "Mitsuba") == (name == "reference")
    assert again.tolerance == (reference.tolerance if name == "reference" else 0)
    assert check(again, spp=SPP, seed=7).verdict != Verdict.DIFFERS


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
