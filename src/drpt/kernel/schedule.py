"""In which order a lane traces its samples; all orders give the same sums, up to rounding."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import drjit as dr

from drpt.kernel.integrators.state import Path
from drpt.kernel.intersect import UNKNOWN, Known
from drpt.kernel.vec import types_of, vec2

if TYPE_CHECKING:
    from collections.abc import Callable

    from drjit.auto import Array3f, Array3f64, UInt32

    from drpt.kernel.camera import DeviceCamera, Ray
    from drpt.kernel.integrators.path import Tracer
    from drpt.kernel.sampler import Sampler


class Work(NamedTuple):
    """What the lanes of a launch are to do: numbers, which are inputs of its kernel.

    Samples count from the first path of the camera ray number ``first_ray``; so many as ``skipped``
    are not asked for, and those from ``stop`` on.
    """

    first_pixel: Any
    pixels: Any
    paths: Any  # that share a camera ray
    first_ray: Any
    skipped: Any
    stop: Any
    rays: Any  # up to the one of the last sample
    run: Any  # camera rays that a lane takes at the most
    lanes: Any  # of each pixel
    sharing: Any  # of them, that share the samples of a seed
    seed: Any


class Totals(NamedTuple):
    """Sums of each lane."""

    radiance: Array3f64
    rays: UInt32
    non_finite: UInt32

    def plus(self, radiance: Array3f, rays: UInt32, samples: Any = 1) -> Totals:
        """With one more sample, or none."""
        x, y, z = (dr.isfinite(channel) for channel in radiance)
        return Totals(
            self.radiance + type(self.radiance)(radiance),
            self.rays + rays,
            self.non_finite + dr.select(x & y & z, 0, samples),
        )


class Lanes:
    """Lanes of a launch: a pixel each, and which of its samples.

    Those of the same pixel are neighbours, so that they jump over the same code. So many of them as
    ``sharing`` take the samples of one seed, a run each, and the next ones take the next seed.
    ``covering`` is the number of the facet that fills each pixel of the camera, if that is known.
    ``place`` is where the sums of each lane belong, in the order (lanes, pixels).
    """

    def __init__(
        self,
        tracer: Tracer,
        camera: DeviceCamera,
        covering: UInt32 | None,
        sampler: type[Sampler],
        *,
        jitter: bool,
        lane: UInt32,
        work: Work,
    ) -> None:
        pixel = lane // work.lanes
        number = lane - pixel * work.lanes
        which = number // work.sharing
        self.tracer, self.camera, self.covering = tracer, camera, covering
        self.sampler, self.jitter = sampler, jitter
        self.work, self.types = work, types_of(lane)
        self.pixel, self.place = work.first_pixel + pixel, number * work.pixels + pixel
        self.seed = work.seed + which
        self.first = (number - which * work.sharing) * work.run
        self.last = dr.minimum(self.first + work.run, work.rays)
        self.count = len(lane)

    def by_path(self) -> Totals:
        """One path after the other, from camera to end."""
        first_sample, known = self.work.first_ray, self._known()

        def add_path(sample: UInt32, *totals: Any) -> tuple[Any, ...]:
            sampler = self.sampler_at(first_sample + sample)
            first = self.tracer.first_vertex(self.camera_ray(sampler), sampler, known)
            traced = self.tracer.follow(first, sampler)
            return sample + 1, *Totals(*totals).plus(*traced)

        return Totals(*self._loop(add_path, lambda sample, *_: sample < self.last))

    def by_ray(self) -> Totals:
        """One camera ray after the other, each with the paths that share it."""
        work = self.work
        first_sample, known = work.first_ray * work.paths, self._known()

        def add_ray(ray: UInt32, *totals: Any) -> tuple[Any, ...]:
            sampler = self.sampler_at(work.first_ray + ray)
            first = self.tracer.first_vertex(self.camera_ray(sampler), sampler, known)
            once = Totals(*totals)
            once = once._replace(rays=once.rays + first.path.rays)
            first = first._replace(path=first.path._replace(rays=self.types.UInt32(0)))

            def add_path(sample: UInt32, *totals: Any) -> tuple[Any, ...]:
                traced = self.tracer.follow(first, self.sampler_at(first_sample + sample))
                return sample + 1, *Totals(*totals).plus(*traced)

            begin = dr.maximum(ray * work.paths, work.skipped)
            end = dr.minimum((ray + 1) * work.paths, work.stop)
            state: tuple[Any, ...] = (begin, *once)
            sums = dr.while_loop(state, lambda sample, *_: sample < end, add_path)[1:]
            return ray + 1, *sums

        return Totals(*self._loop(add_ray, lambda ray, *_: ray < self.last))

    def by_vertex(self) -> Totals:
        """One vertex after the other: where a path has ended, the next one starts at once.

        So no lane waits for the longest path among its neighbours (Novák et al. 2010, "Path
        Regeneration for Interactive Path Tracing"); in turn all vertices share one piece of code.
        """
        tracer, fields = self.tracer, len(Path._fields)
        first_sample = self.work.first_ray

        def add_vertex(sample: UInt32, depth: UInt32, *state: Any) -> tuple[Any, ...]:
            sampler = self.sampler_at(first_sample + sample)
            path, totals = Path(*state[:fields]), Totals(*state[fields:])
            fresh = tracer.start(self.camera_ray(sampler))
            now: list[Any] = [
                dr.select(depth == 0, *pair) for pair in zip(fresh, path, strict=True)
            ]
            path = tracer.step(Path(*now), sampler, depth)
            ends = ~path.active
            totals = totals.plus(
                dr.select(ends, path.radiance, 0),
                dr.select(ends, path.rays, 0),
                dr.select(ends, self.types.UInt32(1), 0),
            )
            sample = sample + dr.select(ends, self.types.UInt32(1), 0)
            return sample, dr.select(ends, 0, depth + 1), *path, *totals

        any_path = tracer.start(self.camera_ray(self.sampler_at(self.first)))
        zero = dr.zeros(self.types.UInt32, self.count)
        sums = self._loop(add_vertex, lambda sample, *_: sample < self.last, zero, *any_path)
        return Totals(*sums[-3:])

    def _loop(
        self, body: Callable[..., tuple[Any, ...]], goes_on: Callable[..., Any], *state: Any
    ) -> Any:
        zeros = (
            dr.zeros(t, self.count)
            for t in (self.types.Array3f64, self.types.UInt32, self.types.UInt32)
        )
        start: tuple[Any, ...] = (self.first, *state, *zeros)
        return dr.while_loop(start, goes_on, body)[1:]

    def _known(self) -> Known | None:
        """What all camera rays of each lane's pixel meet."""
        if self.covering is None:
            return None
        facet = dr.gather(self.types.UInt32, self.covering, self.pixel)
        return Known(facet, self.tracer.scene.geometry.row(facet, facet != UNKNOWN))

    def sampler_at(self, index: UInt32) -> Sampler:
        """The sampler of a sample, or of a camera ray, of each lane's pixel."""
        return self.sampler(self.pixel, index, self.seed)

    def camera_ray(self, sampler: Sampler) -> Ray:
        """A ray through each lane's pixel."""
        middle = self.types.Float32(0.5)
        offset = sampler.next_2d(0) if self.jitter else vec2(middle, middle)
        return self.camera.ray(self.pixel, offset)
