"""One launch: samples of some pixels, traced and summed on the device."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, NamedTuple

import drjit as dr
import numpy as np

from drpt.kernel.arithmetic import same_bits
from drpt.kernel.camera import DeviceCamera, make_camera
from drpt.kernel.compiled import COMPILED
from drpt.kernel.coverage import covering_facets
from drpt.kernel.device_scene import DeviceScene, to_device, upload
from drpt.kernel.estimator import Features, knows_all
from drpt.kernel.guiding.directions import GuidedDirections
from drpt.kernel.guiding.pilot import BOUNCES, Pilot, best_shares, fly
from drpt.kernel.guiding.share import GuideShares, make_shares, rounded
from drpt.kernel.guiding.training import learn
from drpt.kernel.integrators.directions import unguided
from drpt.kernel.integrators.path import Tracer
from drpt.kernel.kept import Kept
from drpt.kernel.primitives import make_primitives
from drpt.kernel.sampler import SAMPLERS, SobolSampler
from drpt.kernel.schedule import Lanes, Totals, Work

if TYPE_CHECKING:
    from types import ModuleType

    from drjit.auto import UInt32
    from numpy.typing import NDArray

    from drpt.kernel.estimator import Mode
    from drpt.kernel.guiding.guide import Guide
    from drpt.kernel.integrators.state import Path
    from drpt.kernel.primitives import Primitives
    from drpt.kernel.sampler import Sampler
    from drpt.scene import Camera, Scene, Shape


PATHS_PER_RAY = 4
"""Paths that share a camera ray, which alone takes half of the time of one with 2 bounces."""


class Sums(NamedTuple):
    """Sums over the samples of a launch.

    ``radiance`` of each pixel, (runs or passes, pixels, 3); how many ``rays`` were traced; how many
    samples were ``non_finite``.
    """

    radiance: NDArray[np.float64]
    rays: int
    non_finite: int


class SinglePaths(NamedTuple):
    """Paths along camera rays, a lane each.

    ``shared`` decides about their first vertex, where several of them may share a ray; ``own``
    about where they go on from there.
    """

    path: Path
    shared: Sampler
    own: Sampler


@dataclass
class Launcher:
    """A scene and an estimator on the device, ready to trace samples.

    So many samples after each other as ``paths_per_ray`` share their camera ray and the light
    that its first vertex gets from lights, from a multiple of that number on; each sample goes on
    from there by itself. ``covering`` are the numbers of the facets that fill the camera's pixels.
    """

    tracer: Tracer
    camera: DeviceCamera
    covering: UInt32 | None
    sampler: type[Sampler]
    jitter: bool
    paths_per_ray: int
    primitives: Primitives

    def __post_init__(self) -> None:
        self._token = object()  # not a field, so that digests leave it out

    def launch(self, pixels: range, samples: range, run: int, seed: int) -> Sums:
        """Trace a range of samples of each pixel in a range, in runs of so many after each other.

        A lane takes a run; ``radiance`` is (runs, pixels, 3). Paths that share a camera ray are in
        the same run. All of the arguments are inputs of one and the same kernel.
        """
        work = self._work(pixels, samples, run, _word_of(seed, samples))
        runs = max(1, -(-work.rays // work.run))
        return self._launch(work._replace(lanes=runs, sharing=runs))

    def launch_passes(self, pixels: range, samples: range, passes: range, seed: int) -> Sums:
        """Trace a range of samples of each pixel in a range, once in each independent pass.

        The same kernel as that of :meth:`launch`; ``radiance`` is (passes, pixels, 3).
        """
        work = self._work(pixels, samples, len(samples), _seed_word(seed) + passes.start)
        return self._launch(work._replace(lanes=len(passes)))

    @same_bits()
    def single_paths(self, pixel: int, samples: range, seed: int) -> SinglePaths:
        """The same paths as :meth:`launch` traces of a pixel, before their first vertex."""
        work = self._work(range(pixel, pixel + 1), samples, 1, _word_of(seed, samples))
        lanes = self._lanes(work._replace(lanes=len(samples), sharing=len(samples)))
        number = lanes.work.first_ray * lanes.work.paths + lanes.work.skipped
        number += dr.arange(type(number), len(samples))
        own, shared = lanes.sampler_at(number), lanes.sampler_at(number // lanes.work.paths)
        return SinglePaths(self.tracer.start(lanes.camera_ray(shared)), shared, own)

    def _work(self, pixels: range, samples: range, run: int, seed_word: int) -> Work:
        start, paths = samples.start & 0xFFFFFFFF, self.paths_per_ray
        stop = start % paths + len(samples)
        return Work(
            first_pixel=pixels.start,
            pixels=len(pixels),
            paths=paths,
            first_ray=start // paths,
            skipped=start % paths,
            stop=stop,
            rays=-(-stop // paths),
            run=-(-run // paths),
            lanes=1,
            sharing=1,
            seed=seed_word & 0xFFFFFFFF,
        )

    @same_bits()
    def _launch(self, work: Work) -> Sums:
        """Trace with so many lanes for each pixel; ``radiance`` is (lanes, pixels, 3)."""
        if not self.tracer.features.emission:
            return Sums(np.zeros((work.lanes, work.pixels, 3)), 0, 0)
        lanes = self._lanes(work)
        totals = self._trace(lanes)
        # One array, by the kernel that makes it.
        radiance = dr.empty(self.tracer.scene.types.Float64, 3 * lanes.count)
        dr.scatter(radiance, totals.radiance, lanes.place)
        dr.eval(radiance, totals.rays, totals.non_finite)
        dr.sync_thread()
        by_pixel = radiance.numpy().reshape(work.lanes, work.pixels, 3)
        return Sums(by_pixel, _total(totals.rays), _total(totals.non_finite))

    def _lanes(self, work: Work) -> Lanes:
        COMPILED.use(self._token)
        index = self.tracer.scene.types.UInt32
        return Lanes(
            self.tracer,
            self.camera,
            self.covering,
            self.sampler,
            jitter=self.jitter,
            lane=dr.arange(index, work.pixels * work.lanes),
            work=Work(*(dr.opaque(index, n) for n in work)),
        )

    def _trace(self, lanes: Lanes) -> Totals:
        if self.tracer.features.shared_rays and self.sampler is SobolSampler:
            return lanes.by_ray()  # also if each takes but one path: spp compiles nothing
        return lanes.by_vertex() if self.tracer.features.regeneration else lanes.by_path()

    def operations(self) -> int:
        """Dr.Jit's count of the operations in the kernel."""
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            dr.kernel_history_clear()
            self.launch(range(1), range(0), 1, 0)
            kernels = dr.kernel_history((dr.KernelType.JIT,))
        return max((kernel["operation_count"] for kernel in kernels), default=0)


