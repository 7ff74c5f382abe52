import io
import struct
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import numpy as np
import pytest

from drpt.scene import Diffuse, Mesh, SceneError
from drpt.scene.meshes import MeshArrays, load_mesh

VERTICES: list[list[float]] = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [2, 2, 1]]
PENTAGON = "v 0 0 0\nv 2 0 0\nv 3 1 0\nv 2 2 0\nv 0 2 0\n"
V = "".join(f"v {x} {y} {z}\n" for x, y, z in VERTICES)
VN = "vn 0 0 1\nvn 0 1 0\n"
NORMALS = [[0, 0, 1], [0, 1, 0]]
PLY = """ply
format {format} 1.0
element vertex {vertices}
property float x
property float y
property float z
{more}element face {faces}
property list uchar int vertex_indices
end_header
"""
ROWS = "".join(f"{x} {y} {z}\n" for x, y, z in VERTICES)


def ply(faces: int, *, vertices: int = 5, encoding: str = "ascii", more: str = "") -> str:
    return PLY.format(format=encoding, vertices=vertices, faces=faces, more=more)


def load(tmp_path: Path, name: str, content: str | bytes) -> MeshArrays:
    path = tmp_path / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return load_mesh(path)


def corners(mesh: MeshArrays) -> list[list[list[float]]]:
    """Return the positions of each triangle's vertices, independent of their numbers."""
    triangles: list[list[list[float]]] = mesh.vertices[mesh.faces].tolist()
    return triangles


def positions(*faces: list[int]) -> list[list[list[float]]]:
    return [[VERTICES[i] for i in face] for face in faces]


@pytest.mark.parametrize(
    ("faces", "expected"),
    [
        ("f 1 2 3", [[0, 1, 2]]),
        ("f 1/1 2/2 3/1", [[0, 1, 2]]),
        ("f 1 2 3 # comment", [[0, 1, 2]]),
        ("f -5 -4/-1 -3/1", [[0, 1, 2]]),
        ("f -5 2 -3\nv 9 9 9\nf -6 -5 -4", [[0, 1, 2], [0, 1, 2]]),
        ("p 1\nl 1 2\ns off\n# x\nf 1 2 3", [[0, 1, 2]]),
        ("f 1 2 \\\n 3", [[0, 1, 2]]),
        ("\tf  1\t2 3", [[0, 1, 2]]),
        ("f 1 2 4 3", [[0, 1, 3], [3, 2, 0]]),
        ("f 1 2 4 3\nf 1 2 5", [[0, 1, 3], [3, 2, 0], [0, 1, 4]]),
        ("mtllib no.mtl\nusemtl a\nf 1 2 3\no x\nusemtl b\ng y\nf 3 2 4", [[0, 1, 2], [2, 1, 3]]),
    ],
)
def test_obj(tmp_path: Path, faces: str, expected: list[list[int]]) -> None:
    mesh = load(tmp_path, "a.obj", f"{V}vt 0 0\nvt 1 1\n{faces}")
    assert sorted(corners(mesh)) == sorted(positions(*expected))
    assert mesh.normals is None


def test_obj_in_windows(tmp_path: Path) -> None:
    mesh = load(tmp_path, "A.OBJ", f"{V}f 1 2 \\\n3".replace("\n", "\r\n"))
    assert corners(mesh) == positions([0, 1, 2])


def test_obj_with_a_byte_order_mark(tmp_path: Path) -> None:
    mesh = load(tmp_path, "a.obj", f"\ufeff{V}f 1 2 3")
    assert corners(mesh) == positions([0, 1, 2])


@pytest.mark.parametrize(
    "faces",
    [
        "f 1//1 2//1 3//2\nf 1//2 3//1 2//2",
        "f 1/1/1 2/2/1 3/1/2\nf 1//2 3/1/1 2//2",
        "f 1//-2 2//1 -3/-1/-1\nf -5//-1 3//1 2//2",
    ],
)
def test_obj_normals_belong_to_corners(tmp_path: Path, faces: str) -> None:
    mesh = load(tmp_path, "a.obj", V + VN + faces)
    first, second = NORMALS
    assert corners(mesh) == positions([0, 1, 2], [0, 2, 1])
    assert mesh.normals is not None
    assert mesh.normals[mesh.faces].tolist() == [[first, first, second], [second, first, second]]


