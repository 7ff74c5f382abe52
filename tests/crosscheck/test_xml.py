from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import OpenEXR
import pytest

from drpt import Camera, Diffuse, Mesh, Scene, SceneError, Sphere, load_scene, render
from drpt.crosscheck.parse import from_mitsuba
from drpt.crosscheck.xml import to_mitsuba_xml
from drpt.scene import Phong
from tests.crosscheck.test_parse import assert_same

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from drpt.scene import Shape

SPP = 1024
BOUNCES = 2
TOLERANCE = 0.015  # relative, of the image means: 4 standard errors

BENT = [[-0.2, 0, 0.96], [0.2, 0, 0.96], [0, 0.2, 0.96], [0, -0.2, 0.96]]
ROOF = np.array([[-1, -1, 0], [1, -1, 0], [0, 1, 0.1234567], [0, -2, -1]])
FACES = [[0, 1, 2], [0, 3, 1]]  # not in one plane: Mitsuba would smooth them


@pytest.fixture
def scene() -> Scene:
    """All that can be written: flat and smooth meshes, lights, black surfaces."""
    view = Camera((1.1, -2.3, 4.7), (0.1, 0.2, -0.3), (0.1, 1, 0.2), 41.7, 12, 8)
    grey, paint = Diffuse(0.5), Diffuse((1 / 3, 0.2, 0.7))
    shapes: list[Shape] = [
        Mesh(ROOF, FACES, material=paint),
        Mesh(ROOF, FACES, BENT, grey),
        Mesh(ROOF, FACES, BENT, radiance=(1 / 7, 1e-3, 1e4)),
        Mesh(ROOF, FACES, radiance=0),
        Sphere((1 / 3, 2, 3), 1 / 7, grey),
        Sphere((-2, 2, 3), 0.1, radiance=1e5),
        Sphere((-2, -2, 3), 0.1, radiance=0),
    ]
    return Scene(view, shapes)


def test_what_is_written_comes_back(scene: Scene, tmp_path: Path) -> None:
    to_mitsuba_xml(scene, tmp_path / "scene.xml")
    assert_same(from_mitsuba(tmp_path / "scene.xml"), scene)


def test_the_files_can_be_moved(scene: Scene, tmp_path: Path) -> None:
    to_mitsuba_xml(scene, tmp_path / "scene.xml")
    moved = tmp_path / "elsewhere"
    moved.mkdir()
    for name in ("scene.xml", "scene-meshes"):
        (tmp_path / name).rename(moved / name)
    assert_same(from_mitsuba(moved / "scene.xml"), scene)


def test_equal_meshes_are_written_once(scene: Scene, tmp_path: Path) -> None:
    to_mitsuba_xml(scene, tmp_path / "scene.xml")
    files = sorted(path.parent.name for path in tmp_path.rglob("*.*"))
    assert files == sorted([tmp_path.name, "scene-meshes", "scene-meshes"])


def test_phong_surfaces_are_refused(tmp_path: Path) -> None:
    scene = load_scene("cornell-box-glossy")
    index = [isinstance(shape.material, Phong) for shape in scene.shapes].index(True)
    with pytest.raises(SceneError, match=rf"^shapes\[{index}\].material: Mitsuba has no Phong"):
        to_mitsuba_xml(scene, tmp_path / "scene.xml")
    assert not list(tmp_path.iterdir())


def test_a_path_that_cannot_be_written_is_refused(scene: Scene, tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"nowhere.*it cannot be written: No such file"):
        to_mitsuba_xml(scene, tmp_path / "nowhere" / "scene.xml")
    with pytest.raises(SceneError, match="3 is not allowed; it must be the path of an XML file"):
        to_mitsuba_xml(scene, 3)  # type: ignore[arg-type]


def command_line(path: Path) -> NDArray[np.float32]:
    """Return the picture that Mitsuba's own command line renders."""
    mitsuba = str(Path(sys.executable).with_name("mitsuba"))
    picture = str(path.with_suffix(".exr"))
    command = [mitsuba, "-m", "scalar_rgb", "-D", f"spp={SPP}", "-o", picture, str(path)]
    subprocess.run(command, check=True, capture_output=True)
    with OpenEXR.File(picture) as file:
        pixels: NDArray[np.float32] = file.channels()["RGB"].pixels
    return pixels


def test_mitsubas_command_line_renders_it(tmp_path: Path) -> None:
    scene = load_scene("cornell-box")
    scene = replace(scene, camera=replace(scene.camera, width=16, height=16))
    to_mitsuba_xml(scene, tmp_path / "box.xml", BOUNCES)
    theirs = command_line(tmp_path / "box.xml")
    ours = render(scene, SPP, BOUNCES).image
    assert theirs.dtype == np.float32
    assert theirs.shape == ours.shape
    np.testing.assert_allclose(theirs.mean((0, 1)), ours.mean((0, 1)), rtol=TOLERANCE)


def test_a_name_that_mitsuba_would_not_read_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"its name holds a \$"):
        to_mitsuba_xml(load_scene("cornell-box"), tmp_path / "a $x.xml")
    assert not list(tmp_path.iterdir())
