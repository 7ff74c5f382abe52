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
from drpt.kernel.guide import NOWHERE
from drpt.kernel.intersect import Hit, Known, closest_hit, light_hit, occluded
from drpt.kernel.vec import vec2
from drpt.kernel.warp import cosine_hemisphere_pdf, sphere_pdf, square_to_sphere

if TYPE_CHECKING:
    from drjit.auto import Array2f, Array3f, Bool, Float, UInt32

    from drpt.kernel.bsdfs import Bsdf
    from drpt.kernel.device_scene import DeviceScene
    from drpt.kernel.estimator import Features, Mode
    from drpt.kernel.guide import Guide
    from drpt.kernel.guide_share import GuideShares
    from drpt.kernel.sampler import Sampler


UNROLLED_VERTICES = 4
"""So many vertices of a path stand one after the other in the kernel; a loop takes the rest."""


class Path(NamedTuple):
    """A path that has reached a ray towards its next vertex."""

    origin: Array3f
    direction: Array3f
    active: Bool  # whether there is a next vertex
    beta: Array3f  # throughput up to it
    normal: Array3f  # shading normal where the ray starts, for MIS
    pdf: Float  # density by which the BRDF's share of the directions leads there
    patch: UInt32  # of the guide, where the ray starts; 0 where nothing is guided
    aim: UInt32  # facet to which the guide aimed it
    radiance: Array3f  # collected so far
    rays: UInt32  # traced so far


class Vertex(NamedTuple):
    """A path that has reached a vertex and collected its light; ``hit`` is valid if it goes on."""

    path: Path
    hit: Hit
    bsdf: Bsdf
    patch: UInt32  # of the guide; 0 where nothing is guided
    share: Any = 0  # of the directions from here that the guide chooses


class Turn(NamedTuple):
    """Where a path goes on.

    ``weight`` is f cos θ over ``pdf``, the density of the BRDF's share of the directions; that of
    the guided ones is known when the path arrives.
    """

    direction: Array3f
    weight: Array3f
    pdf: Float
    aim: UInt32