def make_launcher(
    types: ModuleType,
    scene: Scene,
    bounces: int,
    mode: Mode,
    sampler: str,
    *,
    jitter: bool,
    share_rays: bool = False,
) -> Launcher:
    """Put a scene on the device of the backend ``types``, for kernels with what it needs.

    ``share_rays`` lets paths share their camera rays where they lose little by it; the kernel is
    the same without.
    """
    primitives, device_scene = prepare(scene.shapes, types)
    device_scene = device_scene.seen_from(scene.camera.eye - primitives.origin, primitives)
    shares = guide_shares(scene, bounces, mode, types)
    features = Features.of(primitives, bounces, mode, worthwhile=shares is not None)
    if not len(primitives.reflectance):
        bounces = 0
    directions = unguided(mode, features)
    if shares:
        directions = GuidedDirections(learned(scene.shapes, types), shares, bounces)
    tracer = Tracer(device_scene, features, mode, bounces, directions=directions)
    camera = make_camera(scene.camera, primitives.origin, device_scene.types)
    paths_per_ray = PATHS_PER_RAY if share_rays and features.shared_rays else 1
    covering = covered(scene.camera, scene.shapes, types) if features.covered_pixels else None
    return Launcher(tracer, camera, covering, SAMPLERS[sampler], jitter, paths_per_ray, primitives)


@Kept
def prepare(shapes: tuple[Shape, ...], types: ModuleType) -> tuple[Primitives, DeviceScene]:
    """Primitives of shapes, on the host and on the device: kept for the next render of them."""
    primitives = make_primitives(shapes)
    if len(primitives.triangles) or len(primitives.light_corners) > len(primitives.light_facets):
        types = import_module(f"{types.__name__}.ad")  # Mitsuba's, for its meshes
    return primitives, upload(primitives, types)


@Kept
def learned(shapes: tuple[Shape, ...], types: ModuleType) -> Guide:
    """What is known of shapes with diffuse facets: kept like them."""
    return learn(*prepare(shapes, types))


def guide_shares(scene: Scene, bounces: int, mode: Mode, types: ModuleType) -> GuideShares | None:
    """Shares of the directions that are guided; None if a guide is not worthwhile."""
    primitives, device_scene = prepare(scene.shapes, types)
    if not Features.of(primitives, bounces, mode).guiding:
        return None
    patches = learned(scene.shapes, types).patches
    shares: NDArray[np.float64] | None
    shares = rounded(make_shares(primitives, patches, bounces))
    if not knows_all(primitives):
        pilot = piloted(scene.camera, scene.shapes, types, min(bounces, BOUNCES))
        shares = best_shares(pilot, shares, bounces)
    if shares is None:
        return None
    return GuideShares(to_device(shares, device_scene.types), shares.shape[1])


@Kept
def piloted(camera: Camera, shapes: tuple[Shape, ...], types: ModuleType, bounces: int) -> Pilot:
    """Paths that estimate the benefit of a guide; kept for the next render by the same camera."""
    return fly(*prepare(shapes, types), camera, learned(shapes, types), bounces)


@Kept
def covered(camera: Camera, shapes: tuple[Shape, ...], types: ModuleType) -> UInt32:
    """Numbers of the facets that fill pixels: kept for the next render by the same camera."""
    primitives, scene = prepare(shapes, types)
    numbers: UInt32 = scene.types.UInt32(covering_facets(camera, primitives).ravel())
    return numbers


def forget() -> None:
    """Forget all that is kept for the next render."""
    for kept in (prepare, learned, piloted, covered):
        kept.forget()


def _seed_word(seed: int) -> int:
    return int(np.random.SeedSequence(seed).generate_state(1)[0])


def _word_of(seed: int, samples: range) -> int:
    """What stands for the seed in a sampler, whose index has 32 bits."""
    return _seed_word(seed) + (samples.start >> 32)


def _total(counts: UInt32) -> int:
    return int(counts.numpy().sum(dtype=np.int64))
