"""drpt against Mitsuba: an estimate of the same pictures by other people's code."""

from dataclasses import replace

import numpy as np
import pytest

from drpt import Mode, Scene, load_scene, render
from drpt.crosscheck import reference
from drpt.crosscheck.reference import PASSES
from drpt.scene import builtin_names
from tests.oracle.arrays import Bools, Floats
from tests.oracle.statistics import assert_means_agree, smallest_detectable

HEIGHT = 32
SPP = 1024
EMISSION_SPP = 16 * SPP  # cheap, and noisy: the lights' edges
SIGNIFICANCE = 1e-4  # of each comparison; seeds are fixed, so it fails always or never
SENSITIVITY = 0.07  # relative difference of the image means that every comparison must detect

QUICK = [
    ("cornell-box", 2, Mode.EXPLICIT),
    ("cornell-box-glossy", 2, Mode.MIS),
    ("furnace", 3, Mode.MIS),
    ("veach", 1, Mode.MIS),
]
DIFFUSE = ["cornell-box", "cornell-box-medium-light", "cornell-box-small-light", "furnace"]
SLOW = [
    *((name, bounces, Mode.MIS) for name in builtin_names() for bounces in range(4)),
    *((name, 2, Mode.EXPLICIT) for name in DIFFUSE),
]


def small(name: str) -> Scene:
    scene = load_scene(name)
    width = round(scene.camera.width * HEIGHT / scene.camera.height)
    return replace(scene, camera=replace(scene.camera, width=width, height=HEIGHT))


def rendered(scene: Scene, spp: int, bounces: int, mode: Mode) -> tuple[Floats, Floats]:
    """Return drpt's mean and standard error, (height, width, 3)."""
    images = np.array(
        [
            render(scene, spp // PASSES, bounces, mode, sampler="independent", seed=seed).image
            for seed in range(PASSES)
        ],
        np.float64,
    )
    return images.mean(axis=0), images.std(axis=0, ddof=1) / np.sqrt(PASSES)


def image_mean(image: tuple[Floats, Floats], kept: Bools) -> tuple[Floats, Floats]:
    """Return the mean (3,) of the pixels that are kept, which are independent, and its error."""
    mean, standard_error = image
    return mean[kept].mean(axis=0), np.sqrt((standard_error[kept] ** 2).sum(axis=0)) / kept.sum()


def check(name: str, bounces: int, mode: Mode) -> None:
    """Compare the image means; with bounces, of the pixels that show no light and so no edge."""
    scene = small(name)
    spp = SPP if bounces else EMISSION_SPP
    kept: Bools = np.full((HEIGHT, scene.camera.width), True)
    if bounces:
        kept = render(scene, bounces=0).image.max(axis=2) == 0
    ours = image_mean(rendered(scene, spp, bounces, mode), kept)
    theirs = image_mean(reference(scene, spp, bounces, seed=1), kept)
    assert_means_agree(*ours, *theirs, SIGNIFICANCE)
    least = smallest_detectable(np.hypot(ours[1], theirs[1]), SIGNIFICANCE, 3) / theirs[0]
    assert least.max() < SENSITIVITY, f"{name}: a difference of {least.max():.2%} could hide"


@pytest.mark.parametrize(("name", "bounces", "mode"), QUICK)
def test_image_means_agree(name: str, bounces: int, mode: Mode) -> None:
    check(name, bounces, mode)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "bounces", "mode"), SLOW)
def test_image_means_agree_in_every_scene(name: str, bounces: int, mode: Mode) -> None:
    check(name, bounces, mode)
