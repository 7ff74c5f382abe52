"""Diffuse surfaces in Mitsuba."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

from drpt.crosscheck.spectra import element_colour, rgb
from drpt.scene import Diffuse
from drpt.scene.checks import ALBEDO

if TYPE_CHECKING:
    from drpt.crosscheck.elements import Element
    from drpt.scene import Material


class DiffuseCounterpart:
    """Mitsuba's ``diffuse``."""

    material: ClassVar[type[Material]] = Diffuse
    plugin: ClassVar[str] = "diffuse"
    is_builtin: ClassVar[bool] = True

    def to_mitsuba(self, material: Diffuse) -> dict[str, Any]:
        """Return the plugin's parameters for a material."""
        return {"reflectance": rgb(material.albedo)}

    def from_element(self, bsdf: Element) -> Diffuse:
        """Return the material of an element."""
        bsdf.allow("reflectance")
        return Diffuse(element_colour(bsdf, "reflectance", ALBEDO, 0.5))

    def from_buffers(self, parameters: dict[str, Any]) -> Diffuse | None:
        """Return the material of an object with these parameters."""
        if parameters.keys() != {"reflectance.value"}:
            return None
        return Diffuse(parameters["reflectance.value"])
