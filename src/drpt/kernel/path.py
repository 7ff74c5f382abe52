"""The path tracer.

A path starts at the eye and meets the vertices x₁ x₂ …; ω_i is the direction in which it goes on
at x_i, chosen with the density p. The throughput up to vertex i is

    beta_i = ∏_{j < i}  f(x_j, ω_j) cos θ_j / p(ω_j),

and with k bounces the radiance along the first ray is estimated by

    implicit    Σ_{i ≤ k+1}  beta_i L_e(x_i)
    explicit    L_e(x₁) + Σ_{i ≤ k}  beta_i f(x_i, ω') cos θ' L_e(ω') V(ω') / p_light(ω')
    mis         L_e(x₁) + both sums from there on, each term weighted by the power heuristic,

where ω' leads from x_i to a sampled point of a light, and V tells whether nothing stands between
(Kajiya 1986; Veach 1997, ch. 8–10).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import drjit as dr

from drpt.kernel.brdf import Brdf, make_brdf
from drpt.kernel.camera import Ray
from drpt.kernel.intersect import Hit, closest_hit, occluded
from drpt.kernel.light import choose_light, inverse_pdf, power_heuristic, sample_light
from drpt.kernel.vec import vec3
from drpt.kernel.warp import sphere_pdf, square_to_sphere

if TYPE_CHECKING:
    from drjit.auto import Array3f, Bool, Float, UInt32

    from drpt.kernel.device_scene import DeviceScene
    from drpt.kernel.estimator import Features, Mode
    from drpt.kernel.sampler import Sampler


UNROLLED_VERTICES = 4
"""So many vertices of a path stand one after the other in the kernel; a loop takes the rest."""


class Path(NamedTuple):
    """A path that has reached a ray towards its next vertex."""

    origin: Array3f
    direction: Array3f
    active: Bool  # whether there is a next vertex
    beta: Array3f  # throughput up to it
    pdf: Float  # density of the direction by the BRDF, for MIS
    radiance: Array3f  # collected so far
    rays: UInt32  # traced so far


@dataclass
class Tracer:
    """A path tracer for one scene and one estimator."""

    scene: DeviceScene
    features: Features
    mode: Mode
    bounces: int

    def trace(self, ray: Ray, sampler: Sampler) -> tuple[Array3f, UInt32]:
        """Radiance (W/(m² sr), three channels) along camera rays, and how many rays it took."""
        types = self.scene.types
        path = Path(
            origin=ray.origin,
            direction=ray.direction,
            active=types.Bool(True),
            beta=types.Array3f(1),
            pdf=types.Float32(0),
            radiance=types.Array3f(0),
            rays=types.UInt32(0),
        )
        unrolled = min(self._vertices, UNROLLED_VERTICES)
        for depth in range(unrolled):
            path = self._vertex(path, sampler, depth)
        if unrolled < self._vertices:
            path = self._loop(path, sampler, unrolled)
        return path.radiance, path.rays

    def _loop(self, path: Path, sampler: Sampler, first: int) -> Path:
        """Follow the paths that go on, from vertex number ``first``."""

        def goes_on(depth: UInt32, *path: Any) -> Bool:
            return Path(*path).active & (depth < self._vertices)

        def step(depth: UInt32, *path: Any) -> tuple[Any, ...]:
            return depth + 1, *self._vertex(Path(*path), sampler, depth)

        state: tuple[Any, ...] = (self.scene.types.UInt32(first), *path)
        return Path(*dr.while_loop(state, goes_on, step)[1:])

    @property
    def _vertices(self) -> int:
        """How many vertices a path has, beside the eye; the last one only emits."""
        if not self.features.emission:
            return 0
        return self.bounces + 1 if self.bounces == 0 or self.mode.counts_hits else self.bounces

    def _vertex(self, path: Path, sampler: Sampler, depth: int | UInt32) -> Path:
        """Find the next vertex, collect the light that it sends, and choose where to go on."""
        scene, features = self.scene, self.features
        ray = Ray(path.origin, path.direction)
        radiance, rays = path.radiance, path.rays + dr.select(path.active, 1, 0)
        is_first = isinstance(depth, int) and depth == 0
        hit = closest_hit(scene, features, ray, path.active, from_camera=is_first)
        if is_first or self.mode.counts_hits:
            weighted = features.mis and not is_first
            emitted = self._emission(ray, hit, path.pdf if weighted else None)
            radiance = radiance + path.beta * emitted
        if isinstance(depth, int) and depth == self.bounces:
            return path._replace(radiance=radiance, rays=rays)
        reflects = hit.primitive < scene.first_light
        hit = hit._replace(valid=hit.valid & reflects & (depth < self.bounces))
        brdf = make_brdf(scene, features, hit, -ray.direction)
        if features.direct_light:
            light, traced = self._direct(hit, brdf, sampler, depth)
            radiance = radiance + path.beta * light
            rays = rays + dr.select(traced, 1, 0)
        if isinstance(depth, int) and depth == self._vertices - 1:
            return path._replace(radiance=radiance, rays=rays)
        direction, weight = self._next_direction(brdf, sampler, depth)
        beta = path.beta * weight
        active = hit.valid & ~(dr.max(beta) <= 0)  # not a number goes on, to be counted
        pdf = brdf.pdf(direction) if features.mis else path.pdf
        return Path(hit.point, direction, active, beta, pdf, radiance, rays)

    def _emission(self, ray: Ray, hit: Hit, pdf: Float | None) -> Array3f:
        """L_e at a hit; weighted against light sampling where a BRDF's density led there."""
        scene = self.scene
        lit = hit.valid & (hit.primitive >= scene.first_light) & hit.front
        light = scene.types.UInt32(0)
        if scene.light_count > 1:
            light = dr.select(lit, hit.primitive - scene.first_light, 0)
        row = scene.radiance_row(light)
        radiance = vec3(row[0], row[1], row[2])
        if pdf is not None:
            density = 1 / inverse_pdf(scene, self.features, ray, light, hit)
            radiance = radiance * power_heuristic(density / pdf)
        return dr.select(lit, radiance, 0)

    def _direct(
        self, hit: Hit, brdf: Brdf, sampler: Sampler, depth: int | UInt32
    ) -> tuple[Array3f, Bool]:
        """Direct light by one sample of one light, and where that took a shadow ray."""
        scene, features = self.scene, self.features
        light = choose_light(scene, features, lambda: sampler.next_1d(_decision(depth, 0)))
        u = sampler.next_2d(_decision(depth, 1))
        sample = sample_light(scene, features, self.mode, hit.point, light, u)
        value = brdf.eval(sample.direction) * sample.radiance * sample.inverse_pdf
        if features.mis:
            value *= power_heuristic(brdf.pdf(sample.direction) * sample.inverse_pdf)
        traced = hit.valid & ~(dr.max(value) <= 0)
        shadow = occluded(scene, Ray(hit.point, sample.direction), sample.distance, light, traced)
        return dr.select(traced & ~shadow, value, 0), traced

    def _next_direction(
        self, brdf: Brdf, sampler: Sampler, depth: int | UInt32
    ) -> tuple[Array3f, Array3f]:
        """The direction in which a path goes on, and its weight f cos θ / p."""
        u = sampler.next_2d(_decision(depth, 2))
        if self.mode.samples_brdf:
            return brdf.sample(u)
        direction = square_to_sphere(u)
        return direction, brdf.eval(direction) / sphere_pdf()


def _decision(depth: int | UInt32, kind: int) -> int | UInt32:
    """Number of a vertex' decision: light (0), point on it (1), next direction (2)."""
    return 1 + 3 * depth + kind
