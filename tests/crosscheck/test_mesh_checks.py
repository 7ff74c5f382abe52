from __future__ import annotations

import os
import struct
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from drpt import Mesh, SceneError
from drpt.crosscheck.parse import from_mitsuba

if TYPE_CHECKING:
    from pathlib import Path

VERTICES = [(2, 0, 0), (2, 1, 0), (1, 1, 0), (1, 2, 0), (0, 2, 0), (0, 0, 0)]
V = "".join(f"v {x} {y} {z}\n" for x, y, z in VERTICES)
VT = "vt 0 0\n" * 6
GREY = {"type": "twosided", "bsdf": {"type": "diffuse"}}
BINARY = b"".join(struct.pack("<3f", *v) for v in VERTICES)
ROWS = "".join(f"{x} {y} {z}\n" for x, y, z in VERTICES)


def ply(form: str, vertices: int = 6, faces: int = 1, index: str = "int") -> bytes:
    return (
        f"ply\nformat {form} 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\n"
        f"property float z\nelement face {faces}\nproperty list uchar {index} vertex_indices\n"
        "end_header\n"
    ).encode()


def load(tmp_path: Path, name: str, content: str | bytes, **options: Any) -> Mesh:
    path = tmp_path / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    shape = {"type": path.suffix[1:], "filename": str(path), "bsdf": GREY, **options}
    (mesh,) = from_mitsuba({"type": "scene", "s": {"type": "perspective"}, "a": shape}).shapes
    assert isinstance(mesh, Mesh)
    return mesh


@pytest.mark.parametrize("corner", ["{}", "{}/{}", "{}//{}", "{}/{}/{}"])
@pytest.mark.parametrize("first", range(6))
@pytest.mark.parametrize("side", [1, -1])
def test_concave_polygons(mi: Any, tmp_path: Path, side: int, first: int, corner: str) -> None:
    order = np.roll(np.arange(1, 7), first)[::side]
    smooth = corner in ("{}//{}", "{}/{}/{}")
    normals = "".join(f"vn 0.{i} 0 {side}\n" for i in range(6)) if smooth else ""
    face = " ".join(corner.format(i, i, i) for i in order)
    mesh = load(tmp_path, "a.obj", f"{V}{normals}{VT}f {face}\n")
    a, b, c = mesh.vertices[mesh.faces].swapaxes(0, 1)
    areas = np.cross(b - a, c - a)[:, 2] / 2
    assert len(areas) == 4
    assert (side * areas > 0).all()
    assert areas.sum() == side * 3
    assert (mesh.normals is not None) == smooth
    if mesh.normals is not None:
        tilt = np.round(10 * mesh.normals[:, 0] / np.abs(mesh.normals[:, 2])).astype(int)
        assert [VERTICES[i] for i in tilt] == [tuple(v) for v in mesh.vertices.astype(int).tolist()]
    assert sorted(os.listdir(tmp_path)) == ["a.obj"]


def test_transforms_and_flips_are_as_without_a_polygon(mi: Any, tmp_path: Path) -> None:
    to_world = mi.ScalarTransform4f().scale([-1, 2, 3]).translate([1, 2, 3])
    for flip in (False, True):
        options = {"to_world": to_world, "flip_normals": flip, "face_normals": True}
        whole = load(tmp_path, "a.obj", f"{V}f 1 2 3 4 5 6", **options)
        parts = load(tmp_path, "b.obj", f"{V}f 6 1 2\nf 6 2 3\nf 6 3 4\nf 6 4 5", **options)
        a, b, c = whole.vertices[whole.faces].swapaxes(0, 1)
        d, e, f = parts.vertices[parts.faces].swapaxes(0, 1)
        area, other = np.cross(b - a, c - a).sum(0), np.cross(e - d, f - d).sum(0)
        np.testing.assert_allclose(area, other)


def test_polygons_of_many_corners(tmp_path: Path) -> None:
    angle = 2 * np.pi * np.arange(1000) / 1000
    v = "".join(f"v {np.cos(a)} {np.sin(a)} 0\n" for a in angle)
    mesh = load(tmp_path, "a.obj", f"{v}f {' '.join(map(str, range(1, 1001)))}\n")
    np.testing.assert_allclose(mesh.areas().sum(), 500 * np.sin(2 * np.pi / 1000), rtol=1e-5)


def test_polygons_that_intersect_themselves_are_named(tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match=r"a\.obj: line 8: this polygon intersects itself$"):
        load(tmp_path, "a.obj", f"{V}f 1 2 3\nf 1 2 6 3\nf 1 2 3\n")


