"""What a guide knows: how much of the direct light patches send each other.

Every pair of patches exchanges a few rays between random points of them. The light that one brings
is that of a path of one more bounce, traced as in a render of the scene, and what it is worth to
the receiver its share of the form factor.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import drjit as dr
import numpy as np

from drpt.kernel.camera import Ray
from drpt.kernel.denormals import flush_denormals
from drpt.kernel.device_scene import to_device
from drpt.kernel.estimator import Features, Mode
from drpt.kernel.guide import Guide
from drpt.kernel.intersect import SPAWN_OFFSET
from drpt.kernel.patches import make_patches
from drpt.kernel.path import Tracer
from drpt.kernel.sampler import SobolSampler
from drpt.kernel.vec import largest, vec3

if TYPE_CHECKING:
    from collections.abc import Callable

    from drjit.auto import Array3f, Float, UInt32
    from numpy.typing import NDArray

    from drpt.kernel.device_scene import DeviceScene
    from drpt.kernel.patches import Patches
    from drpt.kernel.primitives import Primitives

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


def _exchange(primitives: Primitives, scene: DeviceScene, patches: Patches) -> NDArray[np.float64]:
    """The light that reaches each patch (its first index) from each other, (n, n)."""
    mode = Mode.EXPLICIT if primitives.diffuse.all() else Mode.MIS
    tracer = Tracer(scene, Features.of(primitives, 1, mode), mode, 1)
    there = np.flatnonzero(patches.facet >= 0)
    exchange = _Exchange(tracer, patches, there)
    mean = exchange.light(dr.arange(scene.types.UInt32, len(there) ** 2))
    with flush_denormals():
        dr.eval(mean)
        dr.sync_thread()
    light = np.zeros((len(patches.facet), len(patches.facet)))
    light[np.ix_(there, there)] = np.array(mean).reshape(len(there), -1)
    return light


class _Exchange:
    """Rays from patches to patches."""

    def __init__(self, tracer: Tracer, patches: Patches, there: NDArray[np.intp]) -> None:
        self._tracer, self._types, self._count = tracer, tracer.scene.types, len(there)
        corner = np.column_stack([patches.corner, patches.facet])
        right = np.pad(patches.right, ((0, 0), (0, 1)))
        up = np.column_stack([patches.up, patches.area])
        self._rows = to_device(np.concatenate([corner, right, up], axis=1)[there], self._types)

    def light(self, pair: UInt32) -> Float:
        """Mean of what the rays of each pair bring; a pair has the number to + n from."""
        types = self._types
        receiver = pair // self._count
        sender = pair - receiver * self._count

        def trace(ray: UInt32, total: Float) -> tuple[UInt32, Float]:
            return ray + 1, total + self._ray(pair, receiver, sender, ray)

        end = dr.opaque(types.UInt32, RAYS)
        state: tuple[Any, ...] = (types.UInt32(0), dr.zeros(types.Float32, len(pair)))
        goes_on: Callable[..., Any] = lambda ray, _: ray < end  # noqa: E731
        return dr.while_loop(state, goes_on, trace)[1] / RAYS

    def _ray(self, pair: UInt32, receiver: UInt32, sender: UInt32, ray: UInt32) -> Float:
        """What one ray brings."""
        tracer, types = self._tracer, self._types
        seeds = (dr.opaque(types.UInt32, SEED + k) for k in range(2))
        here, there = (SobolSampler(pair, ray, seed) for seed in seeds)
        to, normal_to, _, _ = self._point(receiver, here)
        origin, normal, area, facet = self._point(sender, there)
        way = origin - to
        squared = dr.squared_norm(way)
        direction = way * dr.rsqrt(squared)
        cosine_to, cosine = (dr.dot(n, direction) for n in (normal_to, normal))
        off = dr.select(cosine_to > 0, normal_to, -normal_to) * (4 * SPAWN_OFFSET * largest(to))
        path = tracer.start(Ray(to + off, direction))
        faces = dr.abs(cosine_to * cosine) > 0
        vertex = tracer.arrive(path._replace(active=faces), here, 0)
        seen = faces & vertex.hit.valid & (vertex.hit.primitive == facet)
        radiance, _ = tracer.follow(vertex, here)
        form = dr.abs(cosine_to * cosine) * area / dr.maximum(squared, NEAR**2 * area)
        light = (radiance.x + radiance.y + radiance.z) * form
        return dr.select(seen & dr.isfinite(light), light, 0)

    def _point(
        self, patch: UInt32, sampler: SobolSampler
    ) -> tuple[Array3f, Array3f, Float, UInt32]:
        """A point of a patch, the normal there, the patch's area, and its facet."""
        types = self._types
        u = sampler.next_2d(0)
        a, b, c = (dr.gather(types.Array4f, self._rows, 3 * patch + k) for k in range(3))
        corner, right, up = (vec3(r[0], r[1], r[2]) for r in (a, b, c))
        facet = types.UInt32(a[3])
        row = self._tracer.scene.geometry_row(facet)
        point = dr.fma(right, u.x, dr.fma(up, u.y, corner))
        return point, vec3(row[0], row[1], row[2]), c[3], facet
