"""Reading mesh files: OBJ and PLY through trimesh, NPZ through NumPy.

Vertices, faces and normals are taken as the file gives them, polygons as triangles; nothing is
made up or repaired. A warning names polygons that intersect themselves or are far from planar. Of
an OBJ file's vertices those of faces are kept, once for each normal they have; its lines and points
are left out.
"""

from __future__ import annotations

import io
import logging
import os
import re
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple
from zipfile import is_zipfile

import numpy as np

from drpt.files import read_npz
from drpt.scene import checks
from drpt.scene.checks import SceneError
from drpt.scene.polygons import triangulate, warn_of_flaws
from drpt.scene.reading import read_file

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from os import PathLike

    from numpy.typing import NDArray

logging.getLogger("trimesh").addHandler(logging.NullHandler())  # else it writes to stderr
OBJ_CORNER = re.compile(r"(I)(?:/(?:I)?(?:/(I))?)?".replace("I", "-?[0-9]{1,18}"))
"""A corner of a face: v, v/vt, v//vn or v/vt/vn; the groups are v and vn."""
OBJ_IGNORED = ("g", "l", "mg", "mtllib", "o", "p", "s", "usemtl", "vp", "vt")
"""Keywords of an OBJ file that take no part in what a mesh is here."""
PLY_FACES = ("vertex_index", "vertex_indices")
NO_FACES = "it has no faces"
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
    if the file is missing, broken, of another kind, or without faces. Warns of polygons that
    intersect themselves or are far from planar.
    """
    if not isinstance(path, str | os.PathLike):
        raise checks.refuse("", path, "the path of a mesh file")
    path = Path(path)
    try:
        read = {".obj": _read_obj, ".ply": _read_ply, ".npz": _read_npz}.get(path.suffix.lower())
        if read is None:
            raise SceneError("this is not a mesh file; it must end in .obj, .ply or .npz")
        return read(read_file(path, MAX_BYTES), path)
    except SceneError as error:
        raise error.in_file(str(path)) from None


def _read_npz(content: bytes, _: Path) -> MeshArrays:
    if not is_zipfile(io.BytesIO(content)):
        raise SceneError("it is not an NPZ file")
    try:
        arrays = read_npz(io.BytesIO(content))
    except ValueError as error:
        raise SceneError(str(error)) from None
    if not {"v", "f"} <= arrays.keys():
        raise SceneError("it must hold the arrays 'v' and 'f', and may hold 'vn'")
    return MeshArrays(arrays["v"], arrays["f"], arrays.get("vn"))


def _read_ply(content: bytes, path: Path) -> MeshArrays:
    from trimesh.exchange.ply import load_ply

    note = f" ({SAME_SIZE})" if b"\nformat binary_" in content[:1000] else ""
    mesh = _call_trimesh(f"PLY file{note}", load_ply, content, fix_texture=False)
    elements = mesh["metadata"]["_ply_raw"]
    for name, element in elements.items():
        _check_rows(name, element)
    vertices, faces = mesh.get("vertices"), _ply_faces(mesh)
    if vertices is None or faces is None or not len(faces):
        raise SceneError(NO_FACES)
    if vertices.dtype == object:
        raise SceneError("some of its vertices have fewer numbers than others")
    triangles = _triangles(vertices, faces, path, _ply_places(content, elements))
    return MeshArrays(vertices, triangles, mesh.get("vertex_normals"))


def _ply_places(content: bytes, elements: Mapping[str, dict[str, Any]]) -> Callable[[int], str]:
    """Return a function from a face's number to its line in a text file, or else its number."""
    if b"\nformat ascii" not in content[:1000]:
        return lambda number: f"face {number}"
    before = content[: content.index(b"end_header")].count(b"\n") + 2
    for name, element in elements.items():
        if name == "face":
            break
        before += element["length"]
    return lambda number: f"line {before + number}"


def _ply_faces(mesh: dict[str, Any]) -> NDArray[Any] | None:
    """Return the faces as the file has them: an array of rows, or of arrays of several sizes."""
    data = mesh["metadata"]["_ply_raw"].get("face", {}).get("data")
    lists = [data[name] for name in PLY_FACES if name in data] if isinstance(data, dict) else []
    return lists[0] if lists and lists[0].dtype == object else mesh.get("faces")


def _check_rows(name: str, element: dict[str, Any]) -> None:
    """Raise unless an element of a PLY file has all its rows, and lists of one size if binary."""
    data = element.get("data", ())
    rows = len(next(iter(data.values()), ()) if isinstance(data, dict) else data)
    if rows != element["length"]:
        raise SceneError(f"it ends after {rows} of {element['length']} rows of its {name} list")
    if isinstance(data, np.ndarray):
        columns = [data[column] for column in data.dtype.names or ()]
        sizes = [column["f0"] for column in columns if column.dtype.names]
        if any((size != size[:1]).any() for size in sizes):
            raise SceneError(SAME_SIZE)


def _read_obj(content: bytes, path: Path) -> MeshArrays:
    from trimesh.exchange.obj import load_obj
    from trimesh.geometry import triangulate_quads

    geometry = _obj_geometry(content.decode("utf-8-sig", errors="replace"), path)
    scene = _call_trimesh("OBJ file", load_obj, geometry.encode(), group_material=False)
    mesh: dict[str, Any] = next(iter(scene.get("geometry", {}).values()), {})
    if "//" in geometry and "vertex_normals" not in mesh:
        raise SceneError("a face has the index of a normal that does not exist")
    if "faces" not in mesh:
        raise SceneError(NO_FACES)
    return MeshArrays(
        mesh["vertices"], triangulate_quads(mesh["faces"]), mesh.get("vertex_normals")
    )


