"""The six estimators as static facts; what a kernel has for a scene, and why (host)."""

from __future__ import annotations

from dataclasses import dataclass, fields
from enum import StrEnum
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

from drpt.kernel.primitives import FACET_LIMIT, LIGHT_FACET_LIMIT
from drpt.scene.materials import MATERIALS

if TYPE_CHECKING:
    from drpt.kernel.primitives import Primitives

    Need: TypeAlias = tuple[bool, str]
    """A condition, and what is said where it is not met."""

REGENERATION_BOUNCES = 3
"""From so many bounces on, lanes would wait for their neighbours long enough."""
SMALL_LAMP = 1 / 16
"""Largest area of a small sphere light, relative to the area of all facets. In a convex room this
is the share of paths that hit it. If more paths hit a lamp, hits should count its light."""
SHARING_SPP = 64
"""With so many samples per pixel, edges are smooth even if a few share a camera ray."""


class Mode(StrEnum):
    """How paths look for light; all modes converge to the same image."""

    IMPLICIT_UNIFORM = "implicit-uniform"
    IMPLICIT = "implicit"
    EXPLICIT_UNIFORM = "explicit-uniform"
    EXPLICIT = "explicit"
    MIS = "mis"
    GUIDED = "guided"

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
        """Whether next directions follow the BRDF, if not a guide; else they are uniform."""
        return self in (Mode.IMPLICIT, Mode.EXPLICIT, Mode.MIS, Mode.GUIDED)

    @property
    def samples_lights(self) -> bool:
        """Whether every vertex looks for direct light by a sample of a light."""
        return self in (Mode.EXPLICIT_UNIFORM, Mode.EXPLICIT, Mode.MIS, Mode.GUIDED)

    @property
    def samples_cones(self) -> bool:
        """Whether light samples of a sphere keep to its visible cone; else to its whole area."""
        return self in (Mode.EXPLICIT, Mode.MIS, Mode.GUIDED)


