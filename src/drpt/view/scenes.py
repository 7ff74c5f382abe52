"""The scenes that are served: the one that was asked for, and the built-in ones."""

from __future__ import annotations

from functools import lru_cache
from math import sqrt
from pathlib import Path
from typing import TYPE_CHECKING

from drpt.scene.builtin import builtin_names
from drpt.scene.checks import refuse
from drpt.scene.files import read_scene

if TYPE_CHECKING:
    from drpt.scene import Scene
    from drpt.scene.files import SceneFile

MAX_PIXELS = 2**17
"""Larger pictures are shown smaller, unless their size was asked for."""


class Scenes:
    """Scenes by name, in a size to look at.

    Parameters
    ----------
    scene
        Name of a built-in scene, or path of a scene file, which is served by its file's name.
    width, height
        Size of the pictures in pixels, see :meth:`drpt.Scene.resized`; both None for the scene's
        own, unless it is large.

    Raises `SceneError` if there is no such scene, or something in it is not allowed.
    """

    def __init__(self, scene: str, width: int | None = None, height: int | None = None) -> None:
        self.default = scene if scene in builtin_names() else Path(scene).name
        self._paths = {self.default: scene} | {name: name for name in builtin_names()}
        self._paths[self.default] = scene
        self._size = width, height
        self.file = lru_cache(maxsize=None)(self._file)
        self.load = lru_cache(maxsize=None)(self._load)
        self.load(self.default)

    @property
    def names(self) -> list[str]:
        """All names, the default first."""
        return list(self._paths)

    def _load(self, name: str) -> Scene:
        """Return a scene in the size in which it is shown; raises like :meth:`file`."""
        return sized(self.file(name).scene, *self._size)

    def _file(self, name: str) -> SceneFile:
        """Return a scene as its file has it; raises `SceneError` for a name that is not served."""
        if name not in self._paths:
            raise refuse("scene", name, f"one of {', '.join(self._paths)}")
        return read_scene(self._paths[name])


def sized(scene: Scene, width: int | None, height: int | None) -> Scene:
    """Return a scene whose picture has the size that was asked for, or not too many pixels."""
    camera = scene.camera
    if width is None and height is None:
        shrink = min(1.0, sqrt(MAX_PIXELS / (camera.width * camera.height)))
        width, height = (max(1, int(shrink * side)) for side in (camera.width, camera.height))
    return scene.resized(width, height)
