"""What a browser downloads: the picture, or the scene as it was changed."""

from __future__ import annotations

import hashlib
import shutil
from dataclasses import replace
from pathlib import Path, PurePath
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, NamedTuple

from drpt.scene import Mesh, SceneError
from drpt.scene.meshes import MAX_BYTES
from drpt.scene.reading import read_file
from drpt.scene.saving import MAX_INLINE_VERTICES, save_scene, to_toml

if TYPE_CHECKING:
    from drpt.result import Result
    from drpt.scene import Scene
    from drpt.scene.files import SceneFile

FORMATS = ("exr", "png", "scene")
MEDIA = {
    "exr": "image/x-exr",
    "png": "image/png",
    "toml": "application/toml",
    "zip": "application/zip",
}


class File(NamedTuple):
    """A file for download."""

    name: str
    media: str
    content: bytes


def picture_file(result: Result, stem: str, suffix: str, exposure: float) -> File:
    """Return a picture as EXR or PNG, as :meth:`drpt.Result.save` writes it."""
    name = f"{stem}.{suffix}"
    with TemporaryDirectory() as folder:
        path = Path(folder, name)
        result.save(path, exposure=exposure)
        return File(name, MEDIA[suffix], path.read_bytes())


def scene_file(shown: Scene, source: SceneFile) -> File:
    """Return a scene as a file, with the picture size and the names of its source.

    It is a TOML file, zipped with its meshes if these are large or in files of their own. Mesh
    files are copied as they are now. Raises `SceneError` if one can no longer be read.
    """
    camera = source.scene.camera
    scene = shown.resized(camera.width, camera.height)
    names, stem = source.names.after_changes(scene), source.path.stem
    vertices = sum(len(shape.vertices) for shape in scene.shapes if isinstance(shape, Mesh))
    if vertices <= MAX_INLINE_VERTICES and not any(names.files):
        return File(f"{stem}.toml", MEDIA["toml"], to_toml(scene, names).encode())
    inside = {file: _inside(file) for file in names.files if file}
    names = replace(names, files=tuple(file and inside[file] for file in names.files))
    with TemporaryDirectory() as folder:
        root = Path(folder, stem)
        root.mkdir()
        for file, copy in inside.items():
            (root / copy).parent.mkdir(parents=True, exist_ok=True)
            (root / copy).write_bytes(_mesh(source.path.parent / file))
        save_scene(scene, root / f"{stem}.toml", names)
        archive = shutil.make_archive(str(Path(folder, "scene")), "zip", root)
        return File(f"{stem}.zip", MEDIA["zip"], Path(archive).read_bytes())


def _mesh(path: Path) -> bytes:
    try:
        return read_file(path, MAX_BYTES)
    except SceneError as error:
        raise error.in_file(str(path)) from None


def _inside(file: str) -> str:
    """Name of a mesh file in an archive: unchanged if it is inside the scene's folder."""
    path = PurePath(file)
    if path.is_absolute() or ".." in path.parts:
        digest = hashlib.sha256(file.encode()).hexdigest()[:8]
        return f"meshes/{digest}-{path.name}"
    return path.as_posix()
