"""Reading mesh files: OBJ and PLY through trimesh, NPZ through NumPy.

Vertices, faces and normals are taken as the file gives them: nothing is merged, made up or
repaired; polygons become triangles.
"""

from __future__ import annotations

import io
import re
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple
from zipfile import BadZipFile, is_zipfile

import numpy as np

from drpt.scene import checks
from drpt.scene.checks import SceneError

if TYPE_CHECKING:
    from collections.abc import Callable
    from os import PathLike

    from numpy.typing import NDArray

OBJ_CORNER = re.compile(r"0*[1-9]\d*(/(\d*|\d*/0*[1-9]\d*))?")
"""A corner of a face: v, v/vt, v//vn or v/vt/vn, where v and vn count from 1."""


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
    path = Path(path)
    try:
        read = {".obj": _read_obj, ".ply": _read_ply, ".npz": _read_npz}.get(path.suffix.lower())
        if read is None:
            raise SceneError("this is not a mesh file; it must end in .obj, .ply or .npz")
        return read(_read_bytes(path))
    except SceneError as error:
        raise error.in_file(str(path)) from None


def _read_bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise SceneError("there is no such file") from None
    except OSError as error:
        raise SceneError(f"it cannot be read: {error.strerror}") from None
    except ValueError as error:  # a null character in the path
        raise SceneError(f"it cannot be read: {error}") from None


def _read_npz(content: bytes) -> MeshArrays:
    if not is_zipfile(io.BytesIO(content)):
        raise SceneError("it is not an NPZ file")
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
            return MeshArrays(arrays["v"], arrays["f"], arrays.get("vn"))
    except KeyError:
        raise SceneError("it must hold the arrays 'v' and 'f', and may hold 'vn'") from None
    except (ValueError, EOFError, OSError, BadZipFile) as error:
        raise SceneError(f"it is not an NPZ file of plain arrays: {error}") from None


def _read_ply(content: bytes) -> MeshArrays:
    from trimesh.exchange.ply import load_ply

    mesh = _call_trimesh("PLY", load_ply, content, fix_texture=False)
    for name, element in mesh["metadata"]["_ply_raw"].items():
        data = element.get("data", ())
        rows = len(next(iter(data.values())) if isinstance(data, dict) else data)
        if rows != element["length"]:
            raise SceneError(f"it ends after {rows} of {element['length']} rows of its {name} list")
    return _triangles(mesh)


def _read_obj(content: bytes) -> MeshArrays:
    from trimesh.exchange.obj import load_obj

    geometry = _obj_geometry(content.decode("utf-8", errors="replace"))
    scene = _call_trimesh("OBJ", load_obj, geometry.encode(), group_material=False)
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
        raise SceneError(f"this is no readable {kind} file: {error}") from None


def _obj_geometry(text: str) -> str:
    """Return the lines of an OBJ file that hold vertices, normals and faces, for trimesh.

    What trimesh would read wrong without an error is refused: relative indices, index 0, and
    normals at some corners only.
    """
    lines = []
    for line in text.replace("\\\r\n", " ").replace("\\\n", " ").splitlines():
        keyword, *words = line.partition("#")[0].split() or [""]
        if keyword in {"v", "vn"}:
            lines.append(" ".join((keyword, *words)))
        elif keyword == "f":
            if len(words) < 3:
                raise checks.refuse("f", line.strip(), "three vertices or more")
            lines.append(" ".join((keyword, *map(_obj_corner, words))))
    faces = [line for line in lines if line.startswith("f")]
    if len({"//" in corner for face in faces for corner in face.split()[1:]}) > 1:
        raise SceneError("only some of its faces have normals; all must have them, or none")
    return "\n".join(lines)


def _obj_corner(corner: str) -> str:
    """Return the corner of a face without its texture coordinates."""
    if not OBJ_CORNER.fullmatch(corner):
        raise checks.refuse("f", corner, "v, v/vt, v//vn or v/vt/vn, with indices from 1 on")
    vertex, _, normal = (*corner.split("/"), "", "")[:3]
    return f"{vertex}//{normal}" if normal else vertex


def _triangles(mesh: dict[str, Any]) -> MeshArrays:
    """Return the arrays of what trimesh read, its quads split into triangles."""
    from trimesh.geometry import triangulate_quads

    faces = mesh.get("faces")
    if faces is None or len(faces) == 0:
        raise SceneError("it has no faces")
    return MeshArrays(mesh["vertices"], triangulate_quads(faces), mesh.get("vertex_normals"))
