"""Scenes without light, or with nothing to hit: every entry takes them, with exact values."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

import drpt
from drpt.comparison import compare
from drpt.crosscheck import check, render_reference
from drpt.crosscheck.convert import to_mitsuba
from tests.scenes import BALL, LAMP, scene_of

if TYPE_CHECKING:
    from pathlib import Path

    from drpt.scene import Shape

# Radiance that Open Image Denoise makes of nothing: 8e-6.
DENOISED = 1e-4
LINE = [(0, 0, 0), (1, 0, 0), (2, 0, 0)]
GREY = drpt.Diffuse(0.5)
NO_AREA = {
    "a line": drpt.Mesh(LINE, [(0, 1, 2)], material=GREY),
    "a point": drpt.Mesh([(0, 0, 0)] * 3, [(0, 1, 2)], material=drpt.Phong(0.5, 10)),
    "a line with normals": drpt.Mesh(LINE, [(0, 1, 2)], [(0, 1, 0)] * 3, material=GREY),
    "a black line": drpt.Mesh(LINE, [(0, 1, 2)], radiance=0),
    "many lines": drpt.Mesh(LINE, [(0, 1, 2)] * 500, material=GREY),
}
NO_LIGHT = {
    "a ball": BALL,
    "a black ball": drpt.Sphere((0, 0, 0), 1, radiance=0),
    "a glossy ball": drpt.Sphere((0, 0, 0), 1, material=drpt.Phong(0.5, 10)),
}
BLACK = {**NO_AREA, **NO_LIGHT}


@pytest.mark.parametrize("shape", BLACK.values(), ids=BLACK)
@pytest.mark.filterwarnings("ignore:the picture is black")
class TestBlackScenes:
    @pytest.mark.parametrize("mode", drpt.Mode)
    def test_every_mode_renders_nothing(self, shape: Shape, mode: drpt.Mode) -> None:
        result = drpt.render(scene_of(shape), 16, mode=mode)
        assert not result.image.any()
        assert (result.error, result.non_finite) == (0, 0)
        rendering = drpt.Rendering(scene_of(shape), 16, mode=mode)
        assert rendering.sample(6, 4, 3).tolist() == [0, 0, 0]
        assert not rendering.vertices(6, 4, 16).contribution.any()
        assert drpt.explain(scene_of(shape), mode=mode).features["emission"] is False

    def test_no_target_is_missed(self, shape: Shape) -> None:
        assert drpt.render(scene_of(shape), 1024, target_error=1e-6).spp == 64

    def test_pictures_and_scenes_are_written(self, shape: Shape, tmp_path: Path) -> None:
        scene = scene_of(shape)
        result = drpt.render(scene, 4, layers=True, checkpoint=tmp_path / "state")
        for suffix in (".exr", ".png", ".npy"):
            result.save(tmp_path / f"picture{suffix}")
        scene.save(tmp_path / "scene.toml")
        assert drpt.load_scene(tmp_path / "scene.toml") == scene
        assert result.denoise().image.max() < DENOISED
        assert compare(result, result).rel_mse == 0

    @pytest.mark.slow
    def test_mitsuba_sees_the_same(self, shape: Shape) -> None:
        assert to_mitsuba(scene_of(shape))
        reference = render_reference(scene_of(shape), 64, 2)
        assert not reference.estimate.mean.any()
        assert "both are black" in str(check(reference, spp=64))


@pytest.mark.parametrize("shape", NO_AREA.values(), ids=NO_AREA)
def test_there_is_no_first_hit_without_area(shape: Shape) -> None:
    hits = drpt.Rendering(scene_of(shape)).first_hits()
    assert not hits["albedo"].any()
    assert not hits["normal"].any()
    assert np.isposinf(hits["depth"]).all()


@pytest.mark.parametrize("shape", NO_AREA.values(), ids=NO_AREA)
def test_what_has_no_area_changes_no_picture(shape: Shape) -> None:
    without, beside = (
        drpt.render(scene_of(*shapes), 16, layers=True)
        for shapes in ((BALL, LAMP), (BALL, shape, LAMP))
    )
    np.testing.assert_allclose(beside.image, without.image, rtol=1e-4, atol=1e-5)
    np.testing.assert_array_equal(beside.layers["albedo"], without.layers["albedo"])
