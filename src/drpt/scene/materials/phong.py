"""The glossy material."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from drpt.immutable import set_fields
from drpt.scene import checks
from drpt.scene.materials.base import Material

if TYPE_CHECKING:
    from drpt.scene.checks import Colour


@dataclass(frozen=True, init=False)
class Phong(Material):
    """A glossy surface, f = albedo (exponent + 1) / (2π) max(0, ω_r·ω_i)^exponent.

    Here ω_r is the view direction mirrored at the shading normal (Lafortune and Willems 1994;
    their specular part alone, with exponent + 1 in place of exponent + 2).

    Parameters
    ----------
    albedo
        From 0 to 1; three values, or one for grey.
    exponent
        From 0 to 1e8; the higher, the sharper the reflection.
    """

    name: ClassVar[str] = "phong"
    label: ClassVar[str] = "Phong"

    exponent: float

    def __init__(self, albedo: Colour, exponent: float) -> None:
        set_fields(
            self,
            albedo=checks.colour("albedo", albedo, checks.ALBEDO),
            exponent=checks.number("exponent", exponent, checks.EXPONENT),
        )

    @property
    def code(self) -> float:
        """The exponent."""
        return self.exponent

    @staticmethod
    def has(code: Any) -> Any:
        """Whether codes are of this kind."""
        return code >= 0
