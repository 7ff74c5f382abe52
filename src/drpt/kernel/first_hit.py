"""First hits: what the camera sees at once, as layers that denoisers and viewers take.

The launches that trace paths trace only camera rays here, and accumulate a feature of the first hit
instead of radiance.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING, NamedTuple

import drjit as dr
import numpy as np

from drpt.immutable import immutable
from drpt.kernel.backend import interrupts_put_off
from drpt.kernel.camera import make_camera
from drpt.kernel.estimator import Features, Mode
from drpt.kernel.integrators.directions import unguided
from drpt.kernel.integrators.path import Tracer, Vertex
from drpt.kernel.intersect import closest_hit
from drpt.kernel.launch import Launcher, covered, prepare
from drpt.kernel.recording import NONE
from drpt.kernel.sampler import SAMPLERS
from drpt.kernel.vec import vec3
from drpt.scene.picture_plane import picture_plane

if TYPE_CHECKING:
    from types import ModuleType

    from drjit.auto import Array3f
    from numpy.typing import NDArray

    from drpt.kernel.bsdfs import Bsdf
    from drpt.kernel.camera import Ray
    from drpt.kernel.intersect import Hit, Known
    from drpt.kernel.primitives import Primitives
    from drpt.kernel.sampler import Sampler
    from drpt.scene import Camera, Scene

LAUNCH_PIXELS = 2**20
"""Pixels of a launch at the most, which bounds its memory to some 100 MB."""
LAUNCH_SAMPLES = 2**4
"""Samples of a launch, of each pixel, at the most: an interrupt waits for its end."""


def first_hits(
    types: ModuleType,
    scene: Scene,
    spp: int,
    *,
    sampler: str = "sobol",
    seed: int = 0,
    jitter: bool = True,
) -> dict[str, NDArray[np.float32]]:
    """Average features of the first hits of camera rays, on the backend ``types``.

    Sample number k of a pixel goes through the same point as camera ray number k of a render with
    the same sampler, seed and jitter; the pixel filter is the same box.

    Returns
    -------
    dict
        Layers of float32, row 0 at the top:

        - ``albedo`` (height, width, 3), from 0 to 1: that of the surface. The front of a light
          counts as white; its back, and the background, as black.
        - ``normal`` (height, width, 3): the shading normal in world space, on the side of the
          camera; 0 for the background. A mean of unit vectors is shorter where they differ.
        - ``depth`` (height, width): how far ahead of the eye, along the camera's axis. That is z
          in camera space, as compositors and Blender's channel ``Depth.Z`` have it; Mitsuba's
          depth, ``T``, is the distance from the eye instead. The mean of the samples that meet
          something; infinite where none does.
    """
    with interrupts_put_off():
        primitives, on_device = prepare(scene.shapes, types)
        on_device = on_device.seen_from(scene.camera.eye - primitives.origin, primitives)
        features = _features(primitives)
        covering = covered(scene.camera, scene.shapes, types) if features.covered_pixels else None
        camera = make_camera(scene.camera, primitives.origin, on_device.types)
        estimator = on_device, features, Mode.IMPLICIT, 0
        directions = unguided(Mode.IMPLICIT, features)
        forward = _axis(scene.camera, on_device.types)

    def mean(tracer: Tracer) -> NDArray[np.float64]:
        launcher = Launcher(tracer, camera, covering, SAMPLERS[sampler], jitter, 1, primitives)
        return _mean(launcher, scene.camera, spp, seed)

    far, share, _ = np.moveaxis(
        mean(_DepthTracer(*estimator, forward, directions=directions)), -1, 0
    )
    layers = {
        "albedo": mean(_AlbedoTracer(*estimator, directions=directions)),
        "normal": mean(_NormalTracer(*estimator, directions=directions)),
        "depth": np.divide(far, share, out=np.full_like(far, np.inf), where=share > 0),
    }
    return {name: immutable(layer.astype(np.float32)) for name, layer in layers.items()}


class Seen(NamedTuple):
    """First hits of the rays through the centres of all n pixels, row by row.

    Attributes
    ----------
    shape
        Numbers of shapes (n,), `NONE` for the background.
    front
        Whether the ray hits the front (n,).
    point
        The points that are hit, in world space (n, 3).
    """

    shape: NDArray[np.intp]
    front: NDArray[np.bool_]
    point: NDArray[np.float64]


def first_seen(types: ModuleType, scene: Scene) -> Seen:
    """Trace a ray through the centre of each pixel, on the backend ``types``."""
    with interrupts_put_off():
        primitives, on_device = prepare(scene.shapes, types)
        features = replace(_features(primitives), covered_pixels=False)
        camera = make_camera(scene.camera, primitives.origin, on_device.types)
        directions = unguided(Mode.IMPLICIT, features)
        tracer = _PlaceTracer(on_device, features, Mode.IMPLICIT, 0, directions=directions)
        sampler = SAMPLERS["independent"]
        launcher = Launcher(tracer, camera, None, sampler, False, 1, primitives)
    place = _mean(launcher, scene.camera, 1, 0)
    primitive, distance, front = place.reshape(-1, 3).T
    plane = picture_plane(scene.camera)
    y, x, _ = np.indices((*place.shape[:2], 1)).reshape(3, -1, 1) + 0.5
    ways = plane.corner + x * plane.right + y * plane.down
    ways *= (distance / np.linalg.norm(ways, axis=1))[:, None]
    shapes = np.append(primitives.shape, NONE)  # index -1 is the background
    return Seen(shapes[primitive.astype(np.intp) - 1], front > 0, scene.camera.eye + ways)


def _features(primitives: Primitives) -> Features:
    """Features of a kernel for first hits: all surfaces, lit or not.

    Without any surface, as for shapes without area, nothing is traced.
    """
    return replace(
        Features.of(primitives, 0, Mode.IMPLICIT),
        emission=len(primitives.shape) > 0,
        spheres=len(primitives.spheres) > 0,
        triangles=len(primitives.planes) > 0,
        interpolated_normals=len(primitives.smooth_corners) > 0,
    )


def _axis(camera: Camera, types: ModuleType) -> Array3f:
    """The unit vector along which a camera looks, an input of the kernel."""
    return types.Array3f(*(dr.opaque(types.Float32, x) for x in camera.axes().forward))


def _mean(launcher: Launcher, camera: Camera, spp: int, seed: int) -> NDArray[np.float64]:
    """Means (height, width, 3) of the feature over the samples of each pixel."""
    sums = np.zeros((camera.height * camera.width, 3))
    parts = _split(len(sums), LAUNCH_PIXELS), _split(spp, LAUNCH_SAMPLES)
    for pixels, samples in product(*parts):
        with interrupts_put_off():
            one_run = launcher.launch(pixels, samples, len(samples), seed)
        sums[pixels.start : pixels.stop] += one_run.radiance[0]
    return (sums / spp).reshape(camera.height, camera.width, 3)


def _split(count: int, size: int) -> list[range]:
    return [range(start, min(start + size, count)) for start in range(0, count, size)]


class _FirstHitTracer(Tracer, ABC):
    """A tracer of camera rays only, with a feature of the first hit in place of radiance."""

    def first_vertex(self, ray: Ray, sampler: Sampler, known: Known | None = None) -> Vertex:
        path = self.start(ray)
        hit = closest_hit(self.scene.geometry, self.features, ray, path.active, known)
        bsdf = self.bsdf(hit, -ray.direction)
        feature = dr.select(hit.valid, self._feature(ray, hit, bsdf), 0)
        return Vertex(path._replace(radiance=feature), hit.valid, hit, bsdf)

    @abstractmethod
    def _feature(self, ray: Ray, hit: Hit, bsdf: Bsdf) -> Array3f:
        """The feature of a hit; anything where there is none."""


class _AlbedoTracer(_FirstHitTracer):
    def _feature(self, ray: Ray, hit: Hit, bsdf: Bsdf) -> Array3f:
        lit = (hit.primitive >= self.scene.geometry.first_light) & hit.front
        return dr.select(lit, 1, bsdf.albedo)


class _NormalTracer(_FirstHitTracer):
    def _feature(self, ray: Ray, hit: Hit, bsdf: Bsdf) -> Array3f:
        """The normal of a light is not of unit length, and 0 where its centre rounds to the hit."""
        length = dr.norm(hit.shading_normal)
        return dr.select(length > 0, hit.shading_normal / length, -ray.direction)


class _PlaceTracer(_FirstHitTracer):
    """The number of the primitive plus 1, the distance, and 1 if the front is hit, else 0."""

    def _feature(self, ray: Ray, hit: Hit, bsdf: Bsdf) -> Array3f:
        kind = type(hit.distance)
        return vec3(kind(hit.primitive + 1), hit.distance, dr.select(hit.front, kind(1), 0))


@dataclass
class _DepthTracer(_FirstHitTracer):
    """Depth, and 1 to count the hits."""

    forward: Array3f

    def _feature(self, ray: Ray, hit: Hit, bsdf: Bsdf) -> Array3f:
        depth = hit.distance * dr.dot(ray.direction, self.forward)
        one = type(depth)(1)
        return vec3(depth, one, one)
