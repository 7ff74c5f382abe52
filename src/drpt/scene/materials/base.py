"""What every material has."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

if TYPE_CHECKING:
    from drpt.scene.checks import RGB


@dataclass(frozen=True, init=False)
class Material(ABC):
    """How a surface reflects, on both sides.

    A kind of material is a frozen dataclass in a file of its own, and a line in the registry.
    Kernels get the row (albedo, code) of a material. They tell kinds apart by the code, which is a
    negative number of the kind, or a parameter that is at least 0.

    Attributes
    ----------
    name
        Of the kind, in scene files.
    label
        Adjective for its surfaces, in sentences.
    albedo
        Reflected part of the light, from 0 to 1, in each channel.
    is_delta
        Whether light is reflected into a single direction.
    is_diffuse
        Whether light is reflected into all directions alike.
    """

    name: ClassVar[str]
    label: ClassVar[str]
    is_delta: ClassVar[bool] = False
    is_diffuse: ClassVar[bool] = False

    albedo: RGB

    @property
    @abstractmethod
    def code(self) -> float:
        """Code of the material in the rows of kernels."""

    @staticmethod
    @abstractmethod
    def has(code: Any) -> Any:
        """Whether codes, in an array of NumPy or Dr.Jit, are of this kind."""
