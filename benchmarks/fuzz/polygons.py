"""Mesh files for fuzzers: polygons with few faults, as OBJ and as PLY, text and binary."""

from __future__ import annotations

import math
import struct
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from benchmarks.fuzz.mutations import NUMBERS, mutate_bytes, mutate_integer, mutate_words

if TYPE_CHECKING:
    from random import Random

    from drpt import Mesh

COUNTS = (0, 1, 3, 2**31, 4 * 10**9, 2**63, -1)
"""Counts that a header may give."""
TYPES = ("float", "double", "int", "uchar", "short", "float32", "half", "x")
ROUNDING = 1e-6
"""Relative error of areas of small polygons, whose vertices are float32 in Mitsuba."""


class Polygons(NamedTuple):
    """Vertices, and faces by the numbers of their corners."""

    vertices: list[tuple[float, float, float]]
    faces: list[list[int]]


def star(random: Random) -> Polygons:
    """Make one simple polygon around the origin, mostly concave, in one of three planes."""
    count = random.randint(3, 9)
    axis = random.randrange(3)
    places = []
    for i in range(count):
        angle, radius = 2 * math.pi * i / count, random.uniform(0.5, 2)
        place = [radius * math.cos(angle), radius * math.sin(angle)]
        place.insert(axis, 0.0)
        places.append((place[0], place[1], place[2]))
    order = list(range(count))
    return Polygons(places, [order[::-1] if random.random() < 0.5 else order])


def tangle(random: Random, most: int = 6) -> Polygons:
    """Make some polygons between random points."""
    places = [tuple(random.choice((0.0, 1.0, random.gauss(0, 1))) for _ in "xyz") for _ in range(9)]
    faces = [
        [random.randrange(9) for _ in range(random.randint(3, most))]
        for _ in range(random.randint(1, 5))
    ]
    return Polygons([(x, y, z) for x, y, z in places], faces)


def obj(mesh: Polygons, random: Random) -> bytes:
    """Write an OBJ file, with normals and texture coordinates or without."""
    corner = random.choice(("{0}", "{0}", "{0}/{0}", "{0}//{0}", "{0}/{0}/{0}"))
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in mesh.vertices]
    if "//" in corner or corner.count("/") == 2:
        lines += [f"vn 0 {i} 1" for i in range(len(mesh.vertices))]
    if "{0}/{0}" in corner:
        lines += ["vt 0 0.5"] * len(mesh.vertices)
    lines += ["f " + " ".join(corner.format(i + 1) for i in face) for face in mesh.faces]
    return "\n".join(lines).encode() + b"\n"


def ply(mesh: Polygons, random: Random, *, faults: bool) -> bytes:
    """Write a PLY file; with faults, some counts and types of its header are wrong."""
    form = random.choice(("ascii", "binary_little_endian", "binary_big_endian"))
    wrong = [faults and random.random() < 0.2 for _ in range(4)]
    vertices, faces = len(mesh.vertices), len(mesh.faces)
    header = (
        f"ply\nformat {form} 1.0\n"
        f"element vertex {random.choice(COUNTS) if wrong[0] else vertices}\n"
        f"property {random.choice(TYPES) if wrong[1] else 'float'} x\n"
        "property float y\nproperty float z\n"
        f"element face {random.choice(COUNTS) if wrong[2] else faces}\n"
        f"property list uchar {random.choice(TYPES) if wrong[3] else 'int'} vertex_indices\n"
        "end_header\n"
    ).encode()
    if form == "ascii":
        rows = [" ".join(map(repr, v)) for v in mesh.vertices]
        rows += [" ".join(map(str, (len(face), *face))) for face in mesh.faces]
        return header + "\n".join(rows).encode() + b"\n"
    order = "<" if "little" in form else ">"
    body = np.array(mesh.vertices, f"{order}f4").tobytes()
    indices = b"".join(struct.pack(f"{order}B{len(f)}i", len(f), *f) for f in mesh.faces)
    return header + body + indices


def misplaced(mesh: Polygons, random: Random) -> Polygons:
    """Give a face an index that may be none."""
    index = max(-(2**31), min(random.choice(NUMBERS), 2**31 - 1))
    face = random.choice(mesh.faces)
    face[random.randrange(len(face))] = index
    return mesh


def damaged(content: bytes, random: Random) -> bytes:
    """Change words, bytes or an integer of a file, or nothing."""
    match random.randrange(4):
        case 0:
            return mutate_words(content.decode("latin-1"), random).encode("latin-1", "replace")
        case 1:
            return mutate_bytes(content, random, random.randint(1, 3))
        case 2:
            return mutate_integer(content, random)
    return content


def assert_covered_once(mesh: Mesh) -> None:
    """Assert that triangles of a simple flat polygon face one side."""
    a, b, c = mesh.vertices[mesh.faces].swapaxes(0, 1)
    areas = np.cross(b - a, c - a)
    total, one_sided = np.linalg.norm(areas, axis=1).sum(), np.linalg.norm(areas.sum(axis=0))
    assert total <= (1 + ROUNDING) * one_sided, f"triangles cover {total} instead of {one_sided}"
