"""Mirrors in Mitsuba."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

from drpt.crosscheck.spectra import element_colour, rgb
from drpt.scene import Mirror, SceneError
from drpt.scene.checks import ALBEDO

if TYPE_CHECKING:
    from drpt.crosscheck.elements import Element
    from drpt.scene import Material


class MirrorCounterpart:
    """Mitsuba's ``conductor`` of the material ``none``, whose Fresnel reflectance is 1."""

    material: ClassVar[type[Material]] = Mirror
    plugin: ClassVar[str] = "conductor"
    is_builtin: ClassVar[bool] = True

    def to_mitsuba(self, material: Mirror) -> dict[str, Any]:
        """Return the plugin's parameters for a material."""
        return {"material": "none", "specular_reflectance": rgb(material.albedo)}

    def from_element(self, bsdf: Element) -> Mirror:
        """Return the material of an element."""
        bsdf.allow("material", "specular_reflectance")
        if bsdf.text("material", "none") != "none":
            raise SceneError("drpt has no such metal; it must be none", "material")
        return Mirror(element_colour(bsdf, "specular_reflectance", ALBEDO, 1.0))

    def from_buffers(self, parameters: dict[str, Any]) -> Mirror | None:
        """Return the material of an object with these parameters."""
        if parameters.keys() != {"eta.value", "k.value", "specular_reflectance.value"}:
            return None
        if parameters["eta.value"].any():
            return None
        return Mirror(parameters["specular_reflectance.value"])
