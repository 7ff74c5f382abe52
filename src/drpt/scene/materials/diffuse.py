"""The diffuse material."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from drpt.immutable import set_fields
from drpt.scene import checks
from drpt.scene.materials.base import Material

if TYPE_CHECKING:
    from drpt.scene.checks import Colour


@dataclass(frozen=True, init=False)
class Diffuse(Material):
    """A Lambertian surface, f = albedo / π.

    Parameters
    ----------
    albedo
        From 0 to 1; three values, or one for grey.
    """

    name: ClassVar[str] = "diffuse"
    label: ClassVar[str] = "diffuse"
    is_diffuse: ClassVar[bool] = True

    def __init__(self, albedo: Colour) -> None:
        set_fields(self, albedo=checks.colour("albedo", albedo, checks.ALBEDO))

    @property
    def code(self) -> float:
        """-1."""
        return -1.0

    @staticmethod
    def has(code: Any) -> Any:
        """Whether codes are of this kind."""
        return code == -1.0
