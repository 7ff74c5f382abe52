"""One launch: the samples of some pixels, summed on the device."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import drjit as dr
import numpy as np

from drpt.kernel.vec import vec2

if TYPE_CHECKING:
    from drjit.auto import Bool, Float, UInt32
    from numpy.typing import NDArray

    from drpt.kernel.camera import DeviceCamera
    from drpt.kernel.path import Tracer
    from drpt.kernel.sampler import Sampler


class Sums(NamedTuple):
    """Sums over the samples of each pixel of a launch.

    ``radiance`` (pixels, 3) in float64, number of ``rays``, and number of samples per pixel that
    were not finite (pixels,).
    """

    radiance: NDArray[np.float64]
    rays: int
    non_finite: NDArray[np.int64]


@dataclass
class Wavefront:
    tracer: Tracer
    camera: DeviceCamera
    sampler: type[Sampler]
    jitter: bool

    def launch(self, first_pixel: int, pixels: int, lanes: int, first: int, count: int, seed: int) -> Sums:
        types = self.tracer.scene.types
        U = types.UInt32
        op = lambda v: dr.opaque(U, v)
        lane = dr.arange(U, pixels * lanes)
        pixels_, lanes_, first_, count_, seed_ = op(pixels), op(lanes), op(first), op(count), op(seed)
        replicate = lane // pixels_
        pixel = op(first_pixel) + lane - replicate * pixels_
        total = types.Array3f64(0)
        rays = U(0); bad = U(0)
        i = U(replicate)
        def cond(i, total, rays, bad): return i < count_
        def body(i, total, rays, bad):
            s = self.sampler(pixel, first_ + i, seed_)
            u = s.next_2d(0) if self.jitter else vec2(types.Float32(.5), types.Float32(.5))
            L, r = self.tracer.trace(self.camera.ray(pixel, u), s)
            total = total + types.Array3f64(L)
            rays = rays + r
            exponent = 0x7F800000
            nf = dr.mask_t(i)(False)
            for c in L:
                nf |= (dr.reinterpret_array(U, c) & exponent) == exponent
            bad = bad + dr.select(nf, U(1), U(0))
            return i + lanes_, total, rays, bad
        i, total, rays, bad = dr.while_loop((i, total, rays, bad), cond, body)
        dr.eval(total, rays, bad)
        return np.array(total).T.reshape(lanes, pixels, 3).sum(0), int(np.array(rays).astype(np.int64).sum()), int(np.array(bad).sum())
