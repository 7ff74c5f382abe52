"""Names of materials and meshes in a scene file; the model has no names."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

    from drpt.scene.materials import Material
    from drpt.scene.model import Scene


@dataclass(frozen=True)
class Names:
    """Names in a scene file.

    Attributes
    ----------
    materials
        All materials that have a name, by name.
    of_shapes
        Name of each shape's material; None for lights and for materials without a name.
    files
        Path of each shape's mesh file as the scene file spells it; None for other shapes.
    """

    materials: Mapping[str, Material]
    of_shapes: tuple[str | None, ...]
    files: tuple[str | None, ...]

    def after_changes(self, scene: Scene) -> Names:
        """Return the names for a scene of the same shapes, whose materials may have changed.

        If all shapes of a material changed in the same way, its name goes to the new material.
        Otherwise it stays with the old material, and the changed materials have no name.
        """
        materials, of_shapes = dict(self.materials), list(self.of_shapes)
        users = defaultdict(list)
        for number, name in enumerate(of_shapes):
            if name is not None:
                users[name].append(number)
        for name, numbers in users.items():
            used = {material for n in numbers if (material := scene.shapes[n].material)}
            if len(used) == 1:
                (materials[name],) = used
                continue
            for number in numbers:
                if scene.shapes[number].material != materials[name]:
                    of_shapes[number] = None
        return Names(materials, tuple(of_shapes), self.files)


def numbered(scene: Scene) -> Names:
    """Return names for a scene without any; materials are numbered in the order of first use."""
    used = dict.fromkeys(shape.material for shape in scene.shapes if shape.material)
    names = {material: f"material-{n}" for n, material in enumerate(used, start=1)}
    of_shapes = tuple(names[shape.material] if shape.material else None for shape in scene.shapes)
    materials = {name: material for material, name in names.items()}
    return Names(materials, of_shapes, (None,) * len(scene.shapes))
