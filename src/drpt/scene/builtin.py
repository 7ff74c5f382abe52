"""The scenes that come with drpt, each a TOML file."""

from __future__ import annotations

import tomllib
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).parents[1]


def builtin_names() -> tuple[str, ...]:
    """Return the names of the built-in scenes, sorted."""
    return tuple(sorted(_paths()))


def builtin_path(name: str) -> Path | None:
    """Return the scene file of a built-in scene; None if there is no such scene."""
    return _paths().get(name)


def builtin_descriptions() -> dict[str, str]:
    """Return the description of each built-in scene by its name."""
    return {name: _description(_paths()[name]) for name in builtin_names()}


@cache
def _paths() -> dict[str, Path]:
    return {path.stem: path for path in _folder().glob("*.toml")}


def _folder() -> Path:
    """Return the folder of the scenes: in the package once installed, else in the checkout."""
    installed = PACKAGE / "scenes"
    return installed if installed.is_dir() else PACKAGE.parents[1] / "scenes"


def _description(path: Path) -> str:
    with path.open("rb") as file:
        return str(tomllib.load(file)["description"])
