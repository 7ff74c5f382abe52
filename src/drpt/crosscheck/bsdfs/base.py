"""What every kind of BSDF offers: its counterpart in Mitsuba."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar, Protocol

if TYPE_CHECKING:
    from drpt.crosscheck.elements import Element
    from drpt.scene import Material


class Counterpart(Protocol):
    """A BSDF of Mitsuba's that reflects as a kind of material, on one side.

    ``plugin`` is its type, and ``is_builtin`` tells whether Mitsuba has it without drpt.
    """

    material: ClassVar[type[Material]]
    plugin: ClassVar[str]
    is_builtin: ClassVar[bool]

    def to_mitsuba(self, material: Any) -> dict[str, Any]:
        """Return the plugin's parameters for a material."""
        ...

    def from_element(self, bsdf: Element) -> Material:
        """Return the material of an element; raise `SceneError` if there is none like it."""
        ...

    def from_buffers(self, parameters: dict[str, Any]) -> Material | None:
        """Return the material of an object with these parameters; None if it is another plugin."""
        ...