def test_obj_polygons(tmp_path: Path) -> None:
    mesh = load(tmp_path, "a.obj", f"{PENTAGON}f 1 2 3 4 5")
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 4]]


def test_obj_polygons_with_normals(tmp_path: Path) -> None:
    mesh = load(tmp_path, "a.obj", PENTAGON + VN + "f 1//1 2//1 3//2 4//2 5//1")
    first, second = NORMALS
    assert mesh.normals is not None
    assert mesh.normals[mesh.faces[:, 1]].tolist() == [first, second, second]


def test_decimals_are_read_as_float64(tmp_path: Path) -> None:
    mesh = load(tmp_path, "a.obj", "v 0.1 0 0\nv 1 0.12345678901234567 0\nv 0 1 0\nf 1 2 3")
    assert mesh.vertices[1, 1] == 0.12345678901234567


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        (["3 0 1 2", "3 1 3 2"], [[0, 1, 2], [1, 3, 2]]),
        (["4 0 1 3 2"], [[0, 1, 3], [3, 2, 0]]),
        (["4 0 1 3 2", "3 0 1 4"], [[0, 1, 4], [0, 1, 3], [3, 2, 0]]),
        (
            ["4 0 1 3 2", "3 0 1 4", "4 0 1 3 2"],
            [[0, 1, 4], [0, 1, 3], [0, 1, 3], *[[3, 2, 0]] * 2],
        ),
    ],
)
def test_ascii_ply(tmp_path: Path, rows: list[str], expected: list[list[int]]) -> None:
    mesh = load(tmp_path, "a.ply", ply(len(rows)) + ROWS + "\n".join(rows))
    assert mesh.vertices.tolist() == VERTICES
    assert mesh.faces.tolist() == expected
    assert mesh.normals is None


@pytest.mark.parametrize(("order", "encoding"), [("<", "little"), (">", "big")])
@pytest.mark.parametrize("faces", [[[0, 1, 2], [1, 3, 2]], [[0, 1, 3, 2]]])
def test_binary_ply(tmp_path: Path, order: str, encoding: str, faces: list[list[int]]) -> None:
    head = ply(len(faces), encoding=f"binary_{encoding}_endian").encode()
    vertices = np.array(VERTICES, f"{order}f4").tobytes()
    rows = b"".join(struct.pack(f"{order}B{len(f)}i", len(f), *f) for f in faces)
    mesh = load(tmp_path, "a.ply", head + vertices + rows)
    assert mesh.vertices.tolist() == VERTICES
    assert mesh.faces.tolist() == (faces if len(faces) == 2 else [[0, 1, 3], [3, 2, 0]])


def test_ply_normals(tmp_path: Path) -> None:
    more = "property float nx\nproperty float ny\nproperty float nz\nproperty float u\n"
    more += "property float v\n"
    rows = "0 0 0 0 0 1 0 0\n1 0 0 0 0 1 0 1\n0 1 0 0 2 0 1 1\n3 0 1 2\n"
    mesh = load(tmp_path, "a.ply", ply(1, vertices=3, more=more) + rows)
    assert mesh.normals is not None
    assert mesh.normals.tolist() == [[0, 0, 1], [0, 0, 1], [0, 2, 0]]


@pytest.mark.parametrize("normals", [None, np.eye(3)])
def test_npz(tmp_path: Path, normals: np.ndarray | None) -> None:
    arrays = {} if normals is None else {"vn": normals}
    np.savez(tmp_path / "a.npz", allow_pickle=False, v=np.eye(3) / 3, f=[[0, 1, 2]], **arrays)
    mesh = Mesh.load(tmp_path / "a.npz", material=Diffuse(0.5))
    assert mesh == Mesh(np.eye(3) / 3, [[0, 1, 2]], normals, Diffuse(0.5))


