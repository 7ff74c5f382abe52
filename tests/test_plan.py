"""Which samples passes take, and which pixels and runs their launches."""

from __future__ import annotations

from itertools import islice, pairwise

import pytest

from drpt.plan import (
    FIRST_PASS,
    LAUNCH_LANES,
    LAUNCH_PATHS,
    LAUNCH_PIXELS,
    LEAST_PASS,
    parts,
    plan_passes,
    run_length,
)

PIXELS = [1, 7, 96, 65536, 2**20, 2**24, 65536**2]
MAX_PATHS = 2**24  # of the first passes of a picture of 2²⁰ pixels or fewer


@pytest.mark.parametrize("growing", [False, True])
@pytest.mark.parametrize("pixels", PIXELS)
@pytest.mark.parametrize("spp", [1, 15, 16, 17, 63, 64, 4096, 10**6 + 1])
def test_plans_cover_every_sample_once(pixels: int, spp: int, growing: bool) -> None:
    end = 0
    for samples in islice(plan_passes(pixels, spp, growing=growing), 5000):
        assert samples.start == end
        end = samples.stop
    assert end == spp or end >= 5000


@pytest.mark.parametrize("growing", [False, True])
@pytest.mark.parametrize("pixels", PIXELS)
def test_passes_are_bounded_and_do_not_cross_multiples_of_2_to_32(
    pixels: int, growing: bool
) -> None:
    passes = list(islice(plan_passes(pixels, 2**34 + 5, growing=growing), 64))
    for samples in passes:
        assert len(samples).bit_count() == 1 or samples.stop == 2**34 + 5
        assert samples.start >> 32 == (samples.stop - 1) >> 32
        assert len(samples) * min(pixels, 2**20) <= LAUNCH_PATHS == MAX_PATHS


@pytest.mark.parametrize("pixels", PIXELS)
def test_passes_of_equal_length_unless_they_grow(pixels: int) -> None:
    lengths = [len(samples) for samples in islice(plan_passes(pixels, 2**34), 20)]
    assert len(set(lengths)) == 1
    grown = [len(samples) for samples in islice(plan_passes(pixels, 2**34, growing=True), 40)]
    assert grown[0] == min(FIRST_PASS, lengths[0])
    assert all(b in (a, 2 * a) for a, b in pairwise(grown))
    assert max(grown) == lengths[0]


@pytest.mark.parametrize("growing", [False, True])
@pytest.mark.parametrize("pixels", [96, 65536, 2**20])
@pytest.mark.parametrize("spp", [10, 1000, 2**19 + 3])
def test_a_plan_can_be_taken_up_after_any_pass(pixels: int, spp: int, growing: bool) -> None:
    whole = list(islice(plan_passes(pixels, spp, growing=growing), 100))
    for number, samples in enumerate(whole[:90]):
        rest = list(islice(plan_passes(pixels, spp, samples.stop, growing=growing), 5))
        assert rest == whole[number + 1 : number + 6]


@pytest.mark.parametrize("pixels", PIXELS)
def test_fewer_paths_make_shorter_passes_that_others_can_follow(pixels: int) -> None:
    short = list(islice(plan_passes(pixels, 2**34, paths=LAUNCH_PATHS // 64), 3))
    assert len({len(samples) for samples in short}) == 1
    longest = len(next(plan_passes(pixels, 2**34)))
    assert len(short[0]) == max(LEAST_PASS, longest // 64)
    after = list(islice(plan_passes(pixels, 2**34, short[-1].stop), 20))
    assert all(samples.start % len(samples) == 0 for samples in after)
    assert len(after[-1]) == longest


def test_plans_depend_on_resolution_and_spp_alone() -> None:
    assert list(plan_passes(4096**2, 4096)) == list(plan_passes(4096**2, 4096))
    assert list(plan_passes(96, 10)) == [range(10)]


@pytest.mark.parametrize("pixels", [1, 96, LAUNCH_PIXELS, LAUNCH_PIXELS + 1, 2**20 + 3])
def test_parts_cover_every_pixel_once(pixels: int) -> None:
    found = parts(pixels)
    assert [pixel for part in found for pixel in part] == list(range(pixels))
    assert max(map(len, found)) <= LAUNCH_PIXELS


@pytest.mark.parametrize("paths_per_ray", [1, 4])
@pytest.mark.parametrize("pixels", [1, 96, 10_000, 2**18, 2**24])
@pytest.mark.parametrize("count", [1, 3, 4, 16, 100, 2**14])
def test_runs_are_powers_of_two_and_fill_the_device(
    pixels: int, count: int, paths_per_ray: int
) -> None:
    run = run_length(pixels, range(count), paths_per_ray)
    assert run.bit_count() == 1
    assert run % paths_per_ray == 0
    runs = -(-count // run)
    assert runs >= min(4, count // paths_per_ray)
    lanes = runs * min(pixels, LAUNCH_PIXELS)
    assert run == paths_per_ray or lanes >= min(LAUNCH_LANES, pixels * count) // 2
    assert lanes <= 8 * LAUNCH_LANES  # whose results take memory
