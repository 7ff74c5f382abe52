"""The five estimators as static facts, and what of a scene they need in the kernel (host)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from drpt.kernel.primitives import Primitives


class Mode(StrEnum):
    """How paths look for light; all modes converge to the same image."""

    IMPLICIT_UNIFORM = "implicit-uniform"
    IMPLICIT = "implicit"
    EXPLICIT_UNIFORM = "explicit-uniform"
    EXPLICIT = "explicit"
    MIS = "mis"

    # The names that the rendering course gives them.
    IMPLICIT_UNIFORM_SAMPLING = IMPLICIT_UNIFORM
    IMPLICIT_BRDF_SAMPLING = IMPLICIT
    EXPLICIT_UNIFORM_SAMPLING = EXPLICIT_UNIFORM
    EXPLICIT_LIGHT_BRDF_SAMPLING = EXPLICIT

    @classmethod
    def _missing_(cls, value: object) -> Mode | None:
        return cls.__members__.get(value) if isinstance(value, str) else None

    @property
    def samples_brdf(self) -> bool:
        """Whether the next direction follows the BRDF; else it is uniform on the sphere."""
        return self in (Mode.IMPLICIT, Mode.EXPLICIT, Mode.MIS)

    @property
    def samples_lights(self) -> bool:
        """Whether every vertex looks for direct light by a sample of a light."""
        return self in (Mode.EXPLICIT_UNIFORM, Mode.EXPLICIT, Mode.MIS)

    @property
    def samples_cones(self) -> bool:
        """Whether light samples of a sphere keep to its visible cone; else to its whole area."""
        return self in (Mode.EXPLICIT, Mode.MIS)

    @property
    def counts_hits(self) -> bool:
        """Whether a path that runs into a light after a bounce collects its radiance."""
        return self in (Mode.IMPLICIT_UNIFORM, Mode.IMPLICIT, Mode.MIS)


@dataclass(frozen=True)
class Features:
    """What a kernel contains; what is False here leaves no instruction in it.

    Attributes
    ----------
    spheres, triangles, interpolated_normals
        Intersections with them, and the normals that they have.
    diffuse, phong
        Reflection of that kind.
    emission
        Radiance of lights that paths run into; in the explicit modes camera rays alone do.
    direct_light, light_choice
        Samples of lights at every vertex, and the choice among several.
    sphere_light_samples, triangle_light_samples
        Samples of lights of that kind.
    mis
        Weights for both ways to find a light.
    regeneration
        A path starts where another one has ended, instead of waiting for its neighbours: in open
        scenes, with 3 bounces or more.
    shared_rays
        Several paths from the first vertex of one camera ray: in rooms lit by a single sphere,
        where they go on from there makes the noise, and direct light hardly any.
    """

    spheres: bool
    triangles: bool
    interpolated_normals: bool
    diffuse: bool
    phong: bool
    emission: bool
    direct_light: bool
    light_choice: bool
    sphere_light_samples: bool
    triangle_light_samples: bool
    mis: bool
    regeneration: bool
    shared_rays: bool

    @classmethod
    def of(cls, primitives: Primitives, bounces: int, mode: Mode) -> Features:
        """Features of a kernel for these primitives, this many bounces and this mode."""
        emission = len(primitives.radiance) > 0
        reflection = emission and bounces > 0 and len(primitives.reflectance) > 0
        direct_light = reflection and mode.samples_lights
        one_sphere = len(primitives.radiance) == primitives.sphere_lights == 1
        return cls(
            spheres=emission and len(primitives.spheres) > 0,
            triangles=emission and len(primitives.planes) > 0,
            interpolated_normals=reflection and len(primitives.smooth_corners) > 0,
            diffuse=reflection and bool(primitives.diffuse.any()),
            phong=reflection and not primitives.diffuse.all(),
            emission=emission,
            direct_light=direct_light,
            light_choice=direct_light and len(primitives.radiance) > 1,
            sphere_light_samples=direct_light and primitives.sphere_lights > 0,
            triangle_light_samples=direct_light and len(primitives.light_corners) > 0,
            mis=direct_light and mode.counts_hits,
            regeneration=reflection and bounces > 2 and not primitives.interior,
            shared_rays=direct_light
            and mode.samples_cones
            and bounces > 1
            and one_sphere
            and primitives.interior,
        )
