"""What a browser downloads: the picture, or the scene as it was changed."""

from __future__ import annotations

import shutil
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, NamedTuple

from drpt.scene import Mesh
from drpt.scene.saving import MAX_INLINE_VERTICES, to_toml

if TYPE_CHECKING:
    from drpt.result import Result
    from drpt.scene import Scene

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


def scene_file(scene: Scene, stem: str) -> File:
    """Return a scene as a TOML file; if its meshes are large, zipped with them beside it."""
    vertices = sum(len(shape.vertices) for shape in scene.shapes if isinstance(shape, Mesh))
    if vertices <= MAX_INLINE_VERTICES:
        return File(f"{stem}.toml", MEDIA["toml"], to_toml(scene).encode())
    with TemporaryDirectory() as folder:
        Path(folder, stem).mkdir()
        scene.save(Path(folder, stem, f"{stem}.toml"))
        archive = shutil.make_archive(str(Path(folder, "scene")), "zip", Path(folder, stem))
        return File(f"{stem}.zip", MEDIA["zip"], Path(archive).read_bytes())
