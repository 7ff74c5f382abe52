"""Phong surfaces in Mitsuba, which has none: drpt registers a plugin."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

from drpt.crosscheck.bsdfs.phong_plugin import NAME
from drpt.crosscheck.spectra import element_colour, rgb
from drpt.scene import Phong
from drpt.scene.checks import ALBEDO

if TYPE_CHECKING:
    from drpt.crosscheck.elements import Element
    from drpt.scene import Material


class PhongCounterpart:
    """The plugin ``drpt_phong``."""

    material: ClassVar[type[Material]] = Phong
    plugin: ClassVar[str] = NAME
    is_builtin: ClassVar[bool] = False

    def to_mitsuba(self, material: Phong) -> dict[str, Any]:
        """Return the plugin's parameters for a material."""
        return {"exponent": material.exponent, "reflectance": rgb(material.albedo)}

    def from_element(self, bsdf: Element) -> Phong:
        """Return the material of an element."""
        bsdf.allow("reflectance", "exponent")
        return Phong(element_colour(bsdf, "reflectance", ALBEDO), bsdf.get("exponent", None))

    def from_buffers(self, parameters: dict[str, Any]) -> Phong | None:
        """Return the material of an object with these parameters."""
        if parameters.keys() != {"reflectance", "exponent"}:
            return None
        return Phong(parameters["reflectance"], float(parameters["exponent"]))