@pytest.mark.parametrize(
    ("name", "content", "expected"),
    [
        ("a.stl", "", "must end in .obj, .ply or .npz"),
        ("a.obj", "", "no faces"),
        ("a.obj", "\0\xff garbage", "line 1: '\\x00ÿ' is not allowed"),
        (
            "a.obj",
            f"{V}f 1 2 \\\n3\r\n\rcurv 0 1 2",
            "line 9: 'curv' is not allowed; it must be one",
        ),
        ("a.obj", V, "no faces"),
        ("a.obj", f"{V}f 1 2 6", "no readable OBJ file"),
        ("a.obj", "v 0 x 0\nv 1 0 0\nv 0 1 0\nf 1 2 3", "no readable OBJ file"),
        ("a.obj", f"{V}f 0 1 2", "'0' is not allowed"),
        ("a.obj", f"{V}f 1 2 -6", "'-6' is not allowed"),
        ("a.obj", f"{V}f 1 2 -0", "'-0' is not allowed"),
        ("a.obj", f"{V}{VN}f 1//1 2//1 3//-3", "line 8: '3//-3' is not allowed"),
        ("a.obj", f"{V}f 1 2 x", "line 6: 'x' is not allowed"),
        ("a.obj", f"{V}f 1 2", "three vertices or more"),
        ("a.obj", f"{V}{VN}f 1//1 2//1 3", "only some of its faces have normals"),
        ("a.obj", f"{V}{VN}f 1//1 2//1 3//1\nf 1 2 3", "only some of its faces have normals"),
        ("a.obj", f"{V}{VN}f 1//1 2//1 3//3", "the index of a normal that does not exist"),
        ("a.ply", "", "no readable PLY file"),
        ("a.ply", "garbage", "no readable PLY file"),
        ("a.ply", "ply\nformat ascii 1.0\n", "no readable PLY file"),
        ("a.ply", ply(0) + ROWS, "no faces"),
        ("a.ply", ply(2) + ROWS + "3 0 1 2\n", "after 1 of 2 rows of its face list"),
        ("a.ply", ply(2) + ROWS[:12], "after 2 of 5 rows of its vertex list"),
        ("a.ply", ply(1) + ROWS.replace("2 2 1", "2 x 1") + "3 0 1 2", "no readable PLY file"),
        ("a.ply", ply(1, encoding="binary_little_endian") + ROWS, "no readable PLY file"),
        ("a.ply", ply(1) + ROWS.replace("2 2 1", "2") + "5 0 1 2 3 4", "fewer numbers than others"),
        ("a.ply", ply(1) + ROWS + "3 0 1 1e300", "no readable PLY file"),
        (
            "a.ply",
            ply(1).replace("list uchar int", "list uchar float") + ROWS + "4 0 1 2 1e30",
            "no",
        ),
        ("a.ply", ply(4, vertices=0).replace("property list", "p list") + ROWS, "0 of 4 rows"),
        ("a.ply", ply(1).replace("uchar", "9" * 9999) + ROWS, "no readable PLY file"),
        ("a.npz", "", "not an NPZ file"),
        ("a.npz", "garbage", "not an NPZ file"),
    ],
)
def test_bad_files(tmp_path: Path, name: str, content: str, expected: str) -> None:
    with pytest.raises(SceneError) as caught:
        load(tmp_path, name, content)
    assert str(caught.value).startswith(f"{tmp_path / name}: ")
    assert expected in str(caught.value)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 1000


