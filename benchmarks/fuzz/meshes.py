"""Mesh files: OBJ, PLY and NPZ. An input begins with its kind, in capitals if it has no fault."""

from __future__ import annotations

import io
import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.fuzz.mutations import mutate_bytes, mutate_integer
from benchmarks.fuzz.polygons import (
    assert_covered_once,
    damaged,
    misplaced,
    obj,
    ply,
    star,
    tangle,
)
from benchmarks.fuzz.target import Target
from drpt.scene import Mesh, checks, meshes, polygons
from drpt.scene.checks import SceneError

if TYPE_CHECKING:
    from pathlib import Path
    from random import Random

ARRAYS: tuple[Any, ...] = (
    *(np.eye(3), np.eye(3, dtype="f4"), [[0, 1, 2]], [[0, 1, 9]], [[-1, 0, 1]], [0, 1, 2], []),
    *(np.full((3, 3), np.nan), np.full((3, 3), 1e300), np.eye(3) > 0, ["a", "b"], 3.0),
    *(np.zeros((0, 3)), np.zeros((3, 3), complex), np.zeros(3, [("x", "f4")]), np.eye(4)),
)


def make(random: Random) -> bytes:
    """Make a mesh file, some without faults."""
    kind = random.choice(("obj", "ply", "npz"))
    if kind == "npz":
        return b"npz" + _npz(random)
    if random.random() < 0.2:
        mesh = star(random)
        return (
            (b"OBJ" + obj(mesh, random))
            if kind == "obj"
            else b"PLY" + ply(mesh, random, faults=False)
        )
    mesh = tangle(random)
    if random.random() < 0.3:
        mesh = misplaced(mesh, random)
    content = obj(mesh, random) if kind == "obj" else ply(mesh, random, faults=True)
    return kind.encode() + damaged(content, random)


def _npz(random: Random) -> bytes:
    arrays: dict[str, Any] = {"v": np.eye(3), "f": [[0, 1, 2]], "vn": np.eye(3)}
    for _ in range(random.randrange(3)):
        arrays[random.choice(("v", "f", "vn", "x"))] = random.choice(ARRAYS)
    file = io.BytesIO()
    plain: dict[str, Any] = {name: np.asarray(array) for name, array in arrays.items()}
    np.savez(file, **plain)
    content = file.getvalue()
    match random.randrange(4):
        case 0:
            return mutate_bytes(content, random)
        case 1:
            return mutate_integer(content, random)
    return content


def load(path: Path) -> None:
    """Load the mesh from a file of its kind's name."""
    content = path.read_bytes()
    kind = content[:3].decode()
    file = path.with_name(f"{path.name}.{kind.lower()}")
    file.write_bytes(content[3:])
    with warnings.catch_warnings(action="ignore", category=UserWarning):
        mesh = Mesh.load(file, radiance=1)
    if kind.isupper():
        assert_covered_once(mesh)


TARGET = Target(
    "meshes", ".mesh", make, load, (SceneError,), checks.vectors, (meshes, polygons, checks)
)