def _call_trimesh(
    kind: str, load: Callable[..., dict[str, Any]], content: bytes, **options: bool
) -> dict[str, Any]:
    """Return what one of the loaders of trimesh reads; they let any error of theirs through."""
    try:
        with warnings.catch_warnings(), _strict_numbers():
            warnings.simplefilter("error", DeprecationWarning)  # all that NumPy < 2.3 says of "x"
            return load(io.BytesIO(content), skip_materials=True, **options)
    except Exception as error:
        raise SceneError(f"this is no readable {kind}: {error}") from None


def _strict_numbers() -> np.errstate:
    """Numbers that an array's type cannot hold are errors."""
    return np.errstate(invalid="raise", over="raise")


def _whole(indices: NDArray[Any]) -> NDArray[np.int64]:
    """Indices as whole numbers, which a file may give as floating-point ones."""
    try:
        with _strict_numbers():
            return indices.astype(np.int64)
    except FloatingPointError:
        raise SceneError("a vertex index of a face is no whole number") from None


def _obj_geometry(text: str, path: Path) -> str:
    """Return the lines of an OBJ file that hold vertices, normals and faces, for trimesh.

    Relative indices become absolute. What trimesh would leave out or read wrong without an error is
    refused: unknown keywords, index 0, and normals at some corners only. Polygons whose fan is
    wrong become triangles.
    """
    lines: list[str] = []
    polygons: dict[int, int] = {}  # from indices of lines to their numbers in the file
    counts = {"v": 0, "vn": 0}
    for number, line in _obj_lines(text):
        field = f"line {number}"
        keyword, *words = line.partition("#")[0].split() or [""]
        if keyword in counts:
            counts[keyword] += 1
        elif keyword == "f":
            if len(words) < 3:
                raise checks.refuse(field, line.strip(), "three vertices or more")
            if len(words) > 3:
                polygons[len(lines)] = number
            words = [_obj_corner(field, corner, counts) for corner in words]
        elif not keyword or keyword in OBJ_IGNORED:
            continue
        else:
            raise checks.refuse(field, keyword, f"one of v, vn, f, {', '.join(OBJ_IGNORED)}")
        lines.append(" ".join((keyword, *words)))
    faces = [line for line in lines if line.startswith("f")]
    if len({"//" in corner for face in faces for corner in face.split()[1:]}) > 1:
        raise SceneError("only some of its faces have normals; all must have them, or none")
    if polygons:
        _cut_polygons(lines, polygons, path)
    return "\n".join(lines)


def _cut_polygons(lines: list[str], polygons: Mapping[int, int], path: Path) -> None:
    """Replace polygons with a wrong fan by triangles; ``polygons`` maps indices to line numbers."""
    places = [line for line in lines if line.startswith("v ")]
    if not places:
        raise SceneError("it has no vertices")
    try:
        vertices = np.loadtxt(places, usecols=(1, 2, 3), ndmin=2, comments=None)
    except ValueError as error:
        raise SceneError(f"this is no readable OBJ file: {error}") from None
    faces = [lines[index].split()[1:] for index in polygons]
    sizes = np.array([len(face) for face in faces])
    corners = [corner for face in faces for corner in face]
    indices = np.array([int(corner.partition("/")[0]) for corner in corners]) - 1
    numbers = list(polygons.values())
    if indices.max() >= len(vertices):
        bad = int(np.argmax(indices >= len(vertices)))
        number = numbers[int(np.searchsorted(np.cumsum(sizes), bad, side="right"))]
        raise checks.refuse(f"line {number}", corners[bad], f"one of {len(vertices)} vertices")
    cut = triangulate(vertices[indices], sizes)
    warn_of_flaws(path, {f"line {numbers[face]}": flaw for face, flaw in cut.flaws.items()})
    starts = np.searchsorted(cut.owners, np.arange(len(sizes) + 1))
    for face, index in enumerate(polygons):
        if not cut.fanned[face]:
            triangles = cut.corners[starts[face] : starts[face + 1]].tolist()
            lines[index] = "\n".join(f"f {' '.join(corners[i] for i in t)}" for t in triangles)


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


def _triangles(
    vertices: NDArray[Any], faces: NDArray[Any], path: Path, place: Callable[[int], str]
) -> NDArray[np.int64]:
    """Return faces as triangles: first those of triangles, then of quads, then of others."""
    if faces.ndim == 2 and faces.shape[1] == 3:
        return _whole(faces)
    lengths = np.array([len(face) for face in faces] if faces.ndim == 1 else faces.shape[1:])
    numbers = np.flatnonzero(np.broadcast_to(lengths, len(faces)) > 2)
    if not len(numbers):
        raise SceneError(NO_FACES)
    sizes = np.broadcast_to(lengths, len(faces))[numbers]
    chosen = faces[numbers]
    indices = _whole(np.concatenate(chosen) if faces.ndim == 1 else chosen.ravel())
    outside = (indices < 0) | (indices >= len(vertices))
    if outside.any():
        bad = int(np.argmax(outside))
        words = f"a vertex index from 0 to {len(vertices) - 1}"
        raise checks.refuse(place(np.repeat(numbers, sizes)[bad]), int(indices[bad]), words)
    cut = triangulate(vertices[indices], sizes)
    warn_of_flaws(path, {place(numbers[face]): flaw for face, flaw in cut.flaws.items()})
    size = sizes[cut.owners]
    second = np.append(False, cut.owners[1:] == cut.owners[:-1])
    rank = np.select([size == 3, size == 4], [0, 1 + second], 3)
    return indices[cut.corners[np.argsort(rank, kind="stable")]]
