"""The noise that a guide is expected to save, estimated from a few paths that follow the BRDF.

A path of density p whose contribution X_d is collected at vertex d would be found by guided
directions, too. The density of its directions is p ∏ m_d there, with

    m_d = 1 − c + c q / p,

for the guide's share c and its density q. With a guide the path collects
Σ X_d / ∏_{j ≤ d} m_j, the second moment of which is a mean over the paths of the BRDF,

    E [ (Σ_d X_d / ∏_{j ≤ d} m_j)² ∏_j m_j ].

So the same paths tell the noise for any share. What no guide changes, the light that the first
vertex gets from lights, counts as it is. Sobol' points spread the paths of the BRDF evenly, and
those of a guide less so: the noise of the former is that of the means of runs of samples.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import drjit as dr
import numpy as np

from drpt.kernel.arithmetic import same_bits
from drpt.kernel.camera import make_camera
from drpt.kernel.estimator import Features, Mode
from drpt.kernel.guiding.share import rounded
from drpt.kernel.integrators.directions import unguided
from drpt.kernel.integrators.path import Tracer
from drpt.kernel.patches import COLUMNS
from drpt.kernel.sampler import SobolSampler
from drpt.kernel.warp import cosine_hemisphere_pdf

if TYPE_CHECKING:
    from drjit.auto import Float, UInt32
    from numpy.typing import NDArray

    from drpt.kernel.device_scene import DeviceScene
    from drpt.kernel.guiding.guide import Guide
    from drpt.kernel.integrators.path import Vertex
    from drpt.kernel.integrators.state import Path
    from drpt.kernel.primitives import Primitives
    from drpt.kernel.sampler import Sampler
    from drpt.scene import Camera

    Array = NDArray[np.float64]

PIXELS, SAMPLES = 512, 32
"""Approximate number of pixels of the picture, and number of samples of each."""
BOUNCES = 3
"""Largest number of bounces: the effect of a share on rare bright paths shows at the second guided
vertex."""
SEED = 0x9E3779B9
"""Seed of the paths, whatever the seed of the render."""
DARK = 1 / 4
"""Fraction of the median radiance of lit pixels; squared, it is added to squared radiance.

