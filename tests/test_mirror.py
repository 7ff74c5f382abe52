"""Mirrors: closed forms, the float64 oracle, and what other modules know about them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import drpt
from drpt.crosscheck import check, from_mitsuba, render_reference, to_mitsuba_dict
from drpt.crosscheck.bsdfs import COUNTERPARTS
from drpt.crosscheck.check import Verdict
from drpt.kernel.bsdfs import LOBES
from drpt.scene.materials import MATERIALS
from tests.oracle import path_tracer as oracle

if TYPE_CHECKING:
    from pathlib import Path

    from drpt.scene import Shape
    from tests.oracle.arrays import Floats

ROUNDING = 1e-6
CORNERS = [(x, y, z) for z in (-1, 1) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
SIDES = [(0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (3, 2, 6, 7), (0, 3, 7, 4), (1, 5, 6, 2)]
INWARD = [face for a, b, c, d in SIDES for face in ((a, b, c), (a, c, d))]
CAMERA = drpt.Camera((0, 0, -0.9), (0, 0, 0), (0, 1, 0), 60, 16, 16)
FURNACE = drpt.Mesh(CORNERS, INWARD, radiance=1)
RADIANCE = 3.0


def render(
    *shapes: Shape, bounces: int, mode: str, spp: int = 4, camera: drpt.Camera = CAMERA
) -> drpt.Result:
    return drpt.render(drpt.Scene(camera, shapes), spp, bounces, mode)


def square(z: float, facing: int, **surface: Any) -> drpt.Mesh:
    corners = [(-9, -9, z), (9, -9, z), (9, 9, z), (-9, 9, z)]
    faces = [(0, 1, 2), (0, 2, 3)] if facing > 0 else [(0, 2, 1), (0, 3, 2)]
    return drpt.Mesh(corners, faces, **surface)


@pytest.mark.parametrize("mode", drpt.Mode)
@pytest.mark.parametrize("bounces", range(5))
class TestClosedForms:
    def test_a_ball_in_a_furnace_reflects_its_albedo(self, mode: str, bounces: int) -> None:
        ball = drpt.Sphere((0, 0, 0.2), 0.4, material=drpt.Mirror((0.8, 0.5, 1)))
        image = render(FURNACE, ball, bounces=bounces, mode=mode).image
        seen = np.array([0.8, 0.5, 1]) if bounces else np.zeros(3)
        assert image[8, 8] == pytest.approx(seen, rel=ROUNDING)
        assert image[0, 0] == pytest.approx(1, rel=ROUNDING)

    def test_facing_mirrors(self, mode: str, bounces: int) -> None:
        """A light that is seen after two reflections, beside the eye."""
        albedo = 0.7
        near = square(-1, 1, material=drpt.Mirror(albedo))
        far = square(1, -1, material=drpt.Mirror(albedo))
        lamp = drpt.Sphere((0, 0, 0), 0.3, radiance=RADIANCE)
        camera = drpt.Camera((0, 0, 0.5), (0, 0, 1), (0, 1, 0), 2, 4, 4)
        image = render(near, far, lamp, bounces=bounces, mode=mode, camera=camera).image
        expected = RADIANCE * albedo if bounces else 0
        assert image == pytest.approx(np.full_like(image, expected), rel=ROUNDING)

    def test_a_diffuse_floor_seen_in_a_mirror(self, mode: str, bounces: int) -> None:
        """The mirror is one bounce; the picture is that of the mirrored camera, times albedo."""
        floor = square(-1, 1, material=drpt.Diffuse(0.6))
        lamp = drpt.Sphere((0.5, 0.3, 0), 0.4, radiance=RADIANCE)
        mirror = square(3, -1, material=drpt.Mirror(0.5))
        eye, beyond = (0, 0, 2), (0, 0, 4)
        seen = drpt.Camera(eye, (0, 0.1, 3), (0, 1, 0), 20, 4, 4)
        through = drpt.Camera(beyond, (0, 0.1, 3), (0, 1, 0), 20, 4, 4)
        whole = render(floor, lamp, mirror, bounces=bounces, mode=mode, spp=4096, camera=seen)
        direct = render(
            floor, lamp, bounces=max(bounces - 1, 0), mode="mis", spp=4096, camera=through
        )
        # The floor and the mirror exchange light from 3 bounces on: compare below that.
        if bounces == 0:
            assert not whole.image.any()
        elif bounces < 3:
            error = np.hypot(whole.standard_error.mean(), 0.5 * direct.standard_error.mean())
            assert abs(whole.image.mean() - 0.5 * direct.image.mean()) < 4 * error + ROUNDING


PANEL = drpt.Mesh(
    [(-2, 3, -1), (2, 3, -1), (2, 3, 3), (-2, 3, 3)], [(0, 1, 2), (0, 2, 3)], radiance=RADIANCE
)
MIXED: list[Shape] = [
    square(-1, 1, material=drpt.Diffuse(0.6)),
    drpt.Sphere((0.3, 0.2, -0.4), 0.5, material=drpt.Mirror((0.9, 0.8, 0.7))),
    drpt.Sphere((-0.6, -0.3, -0.6), 0.4, material=drpt.Phong(0.8, 20)),
    PANEL,
]
MIXED_SCENE = drpt.Scene(drpt.Camera((0, 0, 4), (0, 0, 0), (0, 1, 0), 40, 4, 4), MIXED)
SEEDS = 24
MEAN_ERROR = 0.005
"""Relative, of the mean of a picture; the tests see a larger fault."""


@pytest.fixture(scope="module")
def expected() -> tuple[Floats, Floats]:
    rng = np.random.default_rng(5)
    return oracle.render(MIXED_SCENE, 2**17, 3, rng, direct_light=True, sample_brdf=True)


@pytest.mark.slow
@pytest.mark.parametrize("mode", drpt.Mode)
def test_pictures_are_those_of_the_oracle(mode: str, expected: tuple[Floats, Floats]) -> None:
    spp = {"implicit-uniform": 2**16, "mis": 2**11, "guided": 2**11}.get(mode, 2**14)
    images = [drpt.render(MIXED_SCENE, spp, 3, mode, seed=seed).image for seed in range(SEEDS)]
    image, error = np.mean(images, axis=0), np.std(images, axis=0, ddof=1) / np.sqrt(SEEDS)
    truth, its_error = expected
    both = np.hypot(error, its_error)
    whole = np.linalg.norm(both, axis=(0, 1)).max() / both[..., 0].size  # channels are correlated
    assert whole < MEAN_ERROR / 3 * truth.mean()
    assert abs(image.mean() - truth.mean()) < 3.5 * whole
    assert np.abs((image - truth) / both).max() < 5


@pytest.mark.parametrize("mode", drpt.Mode)
def test_mitsuba_agrees(mode: str) -> None:
    scene = MIXED_SCENE.resized(16, 16)
    report = check(render_reference(scene, 1024, 3), mode, 1024)
    assert report.verdict != Verdict.DIFFERS


def test_mitsuba_and_back() -> None:
    back = from_mitsuba(to_mitsuba_dict(MIXED_SCENE))
    assert back.shapes[1].material == MIXED[1].material
    metal = {"type": "conductor", "material": "Au"}
    ball = {"type": "sphere", "bsdf": metal}
    camera = to_mitsuba_dict(MIXED_SCENE)["sensor"]
    with pytest.raises(drpt.SceneError, match="metal"):
        from_mitsuba({"type": "scene", "sensor": camera, "ball": ball})


def test_all_sides_have_the_same_kinds_in_the_same_order() -> None:
    assert tuple(lobe.material for lobe in LOBES) == MATERIALS
    assert tuple(kind.material for kind in COUNTERPARTS) == MATERIALS
    assert len({kind.name for kind in MATERIALS}) == len(MATERIALS)
    assert [lobe.delta for lobe in LOBES] == [kind.is_delta for kind in MATERIALS]
    deltas = [kind.is_delta for kind in MATERIALS]
    assert deltas == sorted(deltas)  # delta kinds stand last


def test_scene_files_have_mirrors(tmp_path: Path) -> None:
    ball = drpt.Sphere((0, 0, 0), 1, material=drpt.Mirror((0.1, 0.2, 0.3)))
    scene = drpt.Scene(CAMERA, [ball, FURNACE])
    scene.save(tmp_path / "scene.toml")
    assert 'type = "mirror"' in (tmp_path / "scene.toml").read_text()
    assert drpt.load_scene(tmp_path / "scene.toml") == scene
    with pytest.raises(drpt.SceneError, match="albedo"):
        drpt.Mirror(1.5)


def test_plain_scenes_have_no_code_for_mirrors() -> None:
    told = drpt.explain(drpt.load_scene("cornell-box"), 2, "explicit")
    assert not told.features["mirror"]
    assert not told.features["delta"]
    assert told.reasons["mirror"] == "there is no mirror surface"


def test_a_scene_of_mirrors_alone_samples_no_light() -> None:
    ball = drpt.Sphere((0, 0, 0), 0.5, material=drpt.Mirror(0.5))
    told = drpt.explain(drpt.Scene(CAMERA, [ball, FURNACE]), 2, "mis")
    assert told.features["mirror"]
    assert not told.features["direct_light"]
    assert told.reasons["direct_light"] == "all surfaces are specular"
    assert told.features["last_ray"]
