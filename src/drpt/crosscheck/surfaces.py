"""What a shape of Mitsuba's reflects and emits."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from drpt.crosscheck.phong import NAME as PHONG
from drpt.scene import Diffuse, Phong, SceneError
from drpt.scene.checks import ALBEDO, RADIANCE, RGB, colour

if TYPE_CHECKING:
    from drpt.crosscheck.elements import Element
    from drpt.scene import Material
    from drpt.scene.checks import Allowed

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
    bsdf = _buffers(mi, mesh.bsdf(), "brdf_0." if two_sided else "")
    emits = _buffers(mi, mesh.emitter()).get("radiance.value") if mesh.is_emitter() else 0.0
    if bsdf.keys() == {"reflectance.value"}:
        lobe: Material = Diffuse(bsdf["reflectance.value"])
    elif bsdf.keys() == {"reflectance", "exponent"}:
        lobe = Phong(bsdf["reflectance"], float(bsdf["exponent"]))
    else:
        raise SceneError("drpt has no such surface; it must be diffuse or drpt_phong", "bsdf")
    return Surface(lobe, two_sided, colour("emitter", emits, RADIANCE))


def _reflection(bsdf: Element) -> tuple[Material, bool]:
    """Return a material, and whether it is on both sides."""
    if bsdf.type != "twosided":
        return _lobe(bsdf), False
    bsdf.allow()
    sides = bsdf.elements()
    if len(sides) != 1:
        raise bsdf.refuse(f"it holds {len(sides)} surfaces; it must hold one, for both sides")
    return _lobe(sides[0]), True


def _lobe(bsdf: Element) -> Material:
    with bsdf.blamed():
        if bsdf.type == "diffuse":
            bsdf.allow("reflectance")
            return Diffuse(_colour(bsdf, "reflectance", ALBEDO, 0.5))
        if bsdf.type == PHONG:
            bsdf.allow("reflectance", "exponent")
            return Phong(_colour(bsdf, "reflectance", ALBEDO), bsdf.get("exponent", None))
        raise SceneError(f"drpt has no such surface; it must be diffuse, twosided or {PHONG}")


def _radiance(emitter: Element) -> RGB:
    with emitter.blamed():
        if emitter.type != "area":
            raise SceneError("drpt has no such light; it must be an area emitter")
        emitter.allow("radiance", "sampling_weight")
        return _colour(emitter, "radiance", RADIANCE, 1.0)


def _colour(element: Element, name: str, allowed: Allowed, default: float | None = None) -> RGB:
    """Return a colour as drpt takes it; Mitsuba converts spectra."""
    for child in element.elements():
        raise child.refuse(f"drpt's {name} is one colour; it must be an rgb, spectrum or number")
    value = element.get(name, default)
    if isinstance(value, element.mi.ScalarColor3d):
        value = list(value)
    elif value is not None and not isinstance(value, float | int):
        value = _spectrum(element.mi, name, value)
    return colour(name, value, allowed)


def _spectrum(mi: Any, name: str, spectrum: Any) -> Any:
    """Return the colour that Mitsuba makes of a spectrum, as a reflectance or as a radiance."""
    properties = mi.Properties("area" if name == "radiance" else "diffuse")
    properties[name] = spectrum
    copy = mi.PluginManager.instance().create_object(properties)
    return _buffers(mi, copy)[f"{name}.value"]


def _buffers(mi: Any, instance: Any, prefix: str = "") -> dict[str, Any]:
    """Return an object's parameters as three numbers, or one; the prefix is taken off their names.

    Leave out the weight for sampling lights.
    """
    parameters = mi.traverse(instance)
    return {
        name.removeprefix(prefix): np.array(parameters[name], np.float64).squeeze()
        for name in parameters.keys()  # noqa: SIM118, it is no dict
        if name != "sampling_weight"
    }
