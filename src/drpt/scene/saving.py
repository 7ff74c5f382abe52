"""Writing scenes: as a TOML scene file with its meshes beside it, or as one text."""

from __future__ import annotations

import hashlib
import io
import os
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from drpt.files import write_file
from drpt.scene import checks
from drpt.scene.checks import SceneError
from drpt.scene.model import Mesh, Scene, Shape
from drpt.scene.names import numbered

if TYPE_CHECKING:
    from collections.abc import Callable
    from os import PathLike

    from drpt.scene.materials import Material
    from drpt.scene.names import Names

Table = dict[str, Any]
"""A TOML table."""

MAX_INLINE_VERTICES = 1000
"""Vertices of a scene up to which `to_toml` spells its meshes out."""


def save_scene(scene: Scene, path: str | PathLike[str], names: Names | None = None) -> None:
    """Write `scene` to a TOML file, and its meshes as NPZ files into ``<stem>-meshes`` beside it.

    `load_scene` reads an equal scene from it. Meshes are named by their content and every file
    is replaced as a whole, the scene file last: whatever happens, the file there is complete.
    With `names`, materials are called so, and meshes that have the name of a file are not written.
    Raises `SceneError` if it cannot be written.
    """
    if not isinstance(path, str | os.PathLike) or not Path(path).name:
        raise checks.refuse("", path, "the path of a scene file")
    path = Path(path)
    folder = path.with_name(f"{path.stem}-meshes")

    def save_mesh(mesh: Mesh) -> Table:
        content = _npz(mesh)
        file = folder / f"{hashlib.sha256(content).hexdigest()[:16]}.npz"
        folder.mkdir(exist_ok=True)
        write_file(file, content)
        return {"file": file.relative_to(path.parent).as_posix()}

    try:
        write_file(path, _toml(scene, save_mesh, names).encode())
    except OSError as error:
        cause = error.__cause__ or error
        problem = f"it cannot be written: {getattr(cause, 'strerror', cause)}"
        raise SceneError(problem, source=str(path)) from None
    except ValueError as error:  # a null character in the path, half a character in a text
        raise SceneError(f"it cannot be written: {error}", source=str(path)) from None


def to_toml(scene: Scene, names: Names | None = None) -> str:
    """Return `scene` as one TOML text, for the metadata of pictures.

    If its meshes have more than 1000 vertices together, each mesh is given by ``vertex_count``,
    ``face_count`` and the ``sha256`` of its arrays; such a text does not load.
    Materials, and meshes from files, are called as in `names`.
    """
    vertices = sum(len(shape.vertices) for shape in scene.shapes if isinstance(shape, Mesh))
    return _toml(scene, _arrays if vertices <= MAX_INLINE_VERTICES else _summary, names)


def _toml(scene: Scene, describe_mesh: Callable[[Mesh], Table], names: Names | None) -> str:
    """Return `scene` as TOML; `describe_mesh` gives the keys of a mesh that has no file."""
    import tomli_w

    names = names or numbered(scene)
    geometries = [
        {"type": "mesh", "file": file} if file else _geometry(shape, describe_mesh)
        for shape, file in zip(scene.shapes, names.files, strict=True)
    ]
    surfaces = map(_surface, scene.shapes, names.of_shapes)
    table = {
        "description": scene.description,
        "camera": asdict(scene.camera),
        "materials": {name: _material(m) for name, m in names.materials.items()},
        "shapes": [g | s for g, s in zip(geometries, surfaces, strict=True)],
    }
    return tomli_w.dumps(table)


def _material(material: Material) -> Table:
    return {"type": material.name, **asdict(material)}


def _geometry(shape: Shape, describe_mesh: Callable[[Mesh], Table]) -> Table:
    if isinstance(shape, Mesh):
        return {"type": "mesh", **describe_mesh(shape)}
    return {"type": "sphere", "center": shape.center, "radius": shape.radius}


def _surface(shape: Shape, name: str | None) -> Table:
    if shape.material is None:
        return {"radiance": shape.radiance}
    return {"material": name or _material(shape.material)}


def _arrays(mesh: Mesh) -> Table:
    arrays = {"vertices": mesh.vertices.tolist(), "faces": mesh.faces.tolist()}
    return arrays if mesh.normals is None else {**arrays, "normals": mesh.normals.tolist()}


def _summary(mesh: Mesh) -> Table:
    return {
        "vertex_count": len(mesh.vertices),
        "face_count": len(mesh.faces),
        "sha256": hashlib.sha256(_npz(mesh)).hexdigest(),
    }


def _npz(mesh: Mesh) -> bytes:
    normals = {} if mesh.normals is None else {"vn": mesh.normals}
    file = io.BytesIO()
    np.savez(file, allow_pickle=False, v=mesh.vertices, f=mesh.faces, **normals)
    return file.getvalue()
