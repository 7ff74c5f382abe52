"""Colours of Mitsuba's objects, as drpt takes them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from drpt.scene.checks import RGB, colour

if TYPE_CHECKING:
    from drpt.crosscheck.elements import Element
    from drpt.scene.checks import Allowed


def element_colour(
    element: Element, name: str, allowed: Allowed, default: float | None = None
) -> RGB:
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
    return buffers(mi, copy)[f"{name}.value"]


def buffers(mi: Any, instance: Any, prefix: str = "") -> dict[str, Any]:
    """Return an object's parameters as three numbers, or one; the prefix is taken off their names.

    Leave out the weight for sampling lights.
    """
    parameters = mi.traverse(instance)
    return {
        name.removeprefix(prefix): np.array(parameters[name], np.float64).squeeze()
        for name in parameters.keys()  # noqa: SIM118, it is no dict
        if name != "sampling_weight"
    }


def rgb(colour: Any) -> dict[str, Any]:
    """Return a colour as a spectrum of Mitsuba's."""
    return {"type": "rgb", "value": colour}
