"""How the next direction of a path is chosen: uniformly, or by the BSDF.

The third way, by a guide, stands in `drpt.kernel.guiding.directions`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import drjit as dr

from drpt.kernel.warp import sphere_pdf, square_to_sphere

if TYPE_CHECKING:
    from drjit.auto import Array2f, Array3f, Float

    from drpt.kernel.bsdfs import Bsdf
    from drpt.kernel.estimator import Features, Mode
    from drpt.kernel.integrators.depth import Depth
    from drpt.kernel.integrators.state import Path
    from drpt.kernel.intersect import Hit


class ScatterSample(NamedTuple):
    """Where a path continues.

    ``weight`` is f cos θ / ``pdf``, with the density per solid angle of BSDF samples; None if no
    weight for multiple importance sampling needs it. ``state`` is for the strategy, at the end of
    the ray.
    """

    direction: Array3f
    weight: Array3f
    pdf: Float | None
    state: tuple[Any, ...] = ()


class Directions(Protocol):
    """A strategy for the next directions of paths.

    ``start`` is its state in paths that start at the camera. ``place`` is what it knows about the
    vertex at hand.
    """

    start: tuple[Any, ...]

    def arrive(self, path: Path, hit: Hit, depth: Depth) -> tuple[Path, Hit, Any]:
        """The path and the hit with the weight of the direction that led there, and the place."""
        ...

    def at(self, place: Any, bsdf: Bsdf, depth: Depth) -> Any:
        """The place, for a BSDF."""
        ...

    def bsdf_share(self, place: Any) -> Any:
        """Share of the directions that follow the BSDF."""
        ...

    def sample(self, place: Any, hit: Hit, bsdf: Bsdf, u: Array2f) -> ScatterSample:
        """Solid angle: the direction in which a path continues."""
        ...


class Unguided:
    """What strategies have in common that need no state and know nothing about places."""

    start: tuple[Any, ...] = ()

    def arrive(self, path: Path, hit: Hit, depth: Depth) -> tuple[Path, Hit, None]:
        """The path and the hit as they are."""
        return path, hit, None

    def at(self, place: None, bsdf: Bsdf, depth: Depth) -> None:
        """Nothing."""

    def bsdf_share(self, place: None) -> int:
        """All."""
        return 1


@dataclass
class UniformDirections(Unguided):
    """Directions that are uniform on the sphere, but for those of ``delta`` lobes."""

    delta: bool

    def sample(self, place: None, hit: Hit, bsdf: Bsdf, u: Array2f) -> ScatterSample:
        """Solid angle: uniform on the sphere. Delta lobes, which that never finds, are sampled."""
        direction = square_to_sphere(u)
        weight = bsdf.eval(direction) / sphere_pdf()
        if not self.delta:
            return ScatterSample(direction, weight, None)
        specular, is_delta = bsdf.sample(u), bsdf.is_delta
        return ScatterSample(
            dr.select(is_delta, specular.direction, direction),
            dr.select(is_delta, specular.weight, weight),
            dr.select(is_delta, specular.pdf, sphere_pdf()),
        )


@dataclass
class BsdfDirections(Unguided):
    """Directions by the BSDF; ``weighs`` tells whether weights need their density."""

    weighs: bool

    def sample(self, place: None, hit: Hit, bsdf: Bsdf, u: Array2f) -> ScatterSample:
        """Solid angle: by the BSDF."""
        direction, weight, pdf = bsdf.sample(u)
        return ScatterSample(direction, weight, pdf if self.weighs else None)


def unguided(mode: Mode, features: Features) -> Directions:
    """The strategy of a mode, as far as no guide chooses directions."""
    if not mode.samples_brdf:
        return UniformDirections(features.delta)
    return BsdfDirections(weighs=features.mis or features.delta)
