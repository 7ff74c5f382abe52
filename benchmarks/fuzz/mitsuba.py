"""Mitsuba's scene files, each followed by a null character and its mesh."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

from benchmarks.fuzz.mutations import mutate_bytes, mutate_words
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
from drpt.crosscheck import elements, geometry, mesh_checks, parse, surfaces, xml_checks
from drpt.crosscheck.parse import from_mitsuba
from drpt.crosscheck.variant import load_mitsuba
from drpt.scene import Mesh
from drpt.scene.checks import SceneError

if TYPE_CHECKING:
    from pathlib import Path
    from random import Random

SIMPLE = """<scene version="3.0.0">
<sensor type="perspective"/>
<shape type="obj"><string name="filename" value="input.xml.obj"/><ref id="m"/></shape>
<bsdf type="twosided" id="m"><bsdf type="diffuse"/></bsdf>
</scene>"""
FULL = """<scene version="3.0.0">
<!-- all that drpt takes -- <shape> -->
<default name="size" value="2"/>
<default name="kind" value="diffuse"/>
<sensor type="perspective">
<float name="fov" value="40"/>
<transform name="to_world"><lookat origin="0, 0, 5" target="0, 0, 0" up="0, 1, 0"/></transform>
<film type="hdrfilm"><integer name="width" value="8"/><integer name="height" value="8"/></film>
</sensor>
<bsdf type="twosided" id="m">
<bsdf type="$kind"><rgb name="reflectance" value="0.1, 0.2, 0.3"/></bsdf>
</bsdf>
<shape type="KIND">
<string name="filename" value="input.xml.KIND"/><boolean name="face_normals" value="FLAT"/>
<ref id="m"/>
<transform name="to_world"><scale value="$size"/><rotate x="1" angle="30"/></transform>
</shape>
<shape type="sphere">
<point name="center" x="0" y="1" z="0"/><float name="radius" value="0.5"/>
<emitter type="area"><rgb name="radiance" value="5"/></emitter>
</shape>
<shape type="rectangle"><ref id="m"/></shape>
<shape type="disk"><boolean name="flip_normals" value="true"/><ref id="m"/></shape>
<shape type="cube"><ref id="m"/></shape>
</scene>"""
ADDITIONS = (
    '<include filename="input.xml"/>',
    '<include filename="."/>',
    '<include filename="/dev/zero"/>',
    '<spectrum name="x" filename="/dev/zero"/>',
    '<path value="."/>',
    '<shape type="serialized"><string name="filename" value="input.xml"/></shape>',
    '<shape type="ply"><string name="filename" value="/dev/zero"/></shape>',
    '<shape type="sphere" id="m"/>',
    '<bsdf type="twosided" id="a"><ref id="a"/></bsdf>',
    "<!--",
    "<![CDATA[",
    '<default name="x0" value="xxx"/>'
    + "".join('<default name="x{}" value="{}"/>'.format(i, f"$x{i - 1}" * 9) for i in range(1, 12)),
)


def make(random: Random) -> bytes:
    """Make a scene and a mesh, one of six without faults."""
    if random.random() < 1 / 6:
        return SIMPLE.encode() + b"\0" + obj(star(random), random)
    kind = random.choice(("obj", "ply"))
    mesh = tangle(random, 6 if kind == "obj" else 3)
    if random.random() < 0.3:
        mesh = misplaced(mesh, random)
    content = obj(mesh, random) if kind == "obj" else ply(mesh, random, faults=True)
    if random.random() < 0.3:
        content = damaged(content, random)
    scene = FULL.replace("KIND", kind).replace("FLAT", random.choice(("true", "false")))
    return _changed(scene, random) + b"\0" + content


def _changed(scene: str, random: Random) -> bytes:
    head, _, tail = scene.rpartition("</scene>")
    match random.randrange(10):
        case 0:
            return mutate_words(scene, random).encode("utf-8", "replace").replace(b"\0", b"")
        case 1:
            return mutate_bytes(scene.encode(), random).replace(b"\0", b"")
        case 2:
            scene = f"{head}{random.choice(ADDITIONS)}\n</scene>{tail}"
        case 3:
            depth = random.choice((3, 90, 2000, 30_000))
            name = random.choice(("bsdf", "bsdf", "shape", "x"))
            inner = f'<{name} type="twosided">' * depth + f"</{name}>" * depth
            scene = f"{head}{inner}</scene>"
        case 4 if random.random() < 0.3:  # what names the places of shapes must not read it all
            scene = scene.replace("<!--", f"<!-- {'x' * 3_000_000} ").replace(
                "</scene>", '<shape type="sphere"/>\n' * 300 + "</scene>"
            )
    return scene.encode()


def load(path: Path) -> None:
    """Load the scene, its mesh beside it."""
    scene, _, mesh = path.read_bytes().partition(b"\0")
    path.write_bytes(scene)
    for kind in ("obj", "ply"):
        path.with_name(f"{path.name}.{kind}").write_bytes(mesh)
    mi = load_mitsuba()
    mi.set_log_level(mi.LogLevel.Error)
    with warnings.catch_warnings(action="ignore", category=UserWarning):
        loaded = from_mitsuba(path)
    if scene == SIMPLE.encode():
        (shape,) = loaded.shapes
        assert isinstance(shape, Mesh)
        assert_covered_once(shape)


TARGET = Target(
    "mitsuba",
    ".xml",
    make,
    load,
    (SceneError,),
    parse._shapes,
    (parse, elements, xml_checks, mesh_checks, geometry, surfaces),
)
