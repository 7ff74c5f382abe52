"""Emitters: a file for each kind, and a table of those that a scene has."""

from drpt.kernel.emitters.base import DirectionSample, LightRow, LightRows, Receiver, light_row
from drpt.kernel.emitters.light_tree import Choice, LightTree
from drpt.kernel.emitters.sphere import SphereLights
from drpt.kernel.emitters.table import Emitters, LightSample, power_heuristic
from drpt.kernel.emitters.triangle import TriangleLights

__all__ = [
    "Choice",
    "DirectionSample",
    "Emitters",
    "LightRow",
    "LightRows",
    "LightSample",
    "LightTree",
    "Receiver",
    "SphereLights",
    "TriangleLights",
    "light_row",
    "power_heuristic",
]
