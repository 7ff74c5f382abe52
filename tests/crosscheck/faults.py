"""Faults of a path tracer, one at a time, injected into what drpt renders.

Each has a size, 0 for none: of those that are there or not, it is how much of them is there.
"""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol
from unittest.mock import patch

import drjit as dr

from drpt import Diffuse, Mesh, Mode, Phong, Scene, Sphere, load_scene
from drpt.crosscheck import Estimate, measure
from drpt.crosscheck.references import SPP
from drpt.kernel import intersect
from drpt.kernel.bsdfs import Bsdf
from drpt.kernel.integrators import path
from drpt.kernel.warp import INV_PI
from tests.measuring import with_picture

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from contextlib import AbstractContextManager

    from drpt.scene import Material, Shape
    from tests.oracle.arrays import Floats

GLOSSY = "cornell-box-glossy"
ROOM = "cornell-box with glossy walls"
PLATE = "cornell-box with a plate"
BOUNCES = 3
WHOLE, BOUNCE = "of it", "bounce"
"""Units of faults that are a share of something, or cannot be smaller than 1."""
SIDE = {GLOSSY: 256}
"""Pixels of the square pictures; `SMALL` of the others."""
SMALL = 128

GAP = 1.0
"""Between the lamp, of radius 60, and the plate under it."""


class Render(Protocol):
    """Renders a scene with a fault of a size."""

    def __call__(self, scene: Scene, size: float, mode: Mode) -> Estimate: ...


@dataclass(frozen=True)
class Fault:
    """A fault, and the scene and the mode that show it.

    A check must find it at ``size``, which is in ``unit``.
    """

    name: str
    size: float
    unit: str
    inject: Render
    scene: str = "cornell-box"
    mode: Mode = Mode.MIS

    def render(self, size: float) -> Estimate:
        """The picture with a fault of this size."""
        return self.inject(scenes()[self.scene], size, self.mode)


def scenes() -> dict[str, Scene]:
    """The scenes that faults are looked for in, by name."""
    box = load_scene("cornell-box")
    ends = [[218, 390 - GAP, 120], [338, 390 - GAP, 120], [338, 390 - GAP, 240]]
    corners = [*ends, [218, 390 - GAP, 240]]
    plate = Mesh(corners, [[0, 1, 2], [0, 2, 3]], material=Diffuse(0.5))
    light, room, *others = box.shapes
    glossy_room = with_material(room, Phong(0.76, 10))
    found = {
        "cornell-box": box,
        GLOSSY: load_scene("cornell-box-glossy"),
        ROOM: replace(box, shapes=(light, glossy_room, *others)),
        PLATE: replace(box, shapes=(*box.shapes, plate)),
    }
    sides = {name: SIDE.get(name, SMALL) for name in found}
    return {name: with_picture(scene, sides[name], sides[name]) for name, scene in found.items()}


def in_scene(change: Callable[[Shape, float], Shape]) -> Render:
    """A fault that changes shapes."""

    def inject(scene: Scene, size: float, mode: Mode) -> Estimate:
        shapes = tuple(change(shape, size) for shape in scene.shapes)
        return measure(replace(scene, shapes=shapes), SPP, BOUNCES, mode)

    return inject


def in_kernel(change: Callable[[float], AbstractContextManager[Any]]) -> Render:
    """A fault that patches the kernel."""

    def inject(scene: Scene, size: float, mode: Mode) -> Estimate:
        with change(size):
            return measure(scene, SPP, BOUNCES, mode)

    return inject


def in_image(change: Callable[[Floats], Floats]) -> Render:
    """A fault that changes the picture; its size mixes both."""

    def inject(scene: Scene, size: float, mode: Mode) -> Estimate:
        right = measure(scene, SPP, BOUNCES, mode)
        mean = (1 - size) * right.mean + size * change(right.mean)
        variance = (1 - size) ** 2 * right.variance + size**2 * change(right.variance)
        return replace(right, mean=mean, variance=variance)

    return inject


def brighter_albedo(shape: Shape, size: float) -> Shape:
    if shape.material is None:
        return shape
    red, green, blue = (a * (1 + size / 100) for a in shape.material.albedo)
    return with_material(shape, replace(shape.material, albedo=(red, green, blue)))


def sharper_lobe(shape: Shape, size: float) -> Shape:
    if not isinstance(shape.material, Phong):
        return shape
    exponent = shape.material.exponent * (1 + size / 100)
    return with_material(shape, Phong(shape.material.albedo, exponent))


