"""Checks mesh files before Mitsuba's loaders read them.

The loaders trust the counts and indices of a PLY file, cut every polygon of an OBJ file into a fan,
and leave normals uninitialised where an OBJ file has none.
"""

from __future__ import annotations

import mmap
import re
import tempfile
import warnings
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from drpt.files import open_regular
from drpt.messages import size_in_words
from drpt.scene import SceneError
from drpt.scene.checks import refuse
from drpt.scene.meshes import MAX_BYTES, NO_FACES, PLY_FACES
from drpt.scene.polygons import triangulate, warn_of_flaws
from drpt.scene.reading import read_file

if TYPE_CHECKING:
    from collections.abc import Iterator

MAX_HEADER = 2**16
"""Largest header of a PLY file, in bytes."""
ROWS = 2**20
"""Number of faces whose indices are in memory at once."""
MAX_LINE = 1000
"""Longest line of an OBJ file in bytes; Mitsuba refuses slightly longer ones."""
_SIZES = {"char": "i1", "short": "i2", "int": "i4", "long": "i8", "float": "f4", "double": "f8"}
PLY_TYPES = {
    **_SIZES,
    **{f"u{name}": f"u{code[1]}" for name, code in _SIZES.items() if code[0] == "i"},
    **{f"int{8 * n}": f"i{n}" for n in (1, 2, 4, 8)},
    **{f"uint{8 * n}": f"u{n}" for n in (1, 2, 4, 8)},
    **{"half": "f2", "float16": "f2", "float32": "f4", "float64": "f8"},
}
_OBJ_FACE = re.compile(rb"^[ \t\r]*f[ \t]([^\n]*)", re.MULTILINE)
_OBJ_TRIANGLE, _OBJ_SMOOTH = (
    re.compile(rb"^[ \t\r]*f(?:[ \t]++" + corner + rb"){3}[ \t\r]*$", re.MULTILINE)
    for corner in (rb"[0-9]++(?:/[0-9]*+){0,2}", rb"[0-9]++/[0-9]*+/0*+[1-9][0-9]*+")
)
"""Faces that are triangles, and of these the ones with normals."""
_OBJ_VERTEX = re.compile(rb"^[ \t\r]*v[ \t]([^\n]*)", re.MULTILINE)
_OBJ_NORMAL = re.compile(rb"^[ \t\r]*vn[ \t]", re.MULTILINE)
_CORNER = re.compile(rb"[0-9]+(/[0-9]*(/[0-9]*)?)?")


class _Element(NamedTuple):
    """An element of a PLY file as Mitsuba reads it, where each list property has three items."""

    name: str
    length: int
    row: np.dtype[Any]


@contextmanager
def checked_mesh(kind: str, path: Path, *, flat: bool) -> Iterator[Path]:
    """Yield a file that Mitsuba can load: an OBJ or PLY file, or a corrected copy.

    Raises `SceneError` for a file that it cannot load. A missing file is left to Mitsuba.
    """
    if not path.exists():
        yield path
        return
    try:
        if kind == "ply":
            _check_ply(path)
            changed = None
        else:
            changed = _checked_obj(read_file(path, MAX_BYTES), path, flat=flat)
    except SceneError as error:
        raise SceneError(str(error.in_file(str(path)))) from None  # the element is named, too
    if changed is None:
        yield path
        return
    with tempfile.TemporaryDirectory(prefix="drpt-") as folder:
        copy = Path(folder, path.name)
        copy.write_bytes(changed)
        yield copy


