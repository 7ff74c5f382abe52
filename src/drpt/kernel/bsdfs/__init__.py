"""BSDFs: a file for each kind, the registry of all kinds, and a table of those of a scene."""

from drpt.kernel.bsdfs.base import Lobe, SurfacePoint
from drpt.kernel.bsdfs.bsdf import Bsdf, BsdfSample
from drpt.kernel.bsdfs.diffuse import DiffuseLobe
from drpt.kernel.bsdfs.mirror import MirrorLobe
from drpt.kernel.bsdfs.phong import PhongLobe
from drpt.kernel.bsdfs.table import Materials

LOBES: tuple[Lobe, ...] = (DiffuseLobe(), PhongLobe(), MirrorLobe())
"""All kinds of BSDFs, in the order of the registry of materials."""

__all__ = [
    "LOBES",
    "Bsdf",
    "BsdfSample",
    "DiffuseLobe",
    "Lobe",
    "Materials",
    "MirrorLobe",
    "PhongLobe",
    "SurfacePoint",
]
