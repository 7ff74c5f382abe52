"""Launches: sums of runs, sample numbers beyond 2³², and what leaves the kernel as it is."""

from __future__ import annotations

from functools import partial
from itertools import product
from typing import TYPE_CHECKING, Any

import drjit as dr
import numpy as np
import pytest

import drpt
from drpt.kernel.estimator import Mode
from drpt.kernel.launch import PATHS_PER_RAY, Launcher, Sums, make_launcher
from tests.conftest import TYPES

if TYPE_CHECKING:
    from collections.abc import Callable

    from drpt.scene import Shape
    from tests.oracle.arrays import Floats

# Other runs add the same float32 samples up in another order, in float64.
SUMMATION = 1e-12

# Means of 2^19 paths with and without shared rays, relative: four standard errors.
SHARED = 2e-3

# Operations that no kernel has which only copies results.
TRACING = 100

EYE = (0.0, -4.0, 2.0)


def scene_of(
    *,
    albedo: float = 0.5,
    exponent: float = 20,
    radiance: float = 3,
    radius: float = 0.5,
    place: tuple[float, float, float] = (-1, 0, 1.5),
    eye: tuple[float, float, float] = EYE,
    fov: float = 50,
    room: bool = False,
) -> drpt.Scene:
    lamps: list[Shape] = [
        drpt.Sphere(place, radius, radiance=radiance),
        drpt.Sphere((0, 1, 1), 0.1, radiance=radiance),
    ]
    floor = [[-3, -3, 0], [3, -3, 0], [3, 3, 0], [-3, 3, 0]]
    return drpt.Scene(
        camera=drpt.Camera(eye, (0, 0, 0.5), (0, 0, 1), fov, 16, 8),
        shapes=[
            drpt.Mesh(floor, [[0, 1, 2], [0, 2, 3]], material=drpt.Diffuse(albedo)),
            drpt.Sphere((1, 0, 0.5), 0.5, material=drpt.Phong(albedo, exponent)),
            *([mesh_of_a_room(), lamps[0]] if room else lamps),
        ],
    )