def _check_ply(path: Path) -> None:
    """Raise `SceneError` unless the size fits the header, and faces have existing vertices."""
    try:
        with open_regular(path) as stream:
            content = mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ)
    except OSError as error:
        raise SceneError(f"it cannot be read: {error.strerror}") from None
    except ValueError:
        raise SceneError("it is empty") from None
    header = re.split(rb"end_header[ \t\r]*\n", content[:MAX_HEADER], maxsplit=1)
    if len(header) < 2:
        raise SceneError(f"it has no PLY header that ends within {size_in_words(MAX_HEADER)}")
    start = min(len(content), MAX_HEADER) - len(header[1])
    lines = [line.split() for line in header[0].decode(errors="replace").split("\n")]
    form = next((line[1] for line in lines if line[:1] == ["format"] and len(line) > 1), "")
    elements = _ply_elements(lines, ">" if form == "binary_big_endian" else "<")
    counts = {element.name: element.length for element in elements}
    if len(counts) < len(elements):
        raise SceneError("its header has the same element twice")
    if not counts.get("vertex") or not counts.get("face"):
        raise SceneError(NO_FACES)
    read = _ascii_indices if form == "ascii" else _binary_indices
    for first, indices in read(content, start, elements):
        outside = ~((indices >= 0) & (indices < counts["vertex"]))
        if outside.any():
            row, column = np.argwhere(outside)[0].tolist()
            words = f"a vertex index from 0 to {counts['vertex'] - 1}"
            index = indices[row, column].item()
            shown = int(index) if float(index).is_integer() else index
            raise refuse(f"face {first + row}", shown, words)


def _ply_elements(lines: list[list[str]], order: str) -> list[_Element]:
    elements: list[_Element] = []
    for words in lines:
        try:
            match words:
                case ["element", name, count]:
                    if int(count) < 0:
                        raise ValueError
                    elements.append(_Element(name, int(count), np.dtype([])))
                case ["property", "list", size, item, name]:
                    list_of = [("", order + PLY_TYPES[size]), (name, order + PLY_TYPES[item], 3)]
                    elements[-1] = _extended(elements[-1], list_of)
                case ["property", kind, _]:
                    elements[-1] = _extended(elements[-1], [("", order + PLY_TYPES[kind])])
                case ["element" | "property", *_]:
                    raise ValueError
        except (KeyError, ValueError, IndexError):
            raise SceneError(f"its header has a wrong line, {' '.join(words)!r}") from None
    if any(element.length and not element.row.names for element in elements):
        raise SceneError("its header has an element without properties")
    return elements


def _extended(element: _Element, columns: list[Any]) -> _Element:
    """Return an element with more columns; only columns of faces keep their names."""
    old = element.row.descr if element.row.names else []
    new = [
        (name if name in PLY_FACES else f"column {len(old) + i}", *kind)
        for i, (name, *kind) in enumerate(columns)
    ]
    return element._replace(row=np.dtype([*old, *new]))


def _binary_indices(
    content: mmap.mmap, start: int, elements: list[_Element]
) -> Iterator[tuple[int, Any]]:
    """Yield the number of a face, and the indices (n, 3) of some faces from it on."""
    needed = sum(element.length * element.row.itemsize for element in elements)
    _check_size(needed, len(content) - start)
    for name, count, row in elements:
        for first in range(0, count if name == "face" else 0, ROWS):
            rows = min(ROWS, count - first)
            table = np.frombuffer(content, row, rows, start + first * row.itemsize)
            for column in set(PLY_FACES).intersection(row.names or ()):
                yield first, np.array(table[column]).reshape(rows, -1)
        start += count * row.itemsize


def _ascii_indices(
    content: mmap.mmap, start: int, elements: list[_Element]
) -> Iterator[tuple[int, Any]]:
    """Yield 0 and the indices (n, 3) of all faces."""
    widths = [_numbers(row, len(row.names or ())) for *_, row in elements]
    numbers = sum(e.length * width for e, width in zip(elements, widths, strict=True))
    _check_size(2 * numbers - 1, len(content) - start)
    try:
        with warnings.catch_warnings(action="error", category=DeprecationWarning):
            values = np.fromstring(content[start:], sep=" ")
    except (DeprecationWarning, ValueError):
        raise SceneError("it holds something else than numbers after its header") from None
    if len(values) < numbers:
        raise SceneError(f"its header asks for {numbers} numbers, and there are {len(values)}")
    at = 0
    for (name, count, row), width in zip(elements, widths, strict=True):
        table = values[at : at + count * width].reshape(count, width)
        at += count * width
        for column in set(PLY_FACES).intersection(row.names or () if name == "face" else ()):
            skipped = _numbers(row, (row.names or ()).index(column))
            yield 0, table[:, skipped : skipped + 3]