BAD = {
    "index": (ply("binary_little_endian") + BINARY + struct.pack("<B3i", 3, 0, 1, 6), "face 0: 6"),
    "far": (ply("binary_little_endian") + BINARY + struct.pack("<B3i", 3, 0, 1, 2**31 - 1), "2147"),
    "negative": (ply("binary_little_endian") + BINARY + struct.pack("<B3i", 3, 0, 1, -1), "0: -1"),
    "big end": (
        ply("binary_big_endian", faces=2)
        + np.array(VERTICES, ">f4").tobytes()
        + struct.pack(">B3iB3i", 3, 0, 1, 2, 3, 0, 1, 9),
        "face 1: 9 is not allowed; it must be a vertex index from 0 to 5",
    ),
    "text": (ply("ascii", faces=2) + f"{ROWS}3 0 1 2\n3 0 1 2000000000\n".encode(), "face 1: 2000"),
    "words": (ply("ascii") + f"{ROWS}3 0 x 2\n".encode(), "something else than numbers"),
    "vertices": (ply("binary_little_endian", 4 * 10**9) + BINARY, "48 GB at least"),
    "faces": (ply("ascii", faces=4 * 10**9) + f"{ROWS}3 0 1 2\n".encode(), "32 GB at least"),
    "missing": (ply("ascii", faces=2) + f"{ROWS}3 0 1 2 {' ' * 99}\n".encode(), "are 22"),
    "count": (ply("ascii", -1) + ROWS.encode(), "a wrong line, 'element vertex -1'"),
    "type": (ply("ascii", index="x") + ROWS.encode(), "'property list uchar x vertex_indices'"),
    "no properties": (
        ply("binary_little_endian", faces=2**63).replace(b"uchar int", b"uchar") + BINARY,
        "a wrong line, 'property list uchar vertex_indices'",
    ),
    "no columns": (
        ply("ascii", faces=2**63).replace(b"property list uchar int vertex_indices\n", b""),
        "an element without properties",
    ),
    "twice": (ply("ascii").replace(b"face 1", b"vertex 1") + ROWS.encode(), "same element twice"),
    "no faces": (ply("ascii", faces=0) + ROWS.encode(), "it has no faces"),
    "no end": (b"ply\nformat ascii 1.0\n" + b" " * 10**6, "no PLY header that ends within"),
    "empty": (b"", "it is empty"),
}


@pytest.mark.parametrize("name", BAD)
@pytest.mark.parametrize("flat", [False, True])
def test_bad_ply_files(mi: Any, tmp_path: Path, name: str, flat: bool) -> None:
    content, problem = BAD[name]
    with pytest.raises(SceneError) as caught:
        load(tmp_path, "bad.ply", content, face_normals=flat)
    message = str(caught.value)
    assert message.startswith(f'a: <shape type="ply">: {tmp_path / "bad.ply"}: ')
    assert problem in message


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (f"{V}f 1 2 7\n", "reference to invalid vertex 7"),
        (f"{V}f 1 2 3 7\n", "reference to invalid vertex 7"),
        (f"{V}f 1 2 -1\n", "line 7: '-1' is not allowed; it must be an index from 1 on"),
        (f"{V}vn 0 0 1\nf 1//1 2//1 3//1\nf 1 2 3\n", "line 9: this face has no normals"),
        (f"{V}vn 0 0 1\nf 1//0 2//0 3//0\n", "line 8: this face has no normals"),
        (f"{V}vn 0 0 1\nf 1 2 3\n", "line 8: this face has no normals"),
        (f"{V}f 1 2\n", "it has no faces"),
        (V, "it has no faces"),
        ("", "it has no faces"),
        (f"{V}v x 0 0\nf 1 2 3 4\n", 'could not parse line "v x 0 0"'),
    ],
)
def test_bad_obj_files(mi: Any, tmp_path: Path, content: str, problem: str) -> None:
    with pytest.raises(SceneError) as caught:
        load(tmp_path, "bad.obj", content)
    assert str(caught.value).startswith('a: <shape type="obj">: ')
    assert "bad.obj" in str(caught.value)
    assert problem in str(caught.value)


@pytest.mark.parametrize("kind", ["obj", "ply"])
def test_pipes_and_folders_are_refused(mi: Any, tmp_path: Path, kind: str) -> None:
    os.mkfifo(tmp_path / f"pipe.{kind}")
    (tmp_path / f"folder.{kind}").mkdir()
    for name, problem in (("pipe", "a pipe or a device"), ("folder", "this is a folder")):
        shape = {"type": kind, "filename": str(tmp_path / f"{name}.{kind}")}
        with pytest.raises(SceneError, match=problem):
            from_mitsuba({"type": "scene", "s": {"type": "perspective"}, "a": shape})
