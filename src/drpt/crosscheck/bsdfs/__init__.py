"""Counterparts of materials in Mitsuba: a file for each kind, and the registry of all kinds."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from drpt.crosscheck.bsdfs.diffuse import DiffuseCounterpart
from drpt.crosscheck.bsdfs.mirror import MirrorCounterpart
from drpt.crosscheck.bsdfs.phong import PhongCounterpart
from drpt.scene import SceneError

if TYPE_CHECKING:
    from drpt.crosscheck.bsdfs.base import Counterpart
    from drpt.crosscheck.elements import Element
    from drpt.scene import Material

COUNTERPARTS: tuple[Counterpart, ...] = (
    DiffuseCounterpart(),
    PhongCounterpart(),
    MirrorCounterpart(),
)
"""All kinds, in the order of the registry of materials."""
PLUGINS = ", ".join(kind.plugin for kind in COUNTERPARTS)


def counterpart(material: Material) -> Counterpart:
    """Return the counterpart of a material."""
    return next(kind for kind in COUNTERPARTS if isinstance(material, kind.material))


def bsdf_of(material: Material) -> dict[str, Any]:
    """Return a BSDF of Mitsuba's that reflects on both sides as a material."""
    kind = counterpart(material)
    return {"type": "twosided", "bsdf": {"type": kind.plugin, **kind.to_mitsuba(material)}}


def material_from(bsdf: Element) -> Material:
    """Return the material of an element; raise `SceneError` if drpt has nothing like it."""
    with bsdf.blamed():
        for kind in COUNTERPARTS:
            if bsdf.type == kind.plugin:
                return kind.from_element(bsdf)
        raise SceneError(f"drpt has no such surface; it must be twosided or one of {PLUGINS}")


def material_of(parameters: dict[str, Any]) -> Material:
    """Return the material of an object of Mitsuba's with these parameters."""
    for kind in COUNTERPARTS:
        if material := kind.from_buffers(parameters):
            return material
    raise SceneError(f"drpt has no such surface; it must be one of {PLUGINS}", "bsdf")
