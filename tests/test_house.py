"""The house: which module may import what, and what `import drpt` must not load."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

import drpt

PACKAGE = Path(drpt.__file__).parent

KNOWS: dict[str, set[str]] = {
    "immutable": set(),
    "messages": set(),
    "distribution": set(),
    "machine": {"messages"},
    "files": {"machine", "messages"},
    "scene": {"files", "immutable", "messages"},
    "kernel": {"immutable", "scene"},
    "black": {"kernel", "scene"},
    "film": set(),
    "convergence": set(),
    "light_pixels": {"scene"},
    "pooling": set(),
    "error": {"convergence", "pooling"},
    "missed": {"error"},
    "output": {"files", "machine", "messages"},
    "plan": set(),
    "denoise": {"distribution"},
    "notebook": {"output"},
    "settings": {"kernel", "scene"},
    "stopping": {"settings"},
    "checkpoint": {"files", "messages"},
    "state": {"film", "settings"},
    "result": {
        "denoise",
        "distribution",
        "error",
        "immutable",
        "kernel",
        "light_pixels",
        "notebook",
        "output",
        "scene",
    },
    "progress": set(),
}
"""What data flows along, and imports against: what a part may know beside itself.

`render` knows all of these, and what stands on top of it (`cli`, `crosscheck`, …) is known by none.
"""
TYPES_ALONE = {"progress": {"render"}}
"""What a part may know beside that, for annotations."""
HEAVY = {"drjit", "mitsuba"}


class Import(NamedTuple):
    """A module that is imported, and whether only where a function asks for it."""

    module: str
    lazy: bool
    typing: bool


def imports(path: Path) -> list[Import]:
    """All imports of a file, those of types alone told apart."""
    found: list[Import] = []

    def visit(node: ast.AST, lazy: bool, typing: bool) -> None:
        if isinstance(node, ast.Import):
            found.extend(Import(alias.name, lazy, typing) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: imports are absolute"
            for alias in node.names:
                name = f"{node.module}.{alias.name}"
                found.append(Import(name if is_module(name) else str(node.module), lazy, typing))
        lazy = lazy or isinstance(node, ast.FunctionDef | ast.Lambda)
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            typing = True
        for child in ast.iter_child_nodes(node):
            visit(child, lazy, typing)

    visit(ast.parse(path.read_text(encoding="utf-8")), lazy=False, typing=False)
    return found


def is_module(name: str) -> bool:
    file = PACKAGE.parent / Path(*name.split("."))
    return file.with_suffix(".py").exists() or (file / "__init__.py").exists()


def part_of(module: str) -> str:
    """The part of the package a module belongs to; "" is the package itself."""
    return module.split(".")[1] if "." in module else ""


FILES = sorted(PACKAGE.rglob("*.py"))
PARTS = {path: path.relative_to(PACKAGE).parts[0].removesuffix(".py") for path in FILES}


def names(path: Path) -> str:
    return path.relative_to(PACKAGE).as_posix()


@pytest.mark.parametrize("path", [path for path in FILES if PARTS[path] in KNOWS], ids=names)
def test_imports_run_against_the_flow_of_data(path: Path) -> None:
    part = PARTS[path]
    own = [i for i in imports(path) if i.module.split(".")[0] == "drpt"]
    assert {part_of(i.module) for i in own if not i.typing} <= {part} | KNOWS[part]
    assert {part_of(i.module) for i in own} <= {part} | KNOWS[part] | TYPES_ALONE.get(part, set())


def test_all_parts_meet_in_render_alone() -> None:
    own = [i for i in imports(PACKAGE / "render.py") if i.module.split(".")[0] == "drpt"]
    assert {part_of(i.module) for i in own} <= set(KNOWS)


def test_what_is_known_knows_nothing_later() -> None:
    parts = list(KNOWS)
    assert all(known <= set(parts[: parts.index(part)]) for part, known in KNOWS.items())


@pytest.mark.parametrize("path", FILES, ids=names)
def test_only_the_kernel_knows_drjit(path: Path) -> None:
    """And what is Mitsuba's own, beside an import of it."""
    used = [i for i in imports(path) if i.module.split(".")[0] == "drjit"]
    if PARTS[path] == "crosscheck":
        assert all(i.lazy or i.typing for i in used)
    elif PARTS[path] != "kernel":
        assert not used


@pytest.mark.parametrize("path", FILES, ids=names)
def test_mitsuba_is_imported_only_where_it_is_asked_for(path: Path) -> None:
    assert all(i.lazy or i.typing for i in imports(path) if i.module.split(".")[0] == "mitsuba")


@pytest.mark.parametrize("path", FILES, ids=names)
def test_nothing_below_knows_the_command_line(path: Path) -> None:
    if PARTS[path] in ("cli", "__main__"):
        return
    assert "cli" not in {part_of(i.module) for i in imports(path)}


@pytest.mark.parametrize("path", FILES, ids=names)
def test_kernels_know_neither_files_nor_pictures(path: Path) -> None:
    if PARTS[path] == "kernel":
        used = {i.module.split(".")[0] for i in imports(path)}
        assert not used & {"OpenEXR", "PIL", "rich", "trimesh", "tomllib", "tomli_w"}


def test_the_check_sees_what_is_forbidden(tmp_path: Path) -> None:
    file = tmp_path / "sample.py"
    file.write_text(
        "import drjit as dr\n"
        "from drpt.kernel.integrators import path\n"
        "from drpt import render\n"
        "def f():\n    import mitsuba.python\n"
        "if TYPE_CHECKING:\n    from drpt.scene import Scene\n"
    )
    assert imports(file) == [
        Import("drjit", lazy=False, typing=False),
        Import("drpt.kernel.integrators.path", lazy=False, typing=False),
        Import("drpt.render", lazy=False, typing=False),
        Import("mitsuba.python", lazy=True, typing=False),
        Import("drpt.scene", lazy=False, typing=True),
    ]


@pytest.mark.parametrize("module", ["drpt", "drpt.cli", "drpt.scene"])
def test_importing_loads_nothing_heavy(module: str) -> None:
    code = f"import sys, {module}; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = {name.split(".")[0] for name in done.stdout.split()}
    assert "drpt" in loaded
    assert not loaded & HEAVY


def test_the_scene_loads_no_other_part() -> None:
    code = "import sys, drpt.scene.model; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "drpt.scene.model" in done.stdout.split()
    assert not set(done.stdout.split()) & {"drjit", "mitsuba", "drpt.kernel.integrators.path"}
