"""Launches: sums, sample numbers beyond 2³², and what does not compile anew."""

from __future__ import annotations

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

# Replicates add the same float32 samples up in another order, in float64.
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
    eye: tuple[float, float, float] = EYE,
    fov: float = 50,
    room: bool = False,
) -> drpt.Scene:
    lamps: list[Shape] = [
        drpt.Sphere((-1, 0, 1.5), radius, radiance=radiance),
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
    sums = launcher_of().launch(range(128), range(4), 1, 0)
    assert sums.radiance.shape == (128, 3)
    assert sums.radiance.dtype == np.float64
    assert sums.rays >= 128 * 4
    assert sums.non_finite == 0


@pytest.mark.parametrize("sampler", ["sobol", "independent", "shared"])
def test_pixels_and_samples_are_the_same_however_they_are_launched(sampler: str) -> None:
    launcher = launcher_of(sampler=sampler)
    whole = launcher.launch(range(128), range(8), 1, 5)
    parts = [launcher.launch(range(a, a + 32), range(8), 1, 5) for a in range(0, 128, 32)]
    assert np.array_equal(np.concatenate([part.radiance for part in parts]), whole.radiance)
    assert sum(part.rays for part in parts) == whole.rays
    halves = [launcher.launch(range(128), half, 1, 5) for half in (range(4), range(4, 8))]
    total = halves[0].radiance + halves[1].radiance
    assert total == pytest.approx(whole.radiance, rel=SUMMATION)


@pytest.mark.parametrize("sampler", ["sobol", "shared"])
@pytest.mark.parametrize(
    "replicates", [3, *(pytest.param(n, marks=pytest.mark.slow) for n in (2, 8, 16))]
)
def test_replicates_share_a_pixels_samples(replicates: int, sampler: str) -> None:
    launcher = launcher_of(sampler=sampler)
    one = launcher.launch(range(100, 110), range(8), 1, 0)
    many = launcher.launch(range(100, 110), range(8), replicates, 0)
    assert many.radiance == pytest.approx(one.radiance, rel=SUMMATION)
    assert many.rays == one.rays


@pytest.mark.parametrize("samples", [range(16), range(3, 6), range(6, 17), range(2**40, 2**40 + 5)])
@pytest.mark.parametrize("sampler", ["sobol", "shared"])
def test_a_range_is_the_sum_of_its_samples(samples: range, sampler: str) -> None:
    launcher = launcher_of(sampler=sampler)
    whole = launcher.launch(range(100, 110), samples, 1, 0)
    single = [launcher.launch(range(100, 110), range(i, i + 1), 1, 0) for i in samples]
    total = np.sum([sums.radiance for sums in single], axis=0)
    assert total == pytest.approx(whole.radiance, rel=SUMMATION)


def test_shared_rays_save_rays_and_keep_the_mean() -> None:
    shared = launcher_of(sampler="shared")
    plain = launcher_of(scene_of(room=True))
    pixels, samples = range(128), range(4096)
    a, b = (launcher.launch(pixels, samples, 4, 0) for launcher in (shared, plain))
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
    sums = [launcher.launch(range(128), range(s, s + 16), 1, 0).radiance for s in starts]
    for index, radiance in enumerate(sums):
        assert all(not np.array_equal(radiance, other) for other in sums[:index])
        assert radiance.mean() == pytest.approx(sums[0].mean(), rel=0.2)


@pytest.mark.parametrize("seeds", [(0, 1), (0, 2**32), (1, 2**64 + 1), (5, 5 + 2**31)])
def test_seeds_give_other_samples(seeds: tuple[int, int]) -> None:
    launcher = launcher_of()
    a, b = (launcher.launch(range(128), range(4), 1, seed) for seed in seeds)
    assert not np.array_equal(a.radiance, b.radiance)


def compiled_kernels(work: Callable[[], Any]) -> int:
    """How many kernels were compiled, not found in memory or on disk, on the way."""
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        work()
        kernels = dr.kernel_history((dr.KernelType.JIT,))
    tracing = [kernel for kernel in kernels if kernel["operation_count"] > TRACING]
    assert len(tracing) == 1
    return sum(not kernel["cache_hit"] for kernel in tracing)


CHANGES: dict[str, dict[str, Any]] = {
    "albedo": {"albedo": 0.25},
    "exponent": {"exponent": 300},
    "radiance": {"radiance": 11},
    "radius of a light": {"radius": 0.3},
    "eye": {"eye": (1.0, -5.0, 2.0)},
    "fov": {"fov": 30},
}


@pytest.mark.parametrize("mode", Mode)
def test_what_radiates_and_where_the_camera_is_compile_nothing(mode: str) -> None:
    def work(**change: Any) -> Sums:
        return launcher_of(scene_of(**change), mode).launch(range(128), range(64), 1, 0)

    plain = work()
    for change in CHANGES.values():
        sums: list[Sums] = []
        assert compiled_kernels(lambda: sums.append(work(**change))) == 0  # noqa: B023
        assert not np.array_equal(sums[0].radiance, plain.radiance)


def test_launches_of_any_range_and_seed_compile_nothing() -> None:
    launcher = launcher_of()
    launcher.launch(range(64), range(2), 1, 0)
    ranges = [(range(64), range(9), 1), (range(7, 100), range(2**40, 2**40 + 3), 2)]
    for pixels, samples, replicates in ranges:
        work = lambda: launcher.launch(pixels, samples, replicates, 12345)  # noqa: B023, E731
        assert compiled_kernels(work) == 0


def test_whether_rays_are_shared_compiles_nothing() -> None:
    def work(*, share_rays: bool) -> Sums:
        scene, mode = scene_of(room=True), Mode.EXPLICIT
        launcher = make_launcher(TYPES, scene, 2, mode, "sobol", jitter=True, share_rays=share_rays)
        return launcher.launch(range(64), range(8), 1, 0)

    shared = work(share_rays=True)
    plain: list[Sums] = []
    assert compiled_kernels(lambda: plain.append(work(share_rays=False))) == 0
    assert plain[0].rays > shared.rays


def test_the_count_sees_a_compilation() -> None:
    """Geometry is part of the kernel: a triangle that no other test has."""
    corner = float(np.random.default_rng().uniform(1, 2))
    triangle = drpt.Mesh(
        [[0.0, 0, 0], [corner, 0, 0], [0, 1, 0.0]], [[0, 1, 2]], material=drpt.Diffuse(0.5)
    )
    scene = drpt.Scene(camera=scene_of().camera, shapes=[triangle, scene_of().shapes[-1]])
    work = lambda: launcher_of(scene).launch(range(16), range(1), 1, 0)  # noqa: E731
    assert compiled_kernels(work) == 1
    assert compiled_kernels(work) == 0


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
    assert np.array_equal(four.radiance[0], launcher.launch(pixels, samples, 1, 7).radiance)
    last = launcher.launch_passes(pixels, samples, range(3, 4), 7)
    assert np.array_equal(last.radiance[0], four.radiance[3])
    assert len({radiance.tobytes() for radiance in four.radiance}) == 4


def test_passes_take_the_kernel_of_launches() -> None:
    launcher = launcher_of()
    launcher.launch(range(64), range(2), 1, 0)
    work = lambda: launcher.launch_passes(range(64), range(8), range(5, 9), 3)  # noqa: E731
    assert compiled_kernels(work) == 0
