"""Reading mesh files: OBJ and PLY through trimesh, NPZ through NumPy.

Vertices, faces and normals are taken as the file gives them, polygons as triangles; nothing is
made up or repaired. Of an OBJ file's vertices those of faces are kept, once for each normal they
have; its lines and points are left out.
"""

from __future__ import annotations

import io
import os
import re
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple
from zipfile import is_zipfile

import numpy as np

from drpt.scene import checks
from drpt.scene.checks import SceneError
from drpt.scene.reading import read_file

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from os import PathLike

    from numpy.typing import NDArray

OBJ_CORNER = re.compile(r"(I)(?:/(?:I)?(?:/(I))?)?".replace("I", "-?[0-9]{1,18}"))
"""A corner of a face: v, v/vt, v//vn or v/vt/vn; the groups are v and vn."""
OBJ_IGNORED = ("g", "l", "mg", "mtllib", "o", "p", "s", "usemtl", "vp", "vt")
"""Keywords of an OBJ file that take no part in what a mesh is here."""
SAME_SIZE = "in a binary PLY file all faces must have the same number of vertices"


MAX_BYTES = 2**32
"""Largest mesh file: 50 million vertices take 2 GB as an OBJ, and their arrays as much."""


class MeshArrays(NamedTuple):
    """A mesh as a file gives it: vertices (n, 3), faces (m, 3), and normals (n, 3) or None."""

    vertices: NDArray[Any]
    faces: NDArray[Any]
    normals: NDArray[Any] | None


def load_mesh(path: str | PathLike[str]) -> MeshArrays:
    """Read a mesh from an ``.obj``, ``.ply`` or ``.npz`` file (arrays ``v``, ``f``, ``vn``).

    An OBJ file is read whole, without its materials and texture coordinates. Raises `SceneError`
    if the file is missing, broken, of another kind, or without faces.
    """
    if not isinstance(path, str | os.PathLike):
        raise checks.refuse("", path, "the path of a mesh file")
    path = Path(path)
    try:
        read = {".obj": _read_obj, ".ply": _read_ply, ".npz": _read_npz}.get(path.suffix.lower())
        if read is None:
            raise SceneError("this is not a mesh file; it must end in .obj, .ply or .npz")
        return read(read_file(path, MAX_BYTES))
    except SceneError as error:
        raise error.in_file(str(path)) from None


def _read_npz(content: bytes) -> MeshArrays:
    if not is_zipfile(io.BytesIO(content)):
        raise SceneError("it is not an NPZ file")
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
            return MeshArrays(arrays["v"], arrays["f"], arrays.get("vn"))
    except KeyError:
        raise SceneError("it must hold the arrays 'v' and 'f', and may hold 'vn'") from None
    except Exception as error:  # NumPy and zipfile let many through, even MemoryError
        raise SceneError(f"it is not an NPZ file of plain arrays: {error}") from None


def _read_ply(content: bytes) -> MeshArrays:
    from trimesh.exchange.ply import load_ply

    note = f" ({SAME_SIZE})" if b"\nformat binary_" in content[:1000] else ""
    mesh = _call_trimesh(f"PLY file{note}", load_ply, content, fix_texture=False)
    for name, element in mesh["metadata"]["_ply_raw"].items():
        _check_rows(name, element)
    return _triangles(mesh)


def _check_rows(name: str, element: dict[str, Any]) -> None:
    """Raise unless an element of a PLY file has all its rows, and lists of one size if binary."""
    data = element.get("data", ())
    rows = len(next(iter(data.values())) if isinstance(data, dict) else data)
    if rows != element["length"]:
        raise SceneError(f"it ends after {rows} of {element['length']} rows of its {name} list")
    if isinstance(data, np.ndarray):
        columns = [data[column] for column in data.dtype.names or ()]
        sizes = [column["f0"] for column in columns if column.dtype.names]
        if any((size != size[:1]).any() for size in sizes):
            raise SceneError(SAME_SIZE)


def _read_obj(content: bytes) -> MeshArrays:
    from trimesh.exchange.obj import load_obj

    geometry = _obj_geometry(content.decode("utf-8-sig", errors="replace"))
    scene = _call_trimesh("OBJ file", load_obj, geometry.encode(), group_material=False)
    mesh: dict[str, Any] = next(iter(scene.get("geometry", {}).values()), {})
    if "//" in geometry and "vertex_normals" not in mesh:
        raise SceneError("a face has the index of a normal that does not exist")
    return _triangles(mesh)


def _call_trimesh(
    kind: str, load: Callable[..., dict[str, Any]], content: bytes, **options: bool
) -> dict[str, Any]:
    """Return what one of the loaders of trimesh reads; they let any error of theirs through."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)  # all that NumPy < 2.3 says of "x"
            return load(io.BytesIO(content), skip_materials=True, **options)
    except Exception as error:
        raise SceneError(f"this is no readable {kind}: {error}") from None


def _obj_geometry(text: str) -> str:
    """Return the lines of an OBJ file that hold vertices, normals and faces, for trimesh.

    Relative indices become absolute. What trimesh would leave out or read wrong without an error is
    refused: unknown keywords, index 0, and normals at some corners only.
    """
    lines = []
    counts = {"v": 0, "vn": 0}
    for number, line in _obj_lines(text):
        field = f"line {number}"
        keyword, *words = line.partition("#")[0].split() or [""]
        if keyword in counts:
            counts[keyword] += 1
        elif keyword == "f":
            if len(words) < 3:
                raise checks.refuse(field, line.strip(), "three vertices or more")
            words = [_obj_corner(field, corner, counts) for corner in words]
        elif not keyword or keyword in OBJ_IGNORED:
            continue
        else:
            raise checks.refuse(field, keyword, f"one of v, vn, f, {', '.join(OBJ_IGNORED)}")
        lines.append(" ".join((keyword, *words)))
    faces = [line for line in lines if line.startswith("f")]
    if len({"//" in corner for face in faces for corner in face.split()[1:]}) > 1:
        raise SceneError("only some of its faces have normals; all must have them, or none")
    return "\n".join(lines)


def _obj_lines(text: str) -> Iterator[tuple[int, str]]:
    """Yield the number and the text of each line; a backslash at its end joins the next."""
    number = 1
    for line in re.split(r"(?<!\\)\n", text.replace("\r\n", "\n").replace("\r", "\n")):
        yield number, line.replace("\\\n", " ")
        number += 1 + line.count("\n")


def _obj_corner(field: str, corner: str, counts: Mapping[str, int]) -> str:
    """Return the corner of a face as v or v//vn, counted from 1; `counts` are those before it."""
    match = OBJ_CORNER.fullmatch(corner)
    pairs = zip(match.groups(), counts.values(), strict=True) if match else ()
    indices = [_absolute(int(index), count) for index, count in pairs if index]
    if not indices or min(indices) < 1:
        words = "v, v/vt, v//vn or v/vt/vn, with indices from 1 on or from -1 back"
        raise checks.refuse(field, corner, words)
    return "//".join(map(str, indices))


def _absolute(index: int, count: int) -> int:
    return index if index >= 0 else count + 1 + index


def _triangles(mesh: dict[str, Any]) -> MeshArrays:
    """Return the arrays of what trimesh read, its quads split into triangles."""
    from trimesh.geometry import triangulate_quads

    faces = mesh.get("faces")
    if faces is None or len(faces) == 0:
        raise SceneError("it has no faces")
    return MeshArrays(mesh["vertices"], triangulate_quads(faces), mesh.get("vertex_normals"))