def mesh_of_a_room() -> drpt.Mesh:
    corners = 5 * np.array([*product((-1, 1), repeat=3)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    halves = [half for a, b, c, d in quads for half in ((a, b, c), (a, c, d))]
    return drpt.Mesh(corners, halves, material=drpt.Diffuse(0.5))


def launcher_of(
    scene: drpt.Scene | None = None, mode: str = "mis", sampler: str = "sobol"
) -> Launcher:
    """A launcher; the sampler "shared" is Sobol's, and lets paths share their camera rays."""
    shared = sampler == "shared"
    scene = scene or scene_of(room=shared)
    name = "sobol" if shared else sampler
    launcher = make_launcher(TYPES, scene, 2, Mode(mode), name, jitter=True, share_rays=shared)
    assert launcher.paths_per_ray == (PATHS_PER_RAY if shared else 1)
    return launcher


def equal(a: Sums, b: Sums) -> bool:
    return np.array_equal(a.radiance, b.radiance) and a[1:] == b[1:]


def test_sums_are_float64_by_pixel() -> None:
    sums = launcher_of().launch(range(128), range(4), 4, 0)
    assert sums.radiance.shape == (1, 128, 3)
    assert sums.radiance.dtype == np.float64
    assert sums.rays >= 128 * 4
    assert sums.non_finite == 0


@pytest.mark.parametrize("sampler", ["sobol", "independent", "shared"])
def test_pixels_are_the_same_however_they_are_launched(sampler: str) -> None:
    launcher = launcher_of(sampler=sampler)
    whole = launcher.launch(range(128), range(8), 4, 5)
    parts = [launcher.launch(range(a, a + 32), range(8), 4, 5) for a in range(0, 128, 32)]
    assert np.array_equal(np.concatenate([p.radiance for p in parts], axis=1), whole.radiance)
    assert sum(part.rays for part in parts) == whole.rays


@pytest.mark.parametrize("first", [0, 16, 2**40])
@pytest.mark.parametrize("sampler", ["sobol", "independent", "shared"])
def test_a_run_is_the_samples_that_follow_each_other(sampler: str, first: int) -> None:
    launcher = launcher_of(sampler=sampler)
    whole = launcher.launch(range(100, 110), range(first, first + 10), 4, 5)
    starts = first, first + 4, first + 8
    runs = [range(start, min(start + 4, first + 10)) for start in starts]
    alone = [launcher.launch(range(100, 110), run, 4, 5) for run in runs]
    assert whole.radiance.any(axis=(1, 2)).all()
    assert np.array_equal(whole.radiance, np.concatenate([sums.radiance for sums in alone]))
    assert whole.rays == sum(sums.rays for sums in alone)


@pytest.mark.parametrize("sampler", ["sobol", "shared"])
@pytest.mark.parametrize("run", [4, *(pytest.param(n, marks=pytest.mark.slow) for n in (2, 8, 16))])
def test_runs_part_a_pixels_samples(run: int, sampler: str) -> None:
    launcher = launcher_of(sampler=sampler)
    one = launcher.launch(range(100, 110), range(22), 32, 0)
    many = launcher.launch(range(100, 110), range(22), run, 0)
    assert len(many.radiance) == -(-22 // max(run, launcher.paths_per_ray))
    assert many.radiance.sum(axis=0) == pytest.approx(one.radiance[0], rel=SUMMATION)
    assert many.rays == one.rays


@pytest.mark.parametrize("samples", [range(16), range(3, 6), range(6, 17), range(2**40, 2**40 + 5)])
@pytest.mark.parametrize("sampler", ["sobol", "shared"])
def test_a_range_is_the_sum_of_its_samples(samples: range, sampler: str) -> None:
    launcher = launcher_of(sampler=sampler)
    whole = launcher.launch(range(100, 110), samples, 4, 0)
    single = [launcher.launch(range(100, 110), range(i, i + 1), 1, 0) for i in samples]
    total = np.sum([sums.radiance[0] for sums in single], axis=0)
    assert total == pytest.approx(whole.radiance.sum(axis=0), rel=SUMMATION)


def test_shared_rays_save_rays_and_keep_the_mean() -> None:
    shared = launcher_of(sampler="shared")
    plain = launcher_of(scene_of(room=True))
    pixels, samples = range(128), range(4096)
    a, b = (launcher.launch(pixels, samples, 1024, 0) for launcher in (shared, plain))
    assert a.rays < 0.8 * b.rays
    assert a.radiance.sum() == pytest.approx(b.radiance.sum(), rel=SHARED)


def test_no_samples_give_nothing() -> None:
    sums = launcher_of().launch(range(4), range(0), 1, 0)
    assert not sums.radiance.any()
    assert sums.rays == sums.non_finite == 0


@pytest.mark.parametrize("sampler", ["sobol", "independent", "shared"])
def test_samples_beyond_2_to_32_are_new_ones(sampler: str) -> None:
    launcher = launcher_of(sampler=sampler)
    starts = [0, 16, 2**32 - 16, 2**32, 2**32 + 16, 2**33, 2**47]
    sums = [launcher.launch(range(128), range(s, s + 16), 16, 0).radiance for s in starts]
    for index, radiance in enumerate(sums):
        assert all(not np.array_equal(radiance, other) for other in sums[:index])
        assert radiance.mean() == pytest.approx(sums[0].mean(), rel=0.2)


@pytest.mark.parametrize("seeds", [(0, 1), (0, 2**32), (1, 2**64 + 1), (5, 5 + 2**31)])
def test_seeds_give_other_samples(seeds: tuple[int, int]) -> None:
    launcher = launcher_of()
    a, b = (launcher.launch(range(128), range(4), 1, seed) for seed in seeds)
    assert not np.array_equal(a.radiance, b.radiance)


def kernel_of(work: Callable[[], Any]) -> str:
    """Hash of the only kernel that traces on the way: equal ones are compiled once, if at all."""
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        work()
        kernels = dr.kernel_history((dr.KernelType.JIT,))
    (tracing,) = (kernel for kernel in kernels if kernel["operation_count"] > TRACING)
    return str(tracing["hash"])


CHANGES: dict[str, dict[str, Any]] = {
    "albedo": {"albedo": 0.25},
    "exponent": {"exponent": 300},
    "radiance": {"radiance": 11},
    "radius of a light": {"radius": 0.3},
    "place of a light": {"place": (-0.5, 0.5, 1.75)},
    "eye": {"eye": (1.0, -5.0, 2.0)},
    "fov": {"fov": 30},
}


@pytest.mark.parametrize("mode", Mode)
def test_what_radiates_and_where_the_camera_is_compile_nothing(mode: str) -> None:
    def launched(**change: Any) -> tuple[str, Floats]:
        sums: list[Sums] = []
        launcher = launcher_of(scene_of(**change), mode)
        kernel = kernel_of(lambda: sums.append(launcher.launch(range(128), range(64), 16, 0)))
        return kernel, sums[0].radiance

    kernel, plain = launched()
    for change in CHANGES.values():
        found, radiance = launched(**change)
        assert found == kernel
        assert not np.array_equal(radiance, plain)


def test_launches_of_any_range_run_and_seed_compile_nothing() -> None:
    launcher = launcher_of()
    launches = [
        (range(64), range(2), 1, 0),
        (range(64), range(9), 4, 1),
        (range(7, 100), range(2**40, 2**40 + 3), 2, 12345),
    ]
    assert len({kernel_of(partial(launcher.launch, *launch)) for launch in launches}) == 1


def test_whether_rays_are_shared_compiles_nothing() -> None:
    scene, sums = scene_of(room=True), list[Sums]()

    def work(share_rays: bool) -> None:
        what = TYPES, scene, 2, Mode.EXPLICIT, "sobol"
        launcher = make_launcher(*what, jitter=True, share_rays=share_rays)
        sums.append(launcher.launch(range(64), range(8), 4, 0))

    assert kernel_of(lambda: work(True)) == kernel_of(lambda: work(False))
    assert sums[1].rays > sums[0].rays


def test_the_hash_sees_another_kernel() -> None:
    """Geometry is part of it: triangles that differ in a corner."""

    def kernel(corner: float) -> str:
        triangle = drpt.Mesh(
            [[0.0, 0, 0], [corner, 0, 0], [0, 1, 0.0]], [[0, 1, 2]], material=drpt.Diffuse(0.5)
        )
        scene = drpt.Scene(camera=scene_of().camera, shapes=[triangle, scene_of().shapes[-1]])
        return kernel_of(lambda: launcher_of(scene).launch(range(16), range(1), 1, 0))

    assert kernel(1.25) == kernel(1.25)
    assert kernel(1.25) != kernel(1.5)


def test_operations_do_not_depend_on_what_was_launched() -> None:
    launcher = launcher_of()
    before = launcher.operations()
    launcher.launch(range(128), range(3), 1, 0)
    assert launcher.operations() == before > 100


@pytest.mark.parametrize("sampler", ["sobol", "independent", "shared"])
def test_passes_are_launches_of_their_own(sampler: str) -> None:
    launcher = launcher_of(sampler=sampler)
    pixels, samples = range(5, 100), range(8)
    four = launcher.launch_passes(pixels, samples, range(4), 7)
    assert four.radiance.shape == (4, 95, 3)
    assert np.array_equal(four.radiance[0], launcher.launch(pixels, samples, 8, 7).radiance[0])
    last = launcher.launch_passes(pixels, samples, range(3, 4), 7)
    assert np.array_equal(last.radiance[0], four.radiance[3])
    assert len({radiance.tobytes() for radiance in four.radiance}) == 4


def test_passes_take_the_kernel_of_launches() -> None:
    launcher = launcher_of()
    passes = partial(launcher.launch_passes, range(64), range(8), range(5, 9), 3)
    assert kernel_of(passes) == kernel_of(lambda: launcher.launch(range(64), range(2), 1, 0))