So dark pixels do not dominate, and the brightness of the lamps has no effect.
"""
SCALES = (1.0, 0.75, 0.5, 0.25)
"""Factors of the shares among which the best is chosen."""
WORTHWHILE = 0.9
"""A guide is used if the relMSE with it is certain to be below this fraction of that without."""
CERTAIN = 1.96
"""Standard errors from an estimate to the upper end of its 95 % interval."""


class Pilot(NamedTuple):
    """Paths of each pixel by the BRDF, (vertices, pixels, samples).

    ``light`` is what each collects at its vertices, ``ratio`` q / p of the directions between, and
    ``row`` the row of the patch that each starts from, 0 where nothing is guided.
    """

    light: Array
    ratio: Array
    row: NDArray[np.uint32]


class Expected(NamedTuple):
    """RelMSE with a guide over that without, as a pilot estimates it, and its standard error."""

    value: float
    error: float

    @property
    def at_most(self) -> float:
        """Upper end of the interval that covers 95 %."""
        return self.value + CERTAIN * self.error


@same_bits()
def fly(
    primitives: Primitives, scene: DeviceScene, camera: Camera, guide: Guide, bounces: int
) -> Pilot:
    """Trace the paths of a pilot."""
    features = Features.of(primitives, bounces, Mode.GUIDED)
    directions = unguided(Mode.GUIDED, features)
    tracer = Tracer(scene, features, Mode.GUIDED, bounces, directions=directions)
    factor = (PIXELS / (camera.width * camera.height)) ** 0.5
    width, height = (max(1, round(factor * n)) for n in (camera.width, camera.height))
    small = make_camera(replace(camera, width=width, height=height), primitives.origin, scene.types)
    lane = dr.arange(scene.types.UInt32, width * height * SAMPLES)
    pixel = lane // SAMPLES
    seed = dr.opaque(scene.types.UInt32, SEED)
    sampler = SobolSampler(pixel, lane - pixel * SAMPLES, seed)
    first = tracer.first_vertex(small.ray(pixel, sampler.next_2d(0)), sampler)
    found = _follow(tracer, guide, first, sampler)
    dr.eval(found)
    dr.sync_thread()
    light, ratio, row = (np.array([x.numpy() for x in part]) for part in found)
    shape = -1, width * height, SAMPLES
    light, ratio = (part.astype(np.float64).reshape(shape) for part in (light, ratio))
    with np.errstate(invalid="ignore"):  # infinite light: no guide is used
        return Pilot(np.diff(light, axis=0, prepend=0), ratio, row.reshape(shape))


def _follow(
    tracer: Tracer, guide: Guide, vertex: Vertex, sampler: Sampler
) -> tuple[list[Float], list[Float], list[UInt32]]:
    """Light up to each vertex, q / p of each direction, and the row of patches that it leaves."""
    light, ratio, row = [_mean(vertex.path)], [], []
    for depth in range(tracer.bounces - 1):
        start, patch = vertex, _patch(guide, vertex)
        vertex = tracer.arrive(tracer.leave(start, sampler, depth), sampler, depth + 1)
        light.append(_mean(vertex.path))
        ratio.append(_ratio(guide, start, patch, vertex))
        row.append(patch // COLUMNS)
    if tracer.counts_hits:
        last = tracer.leave(vertex, sampler, tracer.bounces - 1)
        light[-1] = _mean(tracer.step(last, sampler, tracer.bounces))
    return light, ratio, row


def _mean(path: Path) -> Float:
    return dr.sum(path.radiance) / 3


def _patch(guide: Guide, vertex: Vertex) -> UInt32:
    """The patch from which directions are guided; 0 where they are not."""
    patch = guide.patch_of(vertex.hit)
    return dr.select(vertex.bsdf.is_diffuse, patch, type(patch)(0))


def _ratio(guide: Guide, start: Vertex, patch: UInt32, end: Vertex) -> Float:
    """Density of the guide over that of the BRDF, of a direction that leads to a vertex."""
    direction, hit = end.path.direction, end.hit
    by_area = guide.density(patch, guide.patch_of(hit))
    q = by_area * dr.square(hit.distance) / dr.abs(dr.dot(hit.normal, direction))
    p = cosine_hemisphere_pdf(dr.dot(start.bsdf.point.shading_normal, direction))
    return dr.select(by_area > 0, q / p, 0)


def best_shares(pilot: Pilot, shares: Array, bounces: int) -> Array | None:
    """Shares times the scale with the least noise; None where none is worthwhile (host).

    Every estimate counts by the upper end of its interval: a guide that may bring nothing is none.
    """
    scaled = [rounded(scale * shares) for scale in SCALES]
    errors = [expected(pilot, table, bounces).at_most for table in scaled]
    best = int(np.argmin(errors))
    return scaled[best] if errors[best] < WORTHWHILE else None


def expected(pilot: Pilot, shares: Array, bounces: int) -> Expected:
    """Expected relMSE with a guide over that without; infinite if it is unknown (host)."""
    light, ratio, row = pilot
    guided, weight, density = np.zeros_like(light[0]), 1.0, 1.0
    with np.errstate(all="ignore"):
        for depth, (r, rows) in enumerate(zip(ratio, row, strict=True)):
            share = shares[rows, min(bounces - 1 - depth, shares.shape[1] - 1)]
            mixture = 1 - share + share * r
            weight, density = weight / mixture, density * mixture
            guided += light[depth + 1] * weight
        total, later = light.sum(axis=0), light[1:].sum(axis=0)
        variance = (guided**2 * density).mean(axis=1) - _squared_mean(later)
        noise = _variance_of_runs(light[0]) + variance
        relative = 1 / _weighable(total.mean(axis=1))
        return _ratio_of_sums(noise * relative, _variance_of_runs(total) * relative)


def _weighable(radiance: Array) -> Array:
    """Squares of the pixels' radiance, and of what is dark among them; of no light all are nan."""
    lit = radiance[radiance > 0]
    return np.asarray(radiance**2 + (DARK * np.median(lit) if len(lit) else np.nan) ** 2)


def _ratio_of_sums(above: Array, below: Array) -> Expected:
    """Ratio of two sums over the pixels, with its standard error; pixels are independent."""
    value = above.sum() / below.sum()
    error = np.linalg.norm(above - value * below) / below.sum()
    return Expected(float(value), float(error)) if np.isfinite(error) else Expected(np.inf, 0)


def _variance_of_runs(samples: Array) -> Array:
    """Variance of the mean of half of each pixel's samples, times their number."""
    count = samples.shape[1] // 2
    first, second = samples[:, :count].mean(axis=1), samples[:, count:].mean(axis=1)
    return np.asarray(count * (first - second) ** 2 / 2)


def _squared_mean(samples: Array) -> Array:
    """The square of each pixel's expectation, from pairs of different samples."""
    count = samples.shape[1]
    squares = samples.sum(axis=1) ** 2 - (samples**2).sum(axis=1)
    return np.asarray(squares / (count * (count - 1)))