def test_bad_npz(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    np.savez(path, v=np.eye(3))
    with pytest.raises(SceneError, match="must hold the arrays 'v' and 'f'"):
        load_mesh(path)
    np.savez(path, v=np.array([None]), f=[[0, 1, 2]], allow_pickle=True)
    with pytest.raises(SceneError, match="not an NPZ file of plain arrays"):
        load_mesh(path)
    np.savez(path, v=np.eye(3), f=[[0, 1, 2]])
    whole = path.read_bytes()
    damaged = whole.replace(np.ones(1).tobytes(), np.zeros(1).tobytes(), 1)
    with pytest.raises(SceneError, match="Bad CRC-32"):
        load(tmp_path, "a.npz", damaged)
    with pytest.raises(SceneError, match="not an NPZ file"):
        load(tmp_path, "a.npz", whole[: len(whole) // 2])


def test_npz_that_claims_too_much(tmp_path: Path) -> None:
    header = io.BytesIO()
    shape = {"descr": "<f8", "fortran_order": False, "shape": (10**11, 3)}
    np.lib.format.write_array_header_1_0(header, shape)
    with ZipFile(tmp_path / "a.npz", "w") as file:
        file.writestr("v.npy", header.getvalue())
    with pytest.raises(SceneError, match=r"a\.npz: it is not an NPZ file of plain arrays"):
        load_mesh(tmp_path / "a.npz")


@pytest.mark.parametrize(
    "faces", [[[0, 1, 3, 2], [0, 1, 2]], [[0, 1, 3, 2], [0, 1, 2], [0, 1, 2, 3, 4]]]
)
def test_binary_ply_with_faces_of_several_sizes(tmp_path: Path, faces: list[list[int]]) -> None:
    rows = b"".join(struct.pack(f"<B{len(f)}i", len(f), *f) for f in faces)
    head = ply(len(faces), encoding="binary_little_endian").encode()
    with pytest.raises(SceneError, match="all faces must have the same number of vertices"):
        load(tmp_path, "a.ply", head + np.array(VERTICES, "<f4").tobytes() + rows)


@pytest.mark.parametrize("path", [None, 3, b"x.ply"])
def test_what_is_no_path(path: Any) -> None:
    with pytest.raises(SceneError, match="is not allowed; it must be the path of a mesh file"):
        Mesh.load(path, radiance=1)


def test_bad_paths(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="File name too long"):
        load_mesh("a" * 5000 + ".ply")
    with pytest.raises(SceneError, match="no such file"):
        load_mesh(tmp_path / "no.obj")
    (tmp_path / "folder.obj").mkdir()
    with pytest.raises(SceneError, match="this is a folder"):
        load_mesh(tmp_path / "folder.obj")


def test_lights_without_area_name_the_file(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", v=np.eye(3), f=[[0, 1, 1]])
    with pytest.raises(SceneError, match=r"a\.npz: faces: they have no area"):
        Mesh.load(tmp_path / "a.npz", radiance=1)


def test_bad_arrays_name_the_file(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", v=np.eye(3), f=[[0, 1, 3]])
    with pytest.raises(SceneError) as caught:
        Mesh.load(tmp_path / "a.npz", radiance=1)
    assert str(caught.value).startswith(f"{tmp_path / 'a.npz'}: faces[0]: (0, 1, 3)")


L_SHAPE = np.array([[2, 0, 0], [2, 1, 0], [1, 1, 0], [1, 2, 0], [0, 2, 0], [0, 0, 0]], np.float64)
"""A concave polygon of area 3; its fans from two of six corners are right."""


def area_vectors(mesh: MeshArrays) -> np.ndarray:
    a, b, c = mesh.vertices[mesh.faces].swapaxes(0, 1)
    areas: np.ndarray = np.cross(b - a, c - a) / 2
    return areas


@pytest.mark.parametrize("first", range(6))
@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("kind", ["obj", "normals.obj", "ply", "mixed.ply", "binary.ply"])
def test_concave_polygons(tmp_path: Path, kind: str, side: int, first: int) -> None:
    points = np.roll(L_SHAPE, first, axis=0)[::side]
    rows = "\n".join(" ".join(map(str, point)) for point in points)
    if kind.endswith("obj"):
        corner = "{}//{}" if kind.startswith("normals") else "{}"
        v = "v " + rows.replace("\n", "\nv ") + "\nv 9 9 9\n"
        vn = "".join(f"vn {i} 1 0\n" for i in range(6)) if "{}//{}" in corner else ""
        content: str | bytes = f"{v}{vn}f {' '.join(corner.format(i, i) for i in range(1, 7))}\n"
    elif kind == "binary.ply":
        head = ply(1, vertices=6, encoding="binary_little_endian").encode()
        content = head + points.astype("<f4").tobytes() + struct.pack("<B6i", 6, *range(6))
    else:
        more = "3 0 1 1\n" if kind == "mixed.ply" else ""
        content = ply(1 + bool(more), vertices=6) + f"{rows}\n6 0 1 2 3 4 5\n{more}"
    mesh = load(tmp_path, f"a-{kind}" if "." in kind else f"a.{kind}", content)
    areas = area_vectors(mesh)
    areas = areas[np.abs(areas).max(axis=1) > 0]
    assert len(areas) == 4
    assert areas[:, :2].tolist() == [[0, 0]] * 4
    assert (side * areas[:, 2] > 0).all()
    assert areas[:, 2].sum() == side * 3
    if mesh.normals is not None:
        number = [points.tolist().index(place) for place in mesh.vertices.tolist()]
        assert mesh.normals[:, 0].tolist() == number


@pytest.mark.parametrize(
    ("name", "content", "place"),
    [
        ("a.obj", f"{V}f 1 2 3\nf 1 4 2 3\nf 1 4 2 3\n", "line 7"),
        ("a.obj", f"{V}f 1 2 3\nf 1 4 2 3 # x\nf 1 3 2 4\nf 1 2 3\n", "line 7"),
        ("a.ply", ply(3) + ROWS + "3 0 1 2\n4 0 3 1 2\n4 0 3 1 2\n", "line 16"),
        ("a.ply", ply(2) + ROWS + "4 0 3 1 2\n4 0 3 1 2\n", "line 15"),
    ],
)
def test_polygons_that_intersect_themselves_are_named(
    tmp_path: Path, name: str, content: str, place: str
) -> None:
    words = rf"a\....: {place}: this polygon intersects itself \(the first of 2\)$"
    with pytest.warns(UserWarning, match=words):
        load(tmp_path, name, content)


def test_polygons_far_from_planar_are_named(tmp_path: Path) -> None:
    bent = f"{V}v 1 1 1\nf 1 2 3\nf 1 2 6 3\n"
    with pytest.warns(UserWarning, match=r"a\.obj: line 8: this polygon is far from planar$"):
        load(tmp_path, "a.obj", bent)
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 1]], ">f4").tobytes()
    head = ply(1, vertices=4, encoding="binary_big_endian").encode()
    with pytest.warns(UserWarning, match=r"a\.ply: face 0: this polygon is far from planar$"):
        load(tmp_path, "a.ply", head + vertices + struct.pack(">B4i", 4, 0, 1, 3, 2))


@pytest.mark.parametrize(
    ("name", "content", "problem"),
    [
        ("a.obj", f"{V}f 1 2 3 4\nf 1 2 3 9", "line 7: '9' is not allowed; it must be one of 5"),
        ("a.obj", f"v 0 x 0\n{V}f 1 2 3 4", "this is no readable OBJ file: could not convert"),
        ("a.obj", "f 1 2 3 4", "it has no vertices"),
        ("a.ply", ply(2) + ROWS + "4 0 1 3 2\n4 0 1 2 5\n", "line 16: 5 is not allowed; it must"),
        ("a.ply", ply(2) + ROWS + "3 0 1 2\n4 0 1 2 -1\n", "line 16: -1 is not allowed"),
    ],
)
def test_polygons_without_their_vertices(
    tmp_path: Path, name: str, content: str, problem: str
) -> None:
    with pytest.raises(SceneError) as caught:
        load(tmp_path, name, content)
    assert f"{name}: {problem}" in str(caught.value)