@dataclass
class Tracer:
    """A path tracer for one scene and one estimator."""

    scene: DeviceScene
    features: Features
    mode: Mode
    bounces: int
    guide: Guide | None = field(default=None, kw_only=True)
    shares: GuideShares | None = field(default=None, kw_only=True)

    def first_vertex(self, ray: Ray, sampler: Sampler, known: Known | None = None) -> Vertex:
        """What camera rays meet, which may be known, and the light that it sends."""
        return self.arrive(self.start(ray), sampler, 0, known)

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
            patch=types.UInt32(0),
            aim=types.UInt32(NOWHERE),
            radiance=types.Array3f(0),
            rays=types.UInt32(0),
        )

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

    @property
    def vertices(self) -> int:
        """How many vertices a path has, beside the eye; the last one only emits."""
        if not self.features.emission:
            return 0
        return self.bounces + 1 if self.bounces == 0 or self.counts_hits else self.bounces

    @property
    def counts_hits(self) -> bool:
        """Whether a path that runs into a light after a bounce collects its radiance."""
        return self.features.mis or not self.mode.samples_lights

    def step(self, path: Path, sampler: Sampler, depth: int | UInt32) -> Path:
        """Follow paths over their vertex number ``depth``; they are active if there is a next."""
        vertex = self.arrive(path, sampler, depth)
        is_last = isinstance(depth, int) and depth == self.vertices - 1
        return vertex.path if is_last else self.leave(vertex, sampler, depth)

    def arrive(
        self, path: Path, sampler: Sampler, depth: Any, known: Known | None = None
    ) -> Vertex:
        """Find the next vertex, and collect the light that it sends."""
        features, is_first, reflects = self.features, depth == 0, depth < self.bounces
        path, hit, patch = self._meet(path, depth, known)
        radiance, rays = path.radiance, path.rays + dr.select(path.active, 1, 0)
        if self.counts_hits or is_first is not False:
            counts = True if self.counts_hits else is_first
            weighted = features.mis and is_first is not True
            emitted = self._emission(path, hit, counts, weighted=weighted)
            radiance = radiance + path.beta * emitted
        hit = hit._replace(
            valid=hit.valid & (hit.primitive < self.scene.geometry.first_light) & reflects
        )
        bsdf = self.bsdf(hit, -path.direction)
        # The last segment can only hit a light; do not guide it.
        guided = bsdf.is_diffuse & (depth + 1 < self.bounces)
        patch = dr.select(guided, patch, type(patch)(0))
        share = self._share(patch, depth + 1)
        vertex = Vertex(path, hit, bsdf, patch, share)
        if features.direct_light and reflects is not False:
            light, traced = self._direct(vertex, sampler, depth)
            radiance = radiance + path.beta * light
            rays = rays + dr.select(traced, 1, 0)
        return vertex._replace(path=path._replace(radiance=radiance, rays=rays))

    def _meet(self, path: Path, depth: Any, known: Known | None) -> tuple[Path, Hit, UInt32]:
        """The paths that arrive where their rays meet something, what that is, and its patch."""
        is_first, ray = depth == 0, Ray(path.origin, path.direction)
        is_end = depth == self.bounces
        if is_end is True and is_first is False:  # that ray was not guided
            return path, light_hit(self.scene.geometry, self.features, ray, path.active), path.patch
        hit = closest_hit(self.scene.geometry, self.features, ray, path.active, known)
        if self.guide is None:
            return path, hit, path.patch
        patch = self.guide.patch_of(hit)
        if is_first is True:
            return path, hit, patch
        return *self._weigh(path, hit, patch, depth, self.guide), patch

    def _weigh(
        self, path: Path, hit: Hit, patch: UInt32, depth: Any, guide: Guide
    ) -> tuple[Path, Hit]:
        """Weight both ways to choose a direction; reject guided rays that miss their target."""
        lost = (path.aim != NOWHERE) & ~(hit.valid & (hit.primitive == path.aim))
        density = self._share(path.patch, depth) * guide.density(path.patch, patch)
        by_guide = density * dr.square(hit.distance)
        by_bsdf = path.pdf * dr.abs(dr.dot(hit.normal, path.direction))
        weight = dr.select(by_guide > 0, by_bsdf / (by_bsdf + by_guide), 1)
        beta = path.beta * dr.select(lost, 0, weight)
        return path._replace(beta=beta), hit._replace(valid=hit.valid & ~lost)

    def leave(self, vertex: Vertex, sampler: Sampler, depth: int | UInt32) -> Path:
        """Choose where a path goes on."""
        path, hit = vertex.path, vertex.hit
        turn = self._turn(vertex, sampler.next_2d(_decision(depth, 2)))
        beta = path.beta * turn.weight
        active = hit.valid & (depth < self.vertices - 1)
        active &= ~(dr.max(beta) <= 0)  # not a number goes on, to be counted
        return path._replace(
            origin=hit.point,
            direction=turn.direction,
            active=active,
            beta=beta,
            normal=hit.shading_normal if self.features.mis else path.normal,
            pdf=turn.pdf,
            patch=vertex.patch,
            aim=turn.aim,
        )

    def _turn(self, vertex: Vertex, u: Array2f) -> Turn:
        """The direction in which a path goes on."""
        bsdf, types = vertex.bsdf, self.scene.types
        nowhere = types.UInt32(NOWHERE)
        if not self.mode.samples_brdf:
            direction = square_to_sphere(u)
            return Turn(direction, bsdf.eval(direction) / sphere_pdf(), vertex.path.pdf, nowhere)
        if self.guide is not None:
            return self._guided_turn(vertex, u, self.guide)
        sample = bsdf.sample(u)
        pdf = sample.pdf if self.features.mis else vertex.path.pdf
        return Turn(sample.direction, sample.weight, pdf, nowhere)

    def _guided_turn(self, vertex: Vertex, u: Array2f, guide: Guide) -> Turn:
        """A direction to a point of a patch, or by the BRDF."""
        bsdf, share = vertex.bsdf, vertex.share
        guided, unguided = u.x < share, 1 - share
        u = vec2(dr.select(guided, u.x / share, (u.x - share) / unguided), u.y)
        aimed, facet = guide.aim(vertex.patch, vertex.hit.point, u, guided)
        sample = bsdf.sample(u)
        direction = dr.select(guided, aimed, sample.direction)
        of_aimed = cosine_hemisphere_pdf(dr.dot(bsdf.point.shading_normal, aimed))
        pdf = unguided * dr.select(guided, of_aimed, sample.pdf)
        aim = dr.select(guided, facet, NOWHERE)
        return Turn(direction, bsdf.weight(direction) / unguided, pdf, aim)

    def _share(self, patch: UInt32, following: Any) -> Any:
        """The guide's share of the directions from a patch to vertex number ``following``."""
        return self.shares.of(patch, self.bounces - following) if self.shares else 0

    def _emission(self, path: Path, hit: Hit, counts: Bool | bool, *, weighted: bool) -> Array3f:
        """L_e at a hit; weighted against light sampling where a BRDF's density led there."""
        first, emitters = self.scene.geometry.first_light, self.scene.emitters
        lit = hit.valid & (hit.primitive >= first) & hit.front & counts
        light = self.scene.types.UInt32(0)
        if emitters.count > 1:
            light = dr.select(lit, hit.primitive - first, 0)
        radiance = emitters.radiance(light)
        if weighted:
            at, ray = Receiver(path.origin, path.normal), Ray(path.origin, path.direction)
            inverse = emitters.inverse_pdf(at, light, ray, hit._replace(valid=lit))
            radiance = radiance * power_heuristic(1 / (inverse * path.pdf))
        return dr.select(lit, radiance, 0)

    def _direct(
        self, vertex: Vertex, sampler: Sampler, depth: int | UInt32
    ) -> tuple[Array3f, Bool]:
        """Direct light by one sample of one light, and where that took a shadow ray."""
        hit, bsdf = vertex.hit, vertex.bsdf
        light, sample = self.light_sample(hit, sampler, depth)
        value = bsdf.eval(sample.direction) * sample.radiance * sample.inverse_pdf
        if self.features.mis:
            pdf = bsdf.pdf(sample.direction)
            if self.guide is not None:
                pdf *= 1 - vertex.share
            value *= power_heuristic(pdf * sample.inverse_pdf)
        traced = hit.valid & ~(dr.max(value) <= 0)
        ray = Ray(hit.point, sample.direction)
        shadow = occluded(self.scene.geometry, ray, sample.distance, light, traced)
        return dr.select(traced & ~shadow, value, 0), traced

    def light_sample(
        self, hit: Hit, sampler: Sampler, depth: int | UInt32
    ) -> tuple[UInt32, LightSample]:
        """The number of the light that a vertex looks at, and the sampled point of it."""
        at = Receiver(hit.point, hit.shading_normal)
        number = lambda: sampler.next_1d(_decision(depth, 0))  # noqa: E731
        emitters, visible = self.scene.emitters, self.mode.samples_cones
        choice = emitters.choose(at, hit.valid, number)
        u = sampler.next_2d(_decision(depth, 1))
        return choice.light, emitters.sample(at, choice, u, visible=visible)

    def bsdf(self, hit: Hit, to_viewer: Array3f) -> Bsdf:
        """The BSDF at a hit, towards a viewer."""
        smooth = self.features.interpolated_normals
        return self.scene.materials.bsdf(hit, to_viewer, interpolated_normals=smooth)


def _decision(depth: int | UInt32, kind: int) -> int | UInt32:
    """Number of a vertex' decision: light (0), point on it (1), next direction (2)."""
    return 1 + 3 * depth + kind
