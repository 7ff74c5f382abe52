"""Reading scene files: TOML text with a camera, materials and shapes.

A value that a file gives goes to the model as it is, and the model checks it; what is checked
here is which keys there are. Errors name the file and the path of the field in it.
"""

from __future__ import annotations

import difflib
import os
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from drpt.messages import shortened
from drpt.scene import checks
from drpt.scene.builtin import builtin_names, builtin_path
from drpt.scene.checks import SceneError
from drpt.scene.materials import MATERIALS, Material
from drpt.scene.model import Camera, Mesh, Scene, Shape, Sphere
from drpt.scene.names import Names
from drpt.scene.reading import read_file
from drpt.scene.toml import parse_toml

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator
    from os import PathLike

Table = dict[str, Any]
"""A TOML table."""

KINDS = {kind.name: kind for kind in MATERIALS}
"""Kinds of materials by their names in files."""
MAX_BYTES = 2**26
"""Largest scene file: a mesh of a million vertices fits, and it takes a minute to parse."""
MAX_LIST = 300
"""Characters of a list of names in an error."""
SURFACE = ("material", "radiance")


def load_scene(name_or_path: str | PathLike[str]) -> Scene:
    """Read a built-in scene by its name, or a scene file by its path.

    Raises `SceneError`, one line that names the file and the field, if there is no such scene or
    if something in it is missing, unknown or not allowed.
    """
    return read_scene(name_or_path).scene


class SceneFile(NamedTuple):
    """The content of a scene file.

    Attributes
    ----------
    path
        Of the file.
    scene
        The scene.
    names
        What the file calls its materials and meshes.
    """

    path: Path
    scene: Scene
    names: Names


def read_scene(name_or_path: str | PathLike[str]) -> SceneFile:
    """Read a scene like :func:`load_scene`, with the names that its file uses."""
    path = _find(name_or_path)
    try:
        table = parse_toml(read_file(path, MAX_BYTES))
        return SceneFile(path, *_scene(table, path.parent))
    except SceneError as error:
        raise error.in_file(str(path)) from None


def _find(name_or_path: str | PathLike[str]) -> Path:
    """Return the path of a scene; a name that is not built in needs a suffix or a folder."""
    if not isinstance(name_or_path, str | os.PathLike):
        raise checks.refuse("", name_or_path, "the name of a built-in scene or a path")
    name, path = str(name_or_path), Path(name_or_path)
    if isinstance(name_or_path, os.PathLike) or path.suffix or name != path.name:
        return path
    if found := builtin_path(name):
        return found
    if name and os.path.exists(path):  # unlike Path.exists, False where a name is too long
        return path
    raise _unknown("", "scene", name, builtin_names(), "the path of a scene file")


def _scene(scene: Table, folder: Path) -> tuple[Scene, Names]:
    _check_keys(scene, required=("camera", "shapes"), optional=("description", "materials"))
    with _within("camera"):
        camera = _camera(scene["camera"])
    with _within("materials"):
        materials = _materials(scene.get("materials", {}))
    if not isinstance(scene["shapes"], list):
        raise checks.refuse("shapes", scene["shapes"], "an array of tables, [[shapes]]")
    shapes = []
    for index, shape in enumerate(scene["shapes"]):
        with _within(f"shapes[{index}]"):
            shapes.append(_shape(shape, materials, folder))
    return Scene(camera, shapes, scene.get("description", "")), _names(materials, scene["shapes"])


def _names(materials: dict[str, Material], shapes: list[Table]) -> Names:
    of_shapes = (shape.get("material") for shape in shapes)
    named = tuple(name if isinstance(name, str) else None for name in of_shapes)
    return Names(materials, named, tuple(shape.get("file") for shape in shapes))


def _camera(value: object) -> Camera:
    camera = _table(value)
    _check_keys(camera, required=_field_names(Camera))
    return Camera(**camera)


def _materials(value: object) -> dict[str, Material]:
    materials = {}
    for name, material in _table(value).items():
        with _within(name):
            materials[name] = _material(material)
    return materials


def _material(value: object) -> Material:
    name, parameters = _split_type(value, KINDS)
    make = KINDS[name]
    _check_keys(parameters, required=_field_names(make))
    return make(**parameters)


def _shape(value: object, materials: dict[str, Material], folder: Path) -> Shape:
    kind, parameters = _split_type(value, ("sphere", "mesh"))
    if "material" in parameters:
        with _within("material"):
            parameters["material"] = _shape_material(parameters["material"], materials)
    if kind == "sphere":
        _check_keys(parameters, required=("center", "radius"), optional=SURFACE)
        return Sphere(**parameters)
    if "file" in parameters:
        _check_keys(parameters, required=("file",), optional=SURFACE)
        return _mesh_from_file(folder, **parameters)
    _check_keys(parameters, ("vertices", "faces"), ("normals", "file", *SURFACE))
    return Mesh(**parameters)


def _shape_material(value: object, materials: dict[str, Material]) -> Material:
    """Return the material of a shape, given by its name or as a table."""
    if not isinstance(value, str):
        return _material(value)
    if value not in materials:
        raise _unknown("", "material", value, materials, "a table with type, albedo, ...")
    return materials[value]


def _mesh_from_file(folder: Path, file: object, **surface: Any) -> Mesh:
    if not isinstance(file, str):
        raise checks.refuse("file", file, "the path of a mesh, relative to the scene file")
    try:
        return Mesh.load(folder / file, **surface)
    except SceneError as error:
        raise (SceneError(str(error), "file") if error.source else error) from None


def _table(value: object) -> Table:
    if not isinstance(value, dict):
        raise checks.refuse("", value, "a table")
    return dict(value)


def _split_type(value: object, types: Collection[str]) -> tuple[str, Table]:
    """Return the key ``type`` of a table, one of `types`, and its other keys."""
    others = _table(value)
    if "type" not in others:
        raise SceneError(f"this key is missing; it must be one of {_list(types)}", "type")
    name = others.pop("type")
    if not isinstance(name, str) or name not in types:
        raise _unknown("type", "type", name, types)
    return name, others


def _check_keys(table: Table, required: Collection[str], optional: Collection[str] = ()) -> None:
    known = (*required, *optional)
    for key in table:
        if key not in known:
            raise _unknown(key, "key", key, known)
    for key in required:
        if key not in table:
            raise SceneError("this key is missing", key)


def _unknown(
    field: str, what: str, value: object, known: Collection[str], otherwise: str = ""
) -> SceneError:
    """Return the error that `value` is not one of the `known`, with the closest of them.

    What else is allowed is said by `otherwise`.
    """
    close = []
    if isinstance(value, str) and len(value) <= MAX_LIST:  # longer ones take long
        close = difflib.get_close_matches(value, known, n=1)
    hint = f" (did you mean {checks.show(close[0])}?)" if close else ""
    listed = f"one of {_list(known)}" if known else ""
    allowed = " or ".join(filter(None, (listed, otherwise)))
    return SceneError(f"there is no {what} {checks.show(value)}{hint}; it must be {allowed}", field)


def _list(names: Collection[str]) -> str:
    return shortened(", ".join(names), MAX_LIST)


def _field_names(model: type[Camera | Material]) -> tuple[str, ...]:
    return tuple(field.name for field in fields(model))


@contextmanager
def _within(field: str) -> Iterator[None]:
    """Put `field` before the field that an error names."""
    try:
        yield
    except SceneError as error:
        raise error.within(field) from None
