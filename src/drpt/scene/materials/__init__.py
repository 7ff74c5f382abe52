"""Materials: a file for each kind, and the registry of all kinds."""

from drpt.scene.materials.base import Material
from drpt.scene.materials.diffuse import Diffuse
from drpt.scene.materials.mirror import Mirror
from drpt.scene.materials.phong import Phong

MATERIALS: tuple[type[Material], ...] = (Diffuse, Phong, Mirror)
"""All kinds of materials, in the order in which kernels tell them apart."""

__all__ = ["MATERIALS", "Diffuse", "Material", "Mirror", "Phong"]
