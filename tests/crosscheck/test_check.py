from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from drpt import Camera, Mode, Scene, Sphere, load_scene
from drpt.crosscheck import check, render_reference
from drpt.crosscheck.check import Verdict, light_edges, samples_needed
from tests.crosscheck.lit import lit
from tests.measuring import with_picture, with_radiance

if TYPE_CHECKING:
    from drpt.crosscheck import Reference, Report

SPP = 256


@pytest.fixture(scope="module")
def reference() -> Reference:
    return render_reference(lit(), SPP, 1)


def against(reference: Reference, scene: Scene, tolerance: float = 0.0) -> Report:
    """Check the picture of another scene against a reference."""
    return check(replace(reference, scene=scene, tolerance=tolerance), spp=SPP)


@pytest.mark.parametrize("mode", Mode)
def test_drpt_agrees_with_mitsuba(reference: Reference, mode: Mode) -> None:
    report = check(reference, mode, 16 * SPP)
    assert report.verdict in (Verdict.AGREES, Verdict.CANNOT_TELL)
    assert report.mode == mode
    assert "Mitsuba 3.9.1 (llvm_ad_rgb), 256 spp, 24x16, 1 bounce" in str(reference)


def test_a_report_tells_the_figures(reference: Reference) -> None:
    report = check(reference, spp=16 * SPP)
    test = report.comparison.of_image
    text = str(report)
    lines = text.splitlines()
    assert text.startswith(f"mis, sobol, {16 * SPP} spp: {report.verdict}\n")
    for channel, ours, theirs in zip("RGB", test.mean, test.reference, strict=True):
        assert [channel, f"{ours:.6g}", f"{theirs:.6g}"] in [x.split()[:3] for x in lines]
    for words in ("detects", "std. error", "means    p = ", "blocks   p = ", "worst: ", "FLIP"):
        assert words in text


def test_a_brighter_light_fails(reference: Reference) -> None:
    report = against(reference, with_radiance(lit(), 1.05))
    assert report.verdict == Verdict.DIFFERS
    assert "differs" in str(report).splitlines()[0]


def test_a_known_error_of_the_reference_is_allowed_for(reference: Reference) -> None:
    report = against(reference, with_radiance(lit(), 1.05), tolerance=0.06)
    assert report.verdict == Verdict.CANNOT_TELL
    assert report.more_samples == np.inf
    assert "times the samples" not in str(report)


def test_mitsubas_lost_light_is_not_held_against_drpt() -> None:
    far = render_reference(lit(0.003, 100), SPP, 1)
    assert far.tolerance == np.inf
    assert "it may be black there" in str(far)
    assert check(far, spp=SPP).verdict == Verdict.CANNOT_TELL


def test_few_samples_cannot_tell(reference: Reference) -> None:
    report = check(reference, Mode.IMPLICIT_UNIFORM, 64)
    assert report.verdict == Verdict.CANNOT_TELL
    assert report.more_samples > 1
    assert f"with {report.more_samples:.2g} times the samples in both pictures" in str(report)


def test_as_many_samples_as_a_report_asks_for_can_tell() -> None:
    few = check(render_reference(lit(), SPP, 1), Mode.EXPLICIT_UNIFORM, SPP)
    assert few.verdict == Verdict.CANNOT_TELL
    spp = SPP * (1 + int(1.5 * few.more_samples))  # with a margin for what variances scatter
    more = check(render_reference(lit(), spp, 1, seed=1), Mode.EXPLICIT_UNIFORM, spp, seed=2)
    assert more.verdict == Verdict.AGREES
    assert more.more_samples < 1


def test_uniform_directions_and_sharp_lobes_cannot_tell() -> None:
    sharp = render_reference(lit(exponent=1e4), SPP, 2)
    report = check(sharp, Mode.IMPLICIT_UNIFORM, SPP)
    assert (report.comparison.of_image.resolved, report.verdict) == (False, Verdict.CANNOT_TELL)
    assert "the samples that meet sharp lobes are too few" in str(report)


@pytest.mark.parametrize(
    ("mode", "bounces", "expected"),
    [
        (Mode.MIS, 3, 0),
        (Mode.IMPLICIT, 3, 0),
        (Mode.IMPLICIT_UNIFORM, 0, 1000),
        (Mode.IMPLICIT_UNIFORM, 2, 1000 * 101**2),
        (Mode.EXPLICIT, 0, 1000),
        (Mode.EXPLICIT, 3, 1000 * 101),
        (Mode.EXPLICIT_UNIFORM, 1, 1000 * 101),
        (Mode.EXPLICIT_UNIFORM, 3, 1000 * 101**3),
    ],
)
def test_blind_directions_into_lobes_need_samples(mode: Mode, bounces: int, expected: int) -> None:
    assert samples_needed(lit(exponent=100), bounces, mode) == expected
    assert samples_needed(lit(), bounces, mode) == 0


def test_bounces_0_shows_the_lights_with_their_edges() -> None:
    report = check(render_reference(load_small("cornell-box"), SPP, 0), spp=SPP)
    assert report.verdict != Verdict.DIFFERS
    assert report.comparison.of_image.mean[0] > 0.1


def load_small(name: str) -> Scene:
    return with_picture(load_scene(name), 16, 16)


def test_edges_of_lights_are_found() -> None:
    camera = Camera((0, 0, 4), (0, 0, 0), (0, 1, 0), 40, 32, 32)
    edges = light_edges(Scene(camera, [Sphere((0, 0, 0), 1, radiance=1)]), 1024)
    y, x = np.mgrid[:32, :32] - 15.5
    apparent = 1 / np.sqrt(15) * 16 / np.tan(np.radians(20))
    distance = np.abs(np.hypot(x, y) - apparent)
    assert edges[distance < 0.3].all()
    assert not edges[distance > 0.8].any()
