"""drpt's scenes as files that Mitsuba renders by itself."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from drpt.crosscheck.bsdfs import counterpart
from drpt.crosscheck.convert import surface, to_mitsuba_dict
from drpt.crosscheck.variant import load_mitsuba
from drpt.files import write_file
from drpt.scene import Mesh, SceneError, checks

if TYPE_CHECKING:
    from os import PathLike

    from drpt.scene import Scene

SPP = 64
"""Samples per pixel, which the file makes a parameter of Mitsuba's command line."""


def to_mitsuba_xml(scene: Scene, path: str | PathLike[str], bounces: int = 3) -> None:
    """Write a scene without Phong surfaces as an XML file for Mitsuba's own command line.

    Its meshes go into the folder ``<stem>-meshes`` beside it, as PLY files that are named by their
    content. ``mitsuba -m scalar_rgb -D spp=256 -o picture.exr scene.xml`` then renders what
    `to_mitsuba` does, with 256 samples per pixel instead of 64; ``-m llvm_ad_rgb`` is faster. The
    file has all shapes whole: where they overlap in one plane, rounding decides which one is seen.

    Raises
    ------
    drpt.SceneError
        A surface is a Phong surface, which Mitsuba has not, or a file cannot be written.
    ValueError
        The variant that is set does not compute in RGB.
    drpt.kernel.backend.BackendError
        No usable libLLVM was found.
    """
    if not isinstance(path, str | os.PathLike) or not Path(path).name:
        raise checks.refuse("", path, "the path of an XML file")
    if "$" in Path(path).name:
        raise SceneError("its name holds a $, which Mitsuba takes for a parameter", "", str(path))
    for index, shape in enumerate(scene.shapes):
        if shape.material is not None and not counterpart(shape.material).is_builtin:
            problem = f"Mitsuba has no {shape.material.label} surface; use Diffuse"
            raise SceneError(problem, f"shapes[{index}].material")
    mi = load_mitsuba()
    try:
        _write(mi, scene, Path(path), bounces)
    except (OSError, ValueError) as error:
        cause = error.__cause__ or error
        problem = f"it cannot be written: {getattr(cause, 'strerror', cause)}"
        raise SceneError(problem, source=str(path)) from None


def _write(mi: Any, scene: Scene, path: Path, bounces: int) -> None:
    """Write the meshes and then the scene; each file is replaced as a whole."""
    folder = path.with_name(f"{path.stem}-meshes")
    table = to_mitsuba_dict(scene, bounces)
    for index, shape in enumerate(scene.shapes):
        if isinstance(shape, Mesh):
            file = _write_ply(mi, table[f"shape{index}"], folder)
            table[f"shape{index}"] = _ply(shape, file.relative_to(path.parent))
    table["sensor"]["sampler"]["sample_count"] = SPP
    config = mi.parser.ParserConfig(mi.variant())
    text = mi.parser.write_string(mi.parser.parse_dict(config, table))
    write_file(path, text.encode())


def _write_ply(mi: Any, mesh: Any, folder: Path) -> Path:
    stream = mi.MemoryStream()
    mesh.write_ply(stream)
    content = stream.raw_buffer()
    file = folder / f"{hashlib.sha256(content).hexdigest()[:16]}.ply"
    folder.mkdir(exist_ok=True)
    write_file(file, content)
    return file


def _ply(mesh: Mesh, file: Path) -> dict[str, Any]:
    return {
        "type": "ply",
        "filename": file.as_posix(),
        "face_normals": mesh.is_light or mesh.normals is None,
        **surface(mesh),
    }
