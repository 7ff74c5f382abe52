"""The error of directly visible light, measured."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

import drpt
from drpt.error import DARK, Estimate, squared_differences
from drpt.missed import Emission, measured

if TYPE_CHECKING:
    from tests.oracle.arrays import Floats

SIDE = 16
CAMERA = drpt.Camera((0, 0, 10), (0, 0, 0), (0, 1, 0), 20, SIDE, SIDE)
PIXEL = 2 * np.tan(np.radians(10)) / SIDE * 10  # width of a pixel 10 away
LAMP = drpt.Sphere((PIXEL / 2, PIXEL / 2, 0), 0.1 * PIXEL, radiance=100)
LAMP_PIXEL = SIDE // 2 - 1, SIDE // 2


def noise_of(shape: tuple[int, ...], *, seed: int = 0) -> Floats:
    return np.random.default_rng(seed).normal(size=shape)


def estimate_of(blocks: Floats) -> Estimate:
    """Estimate from the values (runs, pixels, 3) of a picture that has one sample in each run."""
    image = blocks.mean(axis=0).reshape(SIDE, SIDE, 3)
    levels = squared_differences(blocks.astype(np.float32), 1).reshape(-1, SIDE, SIDE, 3)
    return Estimate(levels, image, 1.0, independent=True)


def light_of(emission: Floats, seen: float, factor: float = 1e9) -> Emission:
    """Emission (runs, 3) that the picture has found in its pixel `NUMBER`."""
    pixels, found = np.array([NUMBER]), emission.mean(axis=0)[None]
    return Emission(
        pixels, emission[:, None], found, np.full((1, 3), seen), factor, np.full(3, 1e9)
    )


NUMBER = LAMP_PIXEL[0] * SIDE + LAMP_PIXEL[1]
RUNS = 4


@pytest.mark.parametrize("found", [0.0, 1.5, 3.0, 9.0])
@pytest.mark.parametrize("elsewhere", [0.0, 2.0])
def test_the_error_of_emission_is_that_of_the_picture(found: float, elsewhere: float) -> None:
    """Emission is 3, of which a picture has found less, or more, in one run; no other noise."""
    emission = np.zeros((RUNS, 3))
    emission[2] = RUNS * found
    blocks = np.zeros((RUNS, SIDE**2, 3))
    blocks[:, NUMBER] = emission + elsewhere
    estimate = measured(estimate_of(blocks), blocks, 1, light_of(emission, 3.0))
    true = (found - 3) ** 2 / ((3 + elsewhere) ** 2 + DARK) / SIDE**2
    assert estimate.relative_mse == pytest.approx(true, rel=1e-6, abs=1e-11)
    assert estimate.bound == pytest.approx(estimate.relative_mse)


@pytest.mark.parametrize("reflected", [0.0, 1.0, 4.0])
def test_what_a_pixel_reflects_beside_a_light_makes_up_for_its_emission(reflected: float) -> None:
    """A light of radiance 4 covers half of a pixel, and more or less of it in runs of samples."""
    covered = np.array([0.6, 0.8, 0.4, 0.6])[:, None] * np.ones(3)
    blocks = np.ones((RUNS, SIDE**2, 3))
    blocks[:, NUMBER] = 4 * covered + reflected * (1 - covered)
    light = replace(light_of(4 * covered, 2.0), radiance=np.full(3, 4.0))
    found = measured(estimate_of(blocks), blocks, 1, light)
    true = (0.1 * (4 - reflected)) ** 2 / ((2 + reflected / 2) ** 2 + DARK) / SIDE**2
    assert found.relative_mse == pytest.approx(true, rel=1e-6, abs=1e-12)


def test_noise_that_is_not_of_emission_is_estimated_as_before() -> None:
    blocks = 5 + noise_of((RUNS, SIDE**2, 3))
    plain = estimate_of(blocks)
    emission = np.zeros((RUNS, 3))
    emission[2] = 4 * RUNS
    blocks = blocks.copy()
    blocks[:, NUMBER] += emission
    found = measured(estimate_of(blocks), blocks, 1, light_of(emission, 4.0))
    assert found.image[LAMP_PIXEL] == pytest.approx(plain.image[LAMP_PIXEL] + 4, rel=1e-6)
    others = np.arange(SIDE**2) != NUMBER
    # The pixel's neighbours are weighted by its brightness, too.
    there = np.abs(np.argwhere(others.reshape(SIDE, SIDE)) - LAMP_PIXEL).max(axis=1) > 2
    same = [e.relative_squares.reshape(-1, 3)[others][there] for e in (plain, found)]
    assert same[1] == pytest.approx(same[0], rel=1e-6)


@pytest.mark.parametrize("factor", [1.0, 4.0, 64.0])
def test_additional_rays_with_noise_of_their_own_tell_the_mean_squared_error(factor: float) -> None:
    """Emission of mean 8 and variance 1 in a run, of 2000 pictures."""
    expected, estimated = [], []
    rng = np.random.default_rng(1)
    for _ in range(2000):
        emission = 8 + rng.normal(size=(RUNS, 3))
        blocks = np.zeros((RUNS, SIDE**2, 3))
        blocks[:, NUMBER] = emission
        seen = 8 + rng.normal(size=3) / np.sqrt(RUNS * factor)
        light = replace(light_of(emission, 0.0, factor), seen=seen[None])
        found = measured(estimate_of(blocks), blocks, 1, light)
        estimated.append(np.mean(found.measured[LAMP_PIXEL]))  # type: ignore[index]
        expected.append(np.mean((emission.mean(axis=0) - 8) ** 2) / (64 + DARK))
    assert np.mean(estimated) == pytest.approx(np.mean(expected), rel=0.1)


def test_the_emission_of_a_picture_is_told_apart_from_what_it_reflects() -> None:
    """Without bounces it is all that a picture has."""
    for sampler in ("sobol", "independent"):
        passes = drpt.Rendering(drpt.Scene(CAMERA, [LAMP]), 1000, 0, sampler=sampler)
        for spp in passes.passes(2**16):
            blocks, size = passes._film.leading_blocks, passes._film.size
            light = passes._emission(len(blocks), size)
            assert light.pixels.tolist() == [NUMBER]
            assert light.blocks == pytest.approx(blocks[:, light.pixels], rel=1e-6, abs=1e-9)
            mean = passes.result().image[LAMP_PIXEL]
            assert light.found[0] == pytest.approx(mean, rel=1e-6), (sampler, spp)


@pytest.mark.parametrize("spp", [64, 100, 4096])
def test_paths_that_share_a_camera_ray_count_its_emission_each(spp: int) -> None:
    """The lamp lights a plate behind it; emission is bright, and what the plate reflects is not."""
    plate = drpt.Mesh(
        [(-2, -2, -1), (2, -2, -1), (2, 2, -1), (-2, 2, -1)],
        [[0, 1, 2], [0, 2, 3]],
        material=drpt.Diffuse(0.5),
    )
    lamp = drpt.Sphere(LAMP.center, LAMP.radius, radiance=1e4)
    passes = drpt.Rendering(drpt.Scene(CAMERA, [plate, lamp]), spp, 1)
    for _ in passes.passes():
        pass
    blocks, size = passes._film.leading_blocks, passes._film.size
    light = passes._emission(len(blocks), size)
    rest = (blocks[:, light.pixels] - light.blocks) / size
    assert light.found.max() > 100
    assert (rest > 0).all()
    assert rest.max() < 20


def test_the_error_of_a_lamp_that_is_hardly_hit_is_known() -> None:
    """It covers a thousandth of one pixel; all else is black, without noise."""
    lamp = drpt.Sphere(LAMP.center, 0.018 * PIXEL, radiance=1000)
    scene = drpt.Scene(CAMERA, [lamp])
    truth = float(drpt.render(scene, 2**17, 0, seed=2**40).image[LAMP_PIXEL][0])
    for seed in range(8):
        result = drpt.render(scene, 512, 0, seed=seed, target_error=1e-9)
        assert result.spp == 512
        found = result.image[LAMP_PIXEL][0]
        true = (found - truth) ** 2 / (truth**2 + DARK) / SIDE**2
        noise = 0.05 / SIDE**2  # relative, of what is seen, or twice that of the difference
        assert result.error == pytest.approx(true, rel=0.3, abs=noise)
        assert not result.error_uncertain


@pytest.mark.parametrize("spp", [1, 2, 3, 17, 100])
@pytest.mark.parametrize("sampler", ["sobol", "independent"])
@pytest.mark.parametrize("radiance", [1.0, 1e15])
def test_it_is_measured_after_any_number_of_samples(
    spp: int, sampler: str, radiance: float
) -> None:
    lamp = drpt.Sphere(LAMP.center, PIXEL, radiance=radiance)
    scene = drpt.Scene(CAMERA, [lamp])
    result = drpt.render(scene, spp, 0, sampler=sampler, target_error=1e-30)
    assert np.isnan(result.error) == (spp == 1)
    assert not result.error > 1e3
