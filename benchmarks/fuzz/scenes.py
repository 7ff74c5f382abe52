"""Scene files: trees of TOML with wrong values, keys and depths, and texts that are no TOML."""

from __future__ import annotations

from copy import deepcopy
from typing import TYPE_CHECKING, Any

import tomli_w

from benchmarks.fuzz.mutations import HUGE, NUMBERS, mutate_bytes, mutate_words
from benchmarks.fuzz.target import Target
from drpt.scene import checks, files, model, toml
from drpt.scene.checks import SceneError
from drpt.scene.files import load_scene

if TYPE_CHECKING:
    from random import Random

FILE = {"type": "mesh", "file": "there-is-none.npz", "material": "red"}
CAMERA = {
    "eye": [0, 2, 7],
    "target": [0, 1, 0],
    "up": [0, 1, 0],
    "fov": 35,
    "width": 8,
    "height": 8,
}
MESH = {"type": "mesh", "vertices": [[0, 0, 0], [1, 0, 0], [0.5, 1, 0]], "faces": [[0, 1, 2]]}
SCENE: dict[str, Any] = {
    "description": "a ball, a lamp and a triangle",
    "camera": CAMERA,
    "materials": {
        "red": {"type": "diffuse", "albedo": [0.8, 0.1, 0.1]},
        "shiny": {"type": "phong", "albedo": 0.5, "exponent": 20},
    },
    "shapes": [
        {"type": "sphere", "center": [0, 0, 0], "radius": 1, "material": "red"},
        {"type": "sphere", "center": [0, 4, 0], "radius": 0.5, "radiance": [8, 8, 9.5]},
        {**MESH, "material": {"type": "diffuse", "albedo": 1}},
        {**MESH, "normals": [[0, 0, 1], [0, 0, 1], [0, 0, 1]], "material": "shiny"},
    ],
}
VALUES: tuple[Any, ...] = (
    *NUMBERS,
    *(True, 0.0, -0.0, 1e-9, 1e-300, 1e300, float("nan"), float("inf"), "", "red", "\x1b[2J"),
    *([], {}, [[]], [1, 2], [1, 2, 3], [1, "x", 3], [[0, 1], [2]], {"type": "diffuse"}),
    *("x" * 2000, "\u202e", "\x00", "a\nb", "../..", "/dev/zero", "."),
)
KEYS = ("type", "radiance", "file", "x", "", "\x1b[31m", "a\nb", "k" * 3000, "\u202e", '"')
TEXTS = (
    *HUGE,
    "[" * 3000 + "]" * 3000,
    "{a=" * 500 + "1" + "}" * 500,
    "1979-05-27T07:32:00Z",
    '"""\n"""',
    "1e999",
)
"""Values that a scene file may hold and a parsed table cannot."""


def make(random: Random) -> bytes:
    """Make a scene file with some faults."""
    scene = deepcopy(SCENE)
    if random.random() < 0.1:
        scene["shapes"].append(dict(FILE))
    for _ in range(random.choice((0, 1, 1, 1, 2, 3))):
        mutate_tree(scene, random)
    text = tomli_w.dumps(scene)
    match random.randrange(10):
        case 0:
            text = mutate_words(text, random)
        case 1:
            return mutate_bytes(text.encode(), random, random.randint(1, 3))
        case 2:
            text = _with_value(text, random)
        case 3:
            depth = random.choice((2, 10, 100, 1500, 20000))
            name = random.choice(("description", "a", "camera", "materials"))
            key = f"{name}.{'.'.join('a' * depth)}"
            texts = f"{key}=1\n{text}", f"{text}\n[{key}]\n", f"x={{{key}=1}}\n{text}"
            text = random.choice(texts)
    return text.encode()


def mutate_tree(tree: dict[str, Any], random: Random) -> None:
    """Replace, rename, remove or repeat something in a tree of tables and arrays."""
    node: Any = tree
    while True:
        keys = list(node) if isinstance(node, dict) else list(range(len(node)))
        if not keys:
            return
        key = random.choice(keys)
        inner = node[key]
        if not isinstance(inner, dict | list) or not inner or random.random() < 0.25:
            break
        node = inner
    match random.randrange(5):
        case 0 | 1:
            node[key] = deepcopy(random.choice(VALUES))
        case 2:
            del node[key]
        case 3 if isinstance(node, dict):
            node[random.choice(KEYS)] = node.pop(key)
        case _:
            other = deepcopy(random.choice(VALUES))
            node[key] = [inner, other] if random.random() < 0.5 else {"x": other}


def _with_value(text: str, random: Random) -> str:
    lines = text.splitlines()
    lines_with_values = [number for number, line in enumerate(lines) if " = " in line]
    number = random.choice(lines_with_values)
    lines[number] = f"{lines[number].partition(' = ')[0]} = {random.choice(TEXTS)}"
    return "\n".join(lines)


TARGET = Target(
    "scenes", ".toml", make, load_scene, (SceneError,), files._scene, (files, toml, checks, model)
)