@dataclass(frozen=True)
class Features:
    """What a kernel contains; what is False here leaves no instruction in it.

    Attributes
    ----------
    spheres, triangles, interpolated_normals
        Intersections with them, and the normals that they have.
    emission
        Radiance of lights that paths run into; without ``mis``, in modes that sample lights, camera
        rays alone do.
    delta
        Delta lobes: in all modes, paths that leave them collect the radiance of lights that they
        hit.
    direct_light
        Samples of lights at every vertex.
    mis
        Weights for both ways to find a light.
    guiding
        Directions towards what reflects much light, from diffuse facets.
    covered_pixels
        Camera rays are not traced where one facet fills the whole pixel, with nothing before it.
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
    emission: bool
    delta: bool
    direct_light: bool
    mis: bool
    guiding: bool
    covered_pixels: bool
    regeneration: bool
    shared_rays: bool

    @classmethod
    def of(
        cls, primitives: Primitives, bounces: int, mode: Mode, *, worthwhile: bool = True
    ) -> Features:
        """Features of a kernel for these primitives, this many bounces and this mode.

        ``worthwhile`` says whether a guide is expected to reduce the noise.
        """
        facts = feature_facts(primitives, bounces, mode, worthwhile=worthwhile)
        return cls(**{field.name: facts[field.name].holds for field in fields(cls)})


class Fact(NamedTuple):
    """Whether something is in a kernel, and why, in plain words."""

    holds: bool
    reason: str


def feature_facts(
    primitives: Primitives, bounces: int, mode: Mode, *, worthwhile: bool = True
) -> dict[str, Fact]:
    """Decide each of the `Features` of a kernel."""
    guiding = _guiding(primitives, bounces, mode, worthwhile=worthwhile)
    return {
        **_shape_facts(primitives, bounces),
        **_light_facts(primitives, bounces, mode, guiding),
        **_order_facts(primitives, bounces, mode),
    }


def layout_facts(
    primitives: Primitives, bounces: int, mode: Mode, *, worthwhile: bool = True
) -> dict[str, Fact]:
    """Say how the primitives lie in a kernel, and which of them its rays look for.

    ``merged_triangles``
        Coplanar triangles as one facet.
    ``solids``
        Convex bodies, each met as a whole.
    ``mesh``, ``sphere_grid``, ``sphere_tree``
        Hierarchies of triangles and of spheres, which else are met one by one.
    ``facet_shadows``
        Facets that shadow rays look for.
    ``last_ray``
        The ray after the last bounce, which can but run into a light.
    """
    guiding = _guiding(primitives, bounces, mode, worthwhile=worthwhile)
    return {
        **_facet_facts(primitives),
        **_hierarchy_facts(primitives),
        **_ray_facts(primitives, bounces, mode, guiding),
    }


def _shape_facts(primitives: Primitives, bounces: int) -> dict[str, Fact]:
    lit, reflecting = _lit(primitives), _reflecting(primitives, bounces)
    smooth, codes = len(primitives.smooth_corners), primitives.reflectance[:, 3]
    surfaces = len(codes)
    kinds = {
        kind.name: _some(int(kind.has(codes).sum()), f"{kind.label} surface", *reflecting)
        for kind in MATERIALS
    }
    return {
        "spheres": _some(len(primitives.spheres), "sphere", *lit),
        "triangles": _some(len(primitives.planes), "polygon", *lit),
        "interpolated_normals": _some(smooth, "smooth triangle", *reflecting),
        **kinds,
        "delta": _some(surfaces - _spreading(primitives), "specular surface", *reflecting),
    }


def _light_facts(
    primitives: Primitives, bounces: int, mode: Mode, guiding: Fact
) -> dict[str, Fact]:
    sampling = _sampling(primitives, bounces, mode)
    lights, spheres = len(primitives.radiance), primitives.sphere_lights
    choice = f"one of {lights} lights at every vertex"
    both = f"mode {mode} finds lights in two ways"
    return {
        "emission": _some(lights, "light"),
        "direct_light": _decide(f"mode {mode} samples a light at every vertex", *sampling),
        "light_choice": _decide(choice, *sampling, (lights > 1, "there is one light")),
        "sphere_light_samples": _some(spheres, "sphere light", *sampling),
        "triangle_light_samples": _some(lights - spheres, "triangle light", *sampling),
        "mis": _decide(both, *sampling, _hits_count(primitives, mode, guiding)),
        "guiding": guiding,
    }


def _guiding(primitives: Primitives, bounces: int, mode: Mode, *, worthwhile: bool) -> Fact:
    """Decide whether directions are guided."""
    return _decide(
        f"mode {mode} goes where patches reflect much light",
        *_sampling(primitives, bounces, mode),
        (mode is Mode.GUIDED, f"mode {mode} follows the BRDF"),
        (bounces > 1, "1 bounce: nothing comes after the direct light"),
        (len(primitives.facets) > 0, "there are no facets, which alone have patches"),
        (bool(primitives.diffuse[: len(primitives.facets)].any()), "no facet is diffuse"),
        (worthwhile, "the noise is not expected to become less"),
    )


def _order_facts(primitives: Primitives, bounces: int, mode: Mode) -> dict[str, Fact]:
    """Decide in which order samples are traced."""
    lights, room = len(primitives.radiance), primitives.interior
    few = f"{_number(bounces, 'bounce')}, less than {REGENERATION_BOUNCES}"
    hierarchies = [fact.holds for fact in _hierarchy_facts(primitives).values()]
    regeneration = _decide(
        f"an open scene, up to {bounces} bounces",
        *_reflecting(primitives, bounces),
        (bounces >= REGENERATION_BOUNCES, few),
        (not room, "the scene is a room"),
    )
    return {
        "covered_pixels": _decide(
            "what fills a pixel need not be looked for",
            *_lit(primitives),
            (len(primitives.facets) > 0, "there are no facets, which alone fill pixels"),
            (not any(hierarchies), "too much may stand before the facets"),
            (not regeneration.holds, "lanes follow camera rays and others at once"),
        ),
        "regeneration": regeneration,
        "shared_rays": _decide(
            f"a room, lit by one sphere; from {SHARING_SPP} samples per pixel on, by Sobol' points",
            *_sampling(primitives, bounces, mode),
            (mode.samples_cones, f"mode {mode} samples the far sides of lights, too"),
            (bounces > 1, "1 bounce: all noise is of the first vertex"),
            (lights == 1, f"there are {lights} lights"),
            (primitives.sphere_lights == 1, "the light is a triangle"),
            (room, "the scene is open"),
        ),
    }


def _facet_facts(primitives: Primitives) -> dict[str, Fact]:
    lit, facets, solids = _lit(primitives), primitives.facets, primitives.solids
    merged = sum(len(facet.corners) > 3 for facet in facets)
    several = f"{merged} of {_number(len(facets), 'facet')} are of several triangles"
    bodies = "1 convex body" if len(solids) == 1 else f"{len(solids)} convex bodies"
    in_bodies = sum(len(solid.facets) for solid in solids)
    return {
        "merged_triangles": _decide(several, *lit, (merged > 0, "no triangles share a plane")),
        "solids": _decide(
            f"{bodies} of {_number(in_bodies, 'facet')}",
            *lit,
            (len(solids) > 0, "no facets are a convex body"),
        ),
    }


def _hierarchy_facts(primitives: Primitives) -> dict[str, Fact]:
    lit = _lit(primitives)
    facets, emitting = len(primitives.facets), len(primitives.light_facets)
    triangles = len(primitives.planes) - facets - emitting
    limits = f"{FACET_LIMIT}, or {LIGHT_FACET_LIMIT} that emit"
    return {
        "mesh": _decide(
            f"{triangles} triangles, more than {limits}",
            *lit,
            (triangles > 0, f"{_number(facets + emitting, 'facet')}, not more than {limits}"),
        ),
        **_sphere_facts(primitives),
    }


def _sphere_facts(primitives: Primitives) -> dict[str, Fact]:
    spheres, (single, many, cells) = len(primitives.spheres), primitives.sphere_layout
    verb = "stands" if len(single) == 1 else "stand"
    alone = f", {len(single)} of which {verb} out" if len(single) else ""
    needs = (
        *_lit(primitives),
        (len(many) > 0, f"{_number(spheres, 'sphere')}, few enough to be met one by one"),
    )
    told = f"{spheres} spheres{alone}, too many to be met one by one"
    return {
        "sphere_grid": _decide(told, *needs, (cells is not None, "they are crowded")),
        "sphere_tree": _decide(
            f"{told}, and crowded", *needs, (cells is None, "they are not crowded")
        ),
    }


def _ray_facts(primitives: Primitives, bounces: int, mode: Mode, guiding: Fact) -> dict[str, Fact]:
    facets, blockers = len(primitives.facets), sum(primitives.blockers())
    return {
        "facet_shadows": _decide(
            f"{blockers} of {_number(facets, 'facet')} can stand before a light",
            *_sampling(primitives, bounces, mode),
            (blockers > 0, f"0 of {_number(facets, 'facet')} can stand before a light"),
        ),
        "last_ray": _decide(
            f"mode {mode} counts the light that it runs into",
            *_reflecting(primitives, bounces),
            _some_hits_count(primitives, mode, guiding),
        ),
    }


def _lit(primitives: Primitives) -> tuple[Need, ...]:
    return ((len(primitives.radiance) > 0, "there is no light"),)


def _reflecting(primitives: Primitives, bounces: int) -> tuple[Need, ...]:
    return (
        *_lit(primitives),
        (bounces > 0, "light does not bounce"),
        (len(primitives.reflectance) > 0, "nothing reflects"),
    )


def _sampling(primitives: Primitives, bounces: int, mode: Mode) -> tuple[Need, ...]:
    return (
        *_reflecting(primitives, bounces),
        (mode.samples_lights, f"mode {mode} samples no light"),
        (_spreading(primitives) > 0, "all surfaces are specular"),
    )


def _hits_count(primitives: Primitives, mode: Mode, guiding: Fact) -> Need:
    """What makes a path that runs into a light after a bounce collect its radiance."""
    if guiding.holds:
        otherwise = "light samples of one sphere have all of its light on diffuse surfaces"
        return not (has_small_lamp(primitives) and primitives.diffuse.all()), otherwise
    counts = mode in (Mode.IMPLICIT_UNIFORM, Mode.IMPLICIT, Mode.MIS, Mode.GUIDED)
    return counts, f"mode {mode} counts no light that it runs into"


def _some_hits_count(primitives: Primitives, mode: Mode, guiding: Fact) -> Need:
    """Whether at least paths that leave specular surfaces do so."""
    counts, otherwise = _hits_count(primitives, mode, guiding)
    return counts or _spreading(primitives) < len(primitives.reflectance), otherwise


def _spreading(primitives: Primitives) -> int:
    """Number of reflecting primitives that reflect light into more than one direction."""
    codes = primitives.reflectance[:, 3]
    return sum(int(kind.has(codes).sum()) for kind in MATERIALS if not kind.is_delta)


def knows_all(primitives: Primitives) -> bool:
    """Whether a guide covers all surfaces that reflect direct light, which has little noise."""
    facets = primitives.diffuse[: len(primitives.facets)]
    only_facets = len(facets) == len(primitives.diffuse)
    return has_small_lamp(primitives) and only_facets and bool(facets.all())


def has_small_lamp(primitives: Primitives) -> bool:
    """Whether one small sphere is the only light, so that few paths from facets hit it."""
    if not len(primitives.radiance) == primitives.sphere_lights == 1:
        return False
    return bool(primitives.light_areas()[0] <= SMALL_LAMP * primitives.facet_areas.sum())


def _decide(reason: str, *needs: Need) -> Fact:
    """In, for a reason, unless something is missing: then out, for the first that is."""
    missing = (Fact(False, otherwise) for met, otherwise in needs if not met)
    return next(missing, Fact(True, reason))


def _some(count: int, what: str, *needs: Need) -> Fact:
    return _decide(_number(count, what), *needs, (count > 0, f"there is no {what}"))


def _number(count: int, what: str) -> str:
    return f"{count} {what}{'s' if count != 1 else ''}"
