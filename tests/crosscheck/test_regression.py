"""drpt against Mitsuba's pictures: the stored ones in every mode, and a few made afresh.

A failure says what differs, and where its pictures are: image, reference, error and p-values.
"""

from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest

from drpt import Mode, load_scene
from drpt.crosscheck import Reference, check, render_reference, stored_reference
from drpt.crosscheck.check import Verdict, samples_needed
from drpt.crosscheck.maps import save_maps
from drpt.crosscheck.stored import load_estimate
from drpt.scene.builtin import builtin_names
from reference.make import BOUNCES, SPP, path_of, small

SPP_OF_CHECKS = 1024
MOST_SPP = 16384  # where a mode needs them to be judged
EDGES_SPP = 65536  # lights seen directly: cheap, and noisy at their edges
DETECTED = 0.015  # relative difference of the means that every check in the mode "mis" must see
FOLDER = Path("out/regression")
MEGABYTES = 4
FRESH = [
    ("cornell-box", 2, Mode.EXPLICIT),
    pytest.param("cornell-box-glossy", 3, Mode.MIS, marks=pytest.mark.slow),
    ("furnace", 3, Mode.IMPLICIT),
    pytest.param("veach", 1, Mode.MIS, marks=pytest.mark.slow),
]

STORED = [(name, bounces) for name in builtin_names() for bounces in BOUNCES]
CASES = [
    (name, bounces, mode)
    for name, bounces in STORED
    for mode in (Mode if bounces else [Mode.MIS])  # without bounces all modes are the same
]


def spp_to_judge(name: str, bounces: int, mode: Mode) -> int:
    """As many samples as a check must have to be able to fail, a power of two.

    The edges of lights are left out of the means; at least half of the pixels are not.
    """
    if bounces == 0:
        return EDGES_SPP
    scene = small(load_scene(name))
    needed = samples_needed(scene, bounces, mode) / (scene.camera.width * scene.camera.height)
    return max(SPP_OF_CHECKS, 1 << int(2 * needed).bit_length())


JUDGED = [case for case in CASES if case[1] == 0 or spp_to_judge(*case) <= MOST_SPP]
"""The others are uniform directions into sharp lobes, several times in a row."""


def assert_not_different(against: Reference, mode: Mode, name: str) -> None:
    spp = spp_to_judge(name, against.bounces, mode)
    report = check(against, mode, spp)
    if report.verdict == Verdict.DIFFERS:
        maps = save_maps(report.comparison, FOLDER, f"{name}-{against.bounces}-{mode}-")
        pytest.fail("\n".join([str(against), str(report), *map(str, maps)]), pytrace=False)
    assert report.comparison.of_image.resolved
    if mode == Mode.MIS:
        test = report.comparison.of_image
        assert np.all(test.detectable < DETECTED * test.reference), f"too noisy: {report}"


@pytest.mark.slow
@pytest.mark.parametrize(("name", "bounces", "mode"), JUDGED)
def test_pictures_are_mitsubas(name: str, bounces: int, mode: Mode) -> None:
    against = stored_reference(load_scene(name), path_of(name, bounces))
    assert against.bounces == bounces
    assert not [remark for remark in against.remarks if "made of a scene" in remark]
    assert_not_different(against, mode, name)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "bounces", "mode"), [c for c in CASES if c not in JUDGED])
def test_what_cannot_be_judged_is_finite_and_not_called_right(
    name: str, bounces: int, mode: Mode
) -> None:
    against = stored_reference(load_scene(name), path_of(name, bounces))
    report = check(against, mode, SPP_OF_CHECKS)
    assert report.verdict == Verdict.CANNOT_TELL
    assert np.isfinite(report.comparison.image.mean).all()


@pytest.mark.parametrize(("name", "bounces", "mode"), FRESH)
def test_pictures_are_those_that_mitsuba_makes_now(name: str, bounces: int, mode: Mode) -> None:
    against = render_reference(small(load_scene(name)), SPP_OF_CHECKS, bounces, seed=99)
    assert_not_different(against, mode, name)


@pytest.mark.parametrize(("name", "bounces"), STORED)
def test_references_say_how_they_were_made(name: str, bounces: int) -> None:
    estimate, metadata = load_estimate(path_of(name, bounces))
    assert estimate.spp == SPP
    assert metadata["mitsuba"] == version("mitsuba")
    assert metadata["variant"] == "llvm_ad_rgb"
    assert {"seed", "sampler", "passes", "drjit"} <= metadata.keys()


def test_references_are_all_there_and_small() -> None:
    files = sorted(path_of("", 0).parent.glob("*.exr"))
    assert files == sorted(path_of(*case) for case in STORED)
    assert sum(file.stat().st_size for file in files) < MEGABYTES * 1e6
