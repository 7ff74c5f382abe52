"""What a guide knows: how much of the direct light patches send each other.

Every pair of patches exchanges a few rays between random points of them. The light that one brings
is that of a path of one more bounce, traced as in a render of the scene, and what it is worth to
the receiver its share of the form factor.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import drjit as dr
import numpy as np

from drpt.kernel.arithmetic import same_bits
from drpt.kernel.camera import Ray
from drpt.kernel.device_scene import to_device
from drpt.kernel.estimator import Features, Mode
from drpt.kernel.guiding.guide import DevicePatches, Guide
from drpt.kernel.integrators.directions import unguided
from drpt.kernel.integrators.path import Tracer
from drpt.kernel.intersect import SPAWN_OFFSET
from drpt.kernel.patches import make_patches
from drpt.kernel.sampler import SobolSampler
from drpt.kernel.vec import largest, vec3

if TYPE_CHECKING:
    from collections.abc import Callable

    from drjit.auto import Array3f, Float, UInt32
    from numpy.typing import NDArray

    from drpt.kernel.device_scene import DeviceScene
    from drpt.kernel.guiding.guide import Spot
    from drpt.kernel.patches import Patches
    from drpt.kernel.primitives import Primitives
    from drpt.kernel.sampler import Sampler

RAYS = 16
"""Rays between two patches."""
NEAR = 1 / 4
"""Of a patch's size: points that are nearer count as so far apart."""
SEED = 0x9E3779B9
"""Of the rays; a render's seed changes nothing of what is known."""


def learn(primitives: Primitives, scene: DeviceScene) -> Guide:
    """Look around in a scene with diffuse facets."""
    patches = make_patches(primitives.facets)
    light = _exchange(primitives, scene, patches)
    upload = partial(to_device, types=scene.types)
    return Guide(patches, light, scene.types, upload)


@same_bits()
def _exchange(primitives: Primitives, scene: DeviceScene, patches: Patches) -> NDArray[np.float64]:
    """The light that reaches each of the patches that there are from each other, (k, k)."""
    mode = Mode.EXPLICIT if primitives.diffuse.all() else Mode.MIS
    features = Features.of(primitives, 1, mode)
    tracer = Tracer(scene, features, mode, 1, directions=unguided(mode, features))
    there = patches.there
    on_device = DevicePatches(patches, scene.types, partial(to_device, types=scene.types))
    exchange = _Exchange(tracer, on_device, scene.types.UInt32(there.astype(np.uint32)))
    mean = exchange.light(dr.arange(scene.types.UInt32, len(there) ** 2))
    dr.eval(mean)
    dr.sync_thread()
    return mean.numpy().reshape(len(there), -1).astype(np.float64)


@dataclass
class _Exchange:
    """Rays from patches to patches, which have the numbers ``there``."""

    tracer: Tracer
    patches: DevicePatches
    there: UInt32

    def light(self, pair: UInt32) -> Float:
        """Mean of what the rays of each pair bring; a pair has the number to + n from."""
        types, count = self.tracer.scene.types, len(self.there)
        number = pair // count
        receiver = dr.gather(types.UInt32, self.there, number)
        sender = dr.gather(types.UInt32, self.there, pair - number * count)

        def trace(ray: UInt32, total: Float) -> tuple[UInt32, Float]:
            here, other = (
                SobolSampler(pair, ray, dr.opaque(types.UInt32, SEED + k)) for k in range(2)
            )
            to = self.patches.spot(receiver, here.next_2d(0))
            origin = self.patches.spot(sender, other.next_2d(0))
            return ray + 1, total + self._sent(origin, to, here)

        end = dr.opaque(types.UInt32, RAYS)
        state: tuple[Any, ...] = (types.UInt32(0), dr.zeros(types.Float32, len(pair)))
        goes_on: Callable[..., Any] = lambda ray, _: ray < end  # noqa: E731
        return dr.while_loop(state, goes_on, trace)[1] / RAYS

    def _sent(self, origin: Spot, to: Spot, sampler: Sampler) -> Float:
        """What a ray brings from one spot to another, along which it is followed back."""
        way = origin.point - to.point
        squared = dr.squared_norm(way)
        direction = way * dr.rsqrt(squared)
        normal = self._normal(to)
        cosine = dr.dot(normal, direction)
        cosines = dr.abs(cosine * dr.dot(self._normal(origin), direction))
        off = dr.select(cosine > 0, normal, -normal) * (4 * SPAWN_OFFSET * largest(to.point))
        path = self.tracer.start(Ray(to.point + off, direction))
        vertex = self.tracer.arrive(path._replace(active=cosines > 0), sampler, 0)
        seen = vertex.hit.valid & (vertex.hit.primitive == origin.facet)
        radiance, _ = self.tracer.follow(vertex, sampler)
        form = cosines * origin.area / dr.maximum(squared, NEAR**2 * origin.area)
        light = (radiance.x + radiance.y + radiance.z) * form
        # What is not finite tells nothing here; the samples of a render that are not are counted.
        return dr.select(seen & dr.isfinite(light), light, 0)

    def _normal(self, spot: Spot) -> Array3f:
        plane = self.tracer.scene.geometry.row(spot.facet).shape
        return vec3(plane[0], plane[1], plane[2])
