"""What a shape of Mitsuba's reflects and emits."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from drpt.crosscheck.bsdfs import material_from, material_of
from drpt.crosscheck.spectra import buffers, element_colour
from drpt.scene import Diffuse, SceneError
from drpt.scene.checks import RADIANCE, RGB, colour

if TYPE_CHECKING:
    from drpt.crosscheck.elements import Element
    from drpt.scene import Material

TWO_SIDED = "TwoSidedBRDF"
"""Mitsuba's class of ``twosided``."""


class Surface(NamedTuple):
    """What a shape of Mitsuba's shows: it may reflect and emit at once, and reflect on one side."""

    reflects: Material
    two_sided: bool
    emits: RGB

    @property
    def is_light(self) -> bool:
        """Whether it emits."""
        return any(self.emits)

    @property
    def is_black(self) -> bool:
        """Whether it reflects nothing, as drpt's shapes with a radiance do."""
        return not self.two_sided and not any(self.reflects.albedo)

    def parameters(self) -> dict[str, Any]:
        """Return the parameters of drpt's shape."""
        if self.is_light or self.is_black:
            return {"radiance": self.emits}
        return {"material": self.reflects}


def surface(shape: Element) -> Surface:
    """Return the surface of an element; raise `SceneError` if drpt has nothing like it."""
    for child in shape.elements():
        if child.kind not in ("bsdf", "emitter"):
            raise child.refuse("drpt has nothing like it; a shape may have a bsdf and an emitter")
    bsdf, emitter = shape.only("bsdf"), shape.only("emitter")
    emits = _radiance(emitter) if emitter else (0.0, 0.0, 0.0)
    if bsdf is None:
        return Surface(Diffuse(0 if emitter else 0.5), two_sided=False, emits=emits)
    return Surface(*_reflection(bsdf), emits)


def object_surface(mi: Any, mesh: Any) -> Surface:
    """Return the surface of a mesh that is Mitsuba's object, as `to_mitsuba_dict` makes them."""
    two_sided = mesh.bsdf().class_name() == TWO_SIDED
    lobe = material_of(buffers(mi, mesh.bsdf(), "brdf_0." if two_sided else ""))
    emits = buffers(mi, mesh.emitter()).get("radiance.value") if mesh.is_emitter() else 0.0
    return Surface(lobe, two_sided, colour("emitter", emits, RADIANCE))


def _reflection(bsdf: Element) -> tuple[Material, bool]:
    """Return a material, and whether it is on both sides."""
    if bsdf.type != "twosided":
        return material_from(bsdf), False
    bsdf.allow()
    sides = bsdf.elements()
    if len(sides) != 1:
        raise bsdf.refuse(f"it holds {len(sides)} surfaces; it must hold one, for both sides")
    return material_from(sides[0]), True


def _radiance(emitter: Element) -> RGB:
    with emitter.blamed():
        if emitter.type != "area":
            raise SceneError("drpt has no such light; it must be an area emitter")
        emitter.allow("radiance", "sampling_weight")
        return element_colour(emitter, "radiance", RADIANCE, 1.0)