def _numbers(row: np.dtype[Any], columns: int) -> int:
    """Return the count of numbers in the first columns of a row."""
    return sum(int(np.prod(row[i].shape)) for i in range(columns))


def _check_size(needed: int, there: int) -> None:
    if needed > there:
        words = f"{size_in_words(needed)} at least, and {size_in_words(max(there, 0))} are there"
        raise SceneError(f"its header asks for {words}")


def _checked_obj(content: bytes, path: Path, *, flat: bool) -> bytes | None:
    """Return the content with triangles for polygons whose fan is wrong; None if no fan is."""
    smooth = not flat and bool(_OBJ_NORMAL.search(content))
    plain = len((_OBJ_SMOOTH if smooth else _OBJ_TRIANGLE).findall(content))
    if plain and plain == len(_OBJ_FACE.findall(content)):
        return None
    faces = list(_OBJ_FACE.finditer(content))
    corners = []
    for face in faces:
        try:
            corners.append(_corners(face[1], smooth=smooth))
        except SceneError as error:
            raise error.within(f"line {_line(content, face)}") from None
    if max(map(len, corners), default=0) < 3:
        raise SceneError(NO_FACES)
    polygons = [i for i, found in enumerate(corners) if len(found) > 3]
    return _cut(content, path, [faces[i] for i in polygons], [corners[i] for i in polygons])


def _line(content: bytes, match: re.Match[bytes]) -> int:
    return content.count(b"\n", 0, match.start()) + 1


def _corners(words: bytes, *, smooth: bool) -> list[bytes]:
    """Return the corners of a face up to the first other word; smooth meshes need normals."""
    found = []
    for word in words.split():
        if word.startswith(b"-"):
            raise refuse("", word.decode(errors="replace"), "an index from 1 on, for Mitsuba")
        if not _CORNER.fullmatch(word):
            break
        if smooth and not any(part.strip(b"0") for part in word.split(b"/")[2:]):
            raise SceneError("this face has no normals, but the file has some, for Mitsuba")
        found.append(word)
    return found


def _cut(
    content: bytes, path: Path, faces: list[re.Match[bytes]], corners: list[list[bytes]]
) -> bytes | None:
    """Return the content with triangles for polygons whose fan is wrong or whose line is long."""
    if not faces:
        return None
    words = [match[1].decode(errors="replace") for match in _OBJ_VERTEX.finditer(content)]
    flat = [corner for found in corners for corner in found]
    indices = np.array([int(corner.partition(b"/")[0][:18]) for corner in flat]) - 1
    try:
        vertices = np.loadtxt(words, usecols=(0, 1, 2), ndmin=2) if words else np.zeros((0, 3))
    except ValueError:
        return None  # Mitsuba names the line
    if indices.min() < 0 or indices.max() >= len(vertices):
        return None
    cut = triangulate(vertices[indices], np.array([len(found) for found in corners]))
    named = {f"line {_line(content, faces[i])}": flaw for i, flaw in cut.flaws.items()}
    warn_of_flaws(path, named)
    long = np.array([len(face[0]) > MAX_LINE for face in faces])
    starts = np.searchsorted(cut.owners, np.arange(len(faces) + 1))
    parts, at = [], 0
    for i in np.flatnonzero(~cut.fanned | long).tolist():
        triangles = cut.corners[starts[i] : starts[i + 1]].tolist()
        parts += [content[at : faces[i].start()]]
        parts += [b"\n".join(b"f " + b" ".join(flat[c] for c in t) for t in triangles)]
        at = faces[i].end()
    return b"".join([*parts, content[at:]]) if parts else None
