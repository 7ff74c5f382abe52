"""The path tracer.

A path starts at the eye and meets the vertices x₁ x₂ …; ω_i is the direction in which it goes on
at x_i, chosen with the density p. The throughput up to vertex i is

    beta_i = ∏_{j < i}  f(x_j, ω_j) cos θ_j / p(ω_j),

and with k bounces the radiance along the first ray is estimated by

    implicit    Σ_{i ≤ k+1}  beta_i L_e(x_i)
    explicit    L_e(x₁) + Σ_{i ≤ k}  beta_i f(x_i, ω') cos θ' L_e(ω') V(ω') / p_light(ω')
    mis         L_e(x₁) + both sums from there on, each term weighted by the power heuristic,
    guided      as mis, or as explicit where that has little noise, with guided directions,

where ω' leads from x_i to a sampled point of a light, and V tells whether nothing stands between
(Kajiya 1986; Veach 1997, ch. 8–10).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import drjit as dr

from drpt.kernel.camera import Ray
from drpt.kernel.emitters import LightSample, Receiver, power_heuristic
from drpt.kernel.integrators.depth import DIRECTION, LIGHT, POINT, Depth
from drpt.kernel.integrators.state import Path
from drpt.kernel.intersect import Hit, Known, closest_hit, light_hit, occluded

if TYPE_CHECKING:
    from drjit.auto import Array3f, Bool, UInt32

    from drpt.kernel.bsdfs import Bsdf
    from drpt.kernel.device_scene import DeviceScene
    from drpt.kernel.estimator import Features, Mode
    from drpt.kernel.integrators.directions import Directions
    from drpt.kernel.sampler import Sampler

UNROLLED_VERTICES = 4
"""Number of vertices whose code is unrolled in the kernel; a loop takes the later ones."""


class DirectLight(NamedTuple):
    """A sample of a light, and whether a shadow ray was sent there."""

    light: UInt32
    sample: LightSample
    traced: Bool


class Vertex(NamedTuple):
    """A path that has reached a vertex and collected its light.

    ``found`` tells whether there is any surface; ``hit`` is valid if the path may continue there.
    ``place`` is for the strategy that chooses directions.
    """

    path: Path
    found: Bool
    hit: Hit
    bsdf: Bsdf
    place: Any = None
    direct: DirectLight | None = None


@dataclass
class Tracer:
    """A path tracer for one scene and one estimator."""

    scene: DeviceScene
    features: Features
    mode: Mode
    bounces: int
    directions: Directions = field(kw_only=True)

    # -- whole paths

    def start(self, ray: Ray) -> Path:
        """Paths along camera rays, which no light sample finds: their density is infinite."""
        types = self.scene.types
        return Path(
            origin=ray.origin,
            direction=ray.direction,
            active=types.Bool(True),
            beta=types.Array3f(1),
            normal=types.Array3f(0),
            pdf=types.Float32(dr.inf),
            guide=self.directions.start,
            radiance=types.Array3f(0),
            rays=types.UInt32(0),
        )

    def first_vertex(self, ray: Ray, sampler: Sampler, known: Known | None = None) -> Vertex:
        """What camera rays hit, which may be known, and the light that it sends."""
        return self.arrive(self.start(ray), sampler, 0, known)

    def follow(self, first: Vertex, sampler: Sampler) -> tuple[Array3f, UInt32]:
        """Radiance (W/(m² sr), three channels) of whole paths on from a first vertex, and rays."""
        if self.vertices <= 1:
            return first.path.radiance, first.path.rays
        path = self.leave(first, sampler, 0)
        unrolled = min(self.bounces, UNROLLED_VERTICES)
        for depth in range(1, unrolled):
            path = self.step(path, sampler, depth)
        if unrolled < self.bounces:
            path = self._loop(path, sampler, unrolled)
        if self.counts_hits:
            path = self.step(path, sampler, self.bounces)
        return path.radiance, path.rays

    def _loop(self, path: Path, sampler: Sampler, first: int) -> Path:
        """Follow the paths that go on, from vertex number ``first``, while they may reflect."""

        def goes_on(depth: UInt32, *path: Any) -> Bool:
            return Path(*path).active & (depth < self.bounces)

        def step(depth: UInt32, *path: Any) -> tuple[Any, ...]:
            return depth + 1, *self.step(Path(*path), sampler, depth)

        state: tuple[Any, ...] = (self.scene.types.UInt32(first), *path)
        return Path(*dr.while_loop(state, goes_on, step)[1:])

    def step(self, path: Path, sampler: Sampler, depth: int | UInt32) -> Path:
        """Follow paths over their vertex number ``depth``; they are active if there is a next."""
        vertex = self.arrive(path, sampler, depth)
        has_next = self.depth(depth).has_next
        return vertex.path if has_next is False else self.leave(vertex, sampler, depth)

    # -- one vertex

    def arrive(
        self, path: Path, sampler: Sampler, number: int | UInt32, known: Known | None = None
    ) -> Vertex:
        """Find the next vertex, and collect the light that it sends."""
        depth = self.depth(number)
        # -- intersection
        hit = self._intersect(path, depth, known)
        found = hit.valid
        path, hit, place = self.directions.arrive(path, hit, depth)
        radiance, rays = path.radiance, path.rays + dr.select(path.active, 1, 0)
        # -- emission: the ray has hit a light
        if self.counts_hits or depth.may_be_first:
            radiance = radiance + path.beta * self._emission(path, hit, depth)
        # -- reflection
        is_surface = hit.primitive < self.scene.geometry.first_light
        hit = hit._replace(valid=hit.valid & is_surface & depth.reflects)
        bsdf = self.bsdf(hit, -path.direction)
        vertex = Vertex(path, found, hit, bsdf, self.directions.at(place, bsdf, depth))
        # -- direct light: a sample of a light
        if self.features.direct_light and depth.may_reflect:
            light, direct = self._direct_light(vertex, sampler, depth)
            radiance, rays = radiance + path.beta * light, rays + dr.select(direct.traced, 1, 0)
            vertex = vertex._replace(direct=direct)
        return vertex._replace(path=path._replace(radiance=radiance, rays=rays))

    def leave(self, vertex: Vertex, sampler: Sampler, number: int | UInt32) -> Path:
        """Choose the direction in which paths continue."""
        depth, path, hit, bsdf = self.depth(number), vertex.path, vertex.hit, vertex.bsdf
        u = sampler.next_2d(depth.dimension(DIRECTION))
        scatter = self.directions.sample(vertex.place, hit, bsdf, u)
        beta = path.beta * scatter.weight
        active = hit.valid & depth.has_next
        active &= ~(dr.max(beta) <= 0)  # a NaN throughput stays active, so that it is counted
        if self.features.delta and not self.counts_all_hits:
            active &= depth.next_reflects | bsdf.is_delta
        return path._replace(
            origin=hit.point,
            direction=scatter.direction,
            active=active,
            beta=beta,
            normal=hit.shading_normal if self.features.mis else path.normal,
            pdf=path.pdf if scatter.pdf is None else scatter.pdf,
            guide=scatter.state,
        )

    def _intersect(self, path: Path, depth: Depth, known: Known | None) -> Hit:
        """What rays hit: at vertices that do no more than emit, only lights are looked for."""
        geometry = self.scene.geometry
        if depth.only_emits:
            return light_hit(geometry, self.features, path.ray, path.active)
        return closest_hit(geometry, self.features, path.ray, path.active, known)

    def _emission(self, path: Path, hit: Hit, depth: Depth) -> Array3f:
        """L_e at a hit; weighted against light samples where a BSDF sample led there."""
        first, emitters = self.scene.geometry.first_light, self.scene.emitters
        lit = hit.valid & (hit.primitive >= first) & hit.front
        if not self.counts_all_hits:
            lit &= path.pdf == dr.inf if self.features.delta else depth.is_first
        light = self.scene.types.UInt32(0)
        if emitters.count > 1:
            light = dr.select(lit, hit.primitive - first, 0)
        radiance = emitters.radiance(light)
        if self.features.mis and depth.may_be_later:
            at = Receiver(path.origin, path.normal)
            inverse = emitters.inverse_pdf(at, light, path.ray, hit._replace(valid=lit))
            weight = power_heuristic(1 / (inverse * path.pdf))
            if self.features.delta:
                weight = dr.select(path.pdf == dr.inf, 1, weight)
            radiance = radiance * weight
        return dr.select(lit, radiance, 0)

    def _direct_light(
        self, vertex: Vertex, sampler: Sampler, depth: Depth
    ) -> tuple[Array3f, DirectLight]:
        """Direct light by one sample of one light."""
        hit, bsdf, emitters = vertex.hit, vertex.bsdf, self.scene.emitters
        # -- a point on a light
        at = Receiver(hit.point, hit.shading_normal)
        choice = emitters.choose(at, hit.valid, lambda: sampler.next_1d(depth.dimension(LIGHT)))
        u = sampler.next_2d(depth.dimension(POINT))
        sample = emitters.sample(at, choice, u, visible=self.mode.samples_cones)
        # -- what it contributes, if it is not occluded
        value = bsdf.eval(sample.direction) * sample.radiance * sample.inverse_pdf
        if self.features.mis:
            pdf = bsdf.pdf(sample.direction) * self.directions.bsdf_share(vertex.place)
            value *= power_heuristic(pdf * sample.inverse_pdf)
        traced = hit.valid & ~(dr.max(value) <= 0)
        # -- a shadow ray
        ray = Ray(hit.point, sample.direction)
        shadow = occluded(self.scene.geometry, ray, sample.distance, choice.light, traced)
        light = dr.select(traced & ~shadow, value, 0)
        return light, DirectLight(choice.light, sample, traced)

    # -- facts

    def depth(self, number: int | UInt32) -> Depth:
        """A vertex by its number."""
        return Depth(number, self.bounces, self.vertices)

    @property
    def vertices(self) -> int:
        """Number of vertices of a path, beside the eye; the last one only emits."""
        if not self.features.emission:
            return 0
        return self.bounces + 1 if self.bounces == 0 or self.counts_hits else self.bounces

    @property
    def counts_hits(self) -> bool:
        """Whether some paths that hit a light after a bounce collect its radiance."""
        return self.counts_all_hits or self.features.delta

    @property
    def counts_all_hits(self) -> bool:
        """Whether all of them do; else those do that no light sample finds, after delta lobes."""
        return self.features.mis or not self.mode.samples_lights

    def bsdf(self, hit: Hit, to_viewer: Array3f) -> Bsdf:
        """The BSDF at a hit, towards a viewer."""
        smooth = self.features.interpolated_normals
        return self.scene.materials.bsdf(hit, to_viewer, interpolated_normals=smooth)
