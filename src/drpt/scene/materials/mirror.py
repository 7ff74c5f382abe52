"""The mirror."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from drpt.immutable import set_fields
from drpt.scene import checks
from drpt.scene.materials.base import Material

if TYPE_CHECKING:
    from drpt.scene.checks import Colour


@dataclass(frozen=True, init=False)
class Mirror(Material):
    """A perfectly specular surface: it reflects light into the mirror direction alone.

    Light samples never find that direction. So paths that leave a mirror collect the radiance of
    the lights that they hit, in all modes.

    Parameters
    ----------
    albedo
        From 0 to 1; three values, or one for grey.
    """

    name: ClassVar[str] = "mirror"
    label: ClassVar[str] = "mirror"
    is_delta: ClassVar[bool] = True

    def __init__(self, albedo: Colour) -> None:
        set_fields(self, albedo=checks.colour("albedo", albedo, checks.ALBEDO))

    @property
    def code(self) -> float:
        """-2."""
        return -2.0

    @staticmethod
    def has(code: Any) -> Any:
        """Whether codes are of this kind."""
        return code == -2.0