def brighter_light(shape: Shape, size: float) -> Shape:
    if shape.radiance is None or not isinstance(shape, Sphere):
        return shape
    radiance = tuple(x * (1 + size / 100) for x in shape.radiance)
    return Sphere(shape.center, shape.radius, radiance=radiance)


def moved_light(shape: Shape, size: float) -> Shape:
    if not shape.is_light or not isinstance(shape, Sphere):
        return shape
    x, y, z = shape.center
    center = x + shape.radius * size / 100, y, z
    return Sphere(center, shape.radius, radiance=shape.radiance)


def with_material(shape: Shape, material: Material) -> Shape:
    if isinstance(shape, Sphere):
        return Sphere(shape.center, shape.radius, material)
    return Mesh(shape.vertices, shape.faces, shape.normals, material)


def more_bounces(scene: Scene, size: float, mode: Mode) -> Estimate:
    return measure(scene, SPP, BOUNCES + int(size), mode)


def counted_twice(scene: Scene, size: float, mode: Mode) -> Estimate:
    """Light that paths run into is added to what the lights' samples have found."""
    once, again, seen = (
        measure(scene, SPP, bounces, m)
        for bounces, m in ((BOUNCES, mode), (BOUNCES, Mode.IMPLICIT), (0, mode))
    )
    mean = once.mean + size * (again.mean - seen.mean)
    variance = once.variance + size**2 * (again.variance + seen.variance)
    return replace(once, mean=mean, variance=variance)


def no_cosine(size: float) -> AbstractContextManager[Any]:
    """Light samples of diffuse surfaces, from the cosine to 1 in its place."""

    def evaluate(self: Bsdf, to_light: Any) -> Any:
        cosine = dr.dot(self.point.shading_normal, to_light)
        share = dr.opaque(type(cosine), size)
        return self.albedo * dr.select(cosine > 0, INV_PI * dr.lerp(cosine, 1, share), 0)

    return patch.object(Bsdf, "eval", evaluate)


@contextmanager
def renormalised(size: float) -> Iterator[None]:
    """A lobe divided by its part above the horizon, which is nearly that of a Gaussian."""

    def factor(bsdf: Bsdf) -> Any:
        cosine = dr.dot(bsdf.point.shading_normal, bsdf.point.to_viewer)
        above = (1 + dr.erf(cosine * dr.sqrt((bsdf.code + 1) / 2))) / 2
        is_lobe = ~Diffuse.has(bsdf.code)
        return dr.select(is_lobe, dr.lerp(1, 1 / above, dr.opaque(type(cosine), size)), 1)

    def evaluate(self: Bsdf, to_light: Any) -> Any:
        return original_eval(self, to_light) * factor(self)

    def sample(self: Bsdf, u: Any) -> Any:
        sample = original_sample(self, u)
        return sample._replace(weight=sample.weight * factor(self))

    original_eval, original_sample = Bsdf.eval, Bsdf.sample
    with patch.object(Bsdf, "eval", evaluate), patch.object(Bsdf, "sample", sample):
        yield


def stopped_short(size: float) -> AbstractContextManager[Any]:
    """Shadow rays end so many percent before the light."""
    occluded = intersect.occluded

    def short(scene: Any, ray: Any, distance: Any, *rest: Any) -> Any:
        return occluded(scene, ray, distance * dr.opaque(type(distance), 1 - size / 100), *rest)

    return patch.object(path, "occluded", short)


FAULTS = [
    Fault("albedo too high", 0.5, "%", in_scene(brighter_albedo)),
    Fault("exponent too high", 2, "%", in_scene(sharper_lobe), GLOSSY),
    Fault("radiance too high", 0.3, "%", in_scene(brighter_light)),
    Fault("light moved sideways", 1, "% of its radius", in_scene(moved_light)),
    Fault("a bounce too many", 1, BOUNCE, more_bounces),
    Fault("a bounce too few", -1, BOUNCE, more_bounces),
    Fault("cosine missing", 1, WHOLE, in_kernel(no_cosine), mode=Mode.EXPLICIT),
    Fault("red and blue swapped", 1, WHOLE, in_image(lambda image: image[..., ::-1])),
    Fault("image mirrored", 1, WHOLE, in_image(lambda image: image[:, ::-1])),
    Fault("light counted twice", 1, WHOLE, counted_twice, mode=Mode.EXPLICIT),
    Fault("lobe renormalised at the horizon", 1, WHOLE, in_kernel(renormalised), ROOM),
    Fault("shadow rays stopped short", 1, "%", in_kernel(stopped_short), PLATE),
]
