"""One launch: samples of some pixels, traced and summed on the device."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, NamedTuple

import drjit as dr
import numpy as np

from drpt.kernel.camera import DeviceCamera, make_camera
from drpt.kernel.denormals import flush_denormals
from drpt.kernel.device_scene import upload
from drpt.kernel.estimator import Features
from drpt.kernel.path import Tracer
from drpt.kernel.primitives import make_primitives
from drpt.kernel.sampler import SAMPLERS
from drpt.kernel.vec import vec2

if TYPE_CHECKING:
    from types import ModuleType

    from drjit.auto import Array3f, Array3f64, UInt32
    from numpy.typing import NDArray

    from drpt.kernel.estimator import Mode
    from drpt.kernel.sampler import Sampler
    from drpt.scene import Scene


class Sums(NamedTuple):
    """Sums over the samples of a launch.

    ``radiance`` of each pixel, (pixels, 3) or with more axes before; how many ``rays`` were traced;
    how many samples were ``non_finite``.
    """

    radiance: NDArray[np.float64]
    rays: int
    non_finite: int


@dataclass
class Launcher:
    """A scene and an estimator on the device, ready to trace samples."""

    tracer: Tracer
    camera: DeviceCamera
    sampler: type[Sampler]
    jitter: bool

    def launch(self, pixels: range, samples: range, replicates: int, seed: int) -> Sums:
        """Trace a range of samples of each pixel in a range.

        Each pixel takes ``replicates`` lanes that share its samples, each every so manyth. All of
        the arguments are inputs of one and the same kernel.
        """
        lanes = self._launch(pixels, samples, replicates, replicates, _word_of(seed, samples))
        return lanes._replace(radiance=lanes.radiance.sum(axis=0))

    def launch_samples(self, pixel: int, samples: range, seed: int) -> NDArray[np.float64]:
        """Radiance (samples, 3) of each sample of a pixel by itself; the same kernel once more."""
        count, word = len(samples), _word_of(seed, samples)
        lanes = self._launch(range(pixel, pixel + 1), samples, count, count, word)
        return lanes.radiance[:, 0]

    def launch_passes(self, pixels: range, samples: range, passes: range, seed: int) -> Sums:
        """Trace a range of samples of each pixel in a range, once in each independent pass.

        The same kernel as that of :meth:`launch`; ``radiance`` is (passes, pixels, 3) here.
        """
        return self._launch(pixels, samples, len(passes), 1, _seed_word(seed) + passes.start)

    def _launch(
        self, pixels: range, samples: range, lanes: int, sharing: int, seed_word: int
    ) -> Sums:
        """Trace with several lanes for each pixel; ``radiance`` is (lanes, pixels, 3).

        So many after each other are ``sharing`` the samples of a seed; the next ones take the next.
        """
        index = self.tracer.scene.types.UInt32
        numbers = (
            pixels.start,
            len(pixels),
            samples.start & 0xFFFFFFFF,
            len(samples),
            sharing,
            seed_word & 0xFFFFFFFF,
        )
        lane = dr.arange(index, len(pixels) * lanes)
        radiance, rays, non_finite = self._trace(lane, *(dr.opaque(index, n) for n in numbers))
        with flush_denormals():
            dr.eval(radiance, rays, non_finite)
            dr.sync_thread()
        by_lane = np.stack([np.array(channel) for channel in radiance], axis=-1)
        by_pixel = by_lane.reshape(lanes, len(pixels), 3)
        return Sums(by_pixel, _total(rays), _total(non_finite))

    def _trace(
        self,
        lane: UInt32,
        first_pixel: UInt32,
        pixels: UInt32,
        first_sample: UInt32,
        samples: UInt32,
        sharing: UInt32,
        seed: UInt32,
    ) -> tuple[Array3f64, UInt32, UInt32]:
        """Sum up the samples of each lane: radiance, rays, and how many were not finite."""
        types = self.tracer.scene.types
        number = lane // pixels
        pixel = first_pixel + lane - number * pixels
        which = number // sharing
        start = number - which * sharing
        seed = seed + which

        def add_sample(
            i: UInt32, total: Array3f64, rays: UInt32, non_finite: UInt32
        ) -> tuple[UInt32, Array3f64, UInt32, UInt32]:
            radiance, traced = self._sample(self.sampler(pixel, first_sample + i, seed))
            x, y, z = (dr.isfinite(channel) for channel in radiance)
            return (
                i + sharing,
                total + types.Array3f64(radiance),
                rays + traced,
                non_finite + dr.select(x & y & z, 0, 1),
            )

        zeros = (dr.zeros(t, len(lane)) for t in (types.Array3f64, types.UInt32, types.UInt32))
        return dr.while_loop((start, *zeros), lambda i, *_: i < samples, add_sample)[1:]

    def _sample(self, sampler: Sampler) -> tuple[Array3f, UInt32]:
        middle = self.tracer.scene.types.Float32(0.5)
        offset = sampler.next_2d(0) if self.jitter else vec2(middle, middle)
        return self.tracer.trace(self.camera.ray(sampler.pixel, offset), sampler)

    def operations(self) -> int:
        """Dr.Jit's count of the operations in the kernel."""
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            dr.kernel_history_clear()
            self.launch(range(1), range(0), 1, 0)
            kernels = dr.kernel_history((dr.KernelType.JIT,))
        return max((kernel["operation_count"] for kernel in kernels), default=0)


def make_launcher(
    types: ModuleType, scene: Scene, bounces: int, mode: Mode, sampler: str, *, jitter: bool
) -> Launcher:
    """Put a scene on the device of the backend ``types``, for kernels with what it needs."""
    primitives = make_primitives(scene)
    if len(primitives.triangles) or len(primitives.light_corners) > len(primitives.light_facets):
        types = import_module(f"{types.__name__}.ad")  # Mitsuba's, for its meshes
    features = Features.of(primitives, bounces, mode)
    if not (features.diffuse or features.phong):
        bounces = 0
    tracer = Tracer(upload(primitives, types), features, mode, bounces)
    camera = make_camera(scene.camera, primitives.origin, types)
    return Launcher(tracer, camera, SAMPLERS[sampler], jitter)


def _seed_word(seed: int) -> int:
    return int(np.random.SeedSequence(seed).generate_state(1)[0])


def _word_of(seed: int, samples: range) -> int:
    """What stands for the seed in a sampler, whose index has 32 bits."""
    return _seed_word(seed) + (samples.start >> 32)


def _total(counts: UInt32) -> int:
    return int(np.array(counts).sum(dtype=np.int64))
