"""render(), Rendering and explain(): settings, results, reproducibility, memory."""

from __future__ import annotations

import inspect
import os
import subprocess
import sys
from typing import Any

import numpy as np
import pytest

import drpt
from tests.scenes import BALL, LAMP, LAMP_AND_BALL, scene_of

# A render of 4096 x 4096 pixels is to run within this; its image alone takes 0.6 GiB, as float64.
MAX_BYTES = 2 * 2**30

SCENE = LAMP_AND_BALL


def test_result_says_what_was_rendered_and_how() -> None:
    result = drpt.render(SCENE, 5, 2, "explicit", sampler="independent", seed=9, jitter=False)
    assert result.image.shape == (8, 12, 3)
    assert result.image.dtype == np.float32
    assert result.image.max() > 0
    assert result.scene is SCENE
    assert (result.spp, result.bounces, result.mode) == (5, 2, drpt.Mode.EXPLICIT)
    assert (result.sampler, result.seed, result.jitter) == ("independent", 9, False)
    assert result.non_finite == 0
    assert result.seconds > 0
    assert result.paths == 8 * 12 * 5
    assert result.rays >= result.paths


def test_defaults() -> None:
    parameters = inspect.signature(drpt.render).parameters
    defaults = {name: p.default for name, p in parameters.items() if p.default is not p.empty}
    assert defaults == {
        "spp": 64,
        "bounces": 3,
        "mode": "mis",
        "sampler": "sobol",
        "seed": 0,
        "jitter": True,
        "error": True,
        "target_error": None,
        "time_limit": None,
        "checkpoint": None,
        "checkpoint_interval": 30.0,
        "layers": False,
        "on_pass": None,
        "progress": False,
    }


@pytest.mark.parametrize("mode", drpt.Mode)
@pytest.mark.parametrize("sampler", ["sobol", "independent"])
def test_same_call_same_bits(mode: str, sampler: str) -> None:
    a, b = (drpt.render(SCENE, 9, 2, mode, sampler=sampler, seed=3) for _ in range(2))
    assert np.array_equal(a.image, b.image)
    assert a.rays == b.rays


def test_other_seeds_give_other_noise() -> None:
    images = [drpt.render(SCENE, 4, seed=seed).image for seed in (0, 1, 2**32, 2**70)]
    for index, image in enumerate(images[1:]):
        assert all(not np.array_equal(image, other) for other in images[: index + 1])


def test_threads_change_no_bit() -> None:
    code = (
        "import sys, drpt\n"
        "from drpt.kernel import backend\n"
        "backend.load()\n"
        "backend.set_thread_count(int(sys.argv[1]))\n"
        "scene = drpt.load_scene('cornell-box-glossy')\n"
        "result = drpt.render(scene, 2, 3, 'mis')\n"
        "print(hash(result.image.tobytes()), result.rays)"
    )
    answers = {
        subprocess.run(
            [sys.executable, "-c", code, threads],
            env={**os.environ, "PYTHONHASHSEED": "0"},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for threads in ("1", "2", "3")
    }
    assert len(answers) == 1


def test_no_bounces_show_lights_alone() -> None:
    image = drpt.render(SCENE, 16, 0, jitter=False).image
    seen = image.any(axis=2)
    assert 0 < seen.mean() < 0.5
    assert np.unique(image[seen], axis=0).tolist() == [[3, 2, 1]]


@pytest.mark.parametrize("mode", drpt.Mode)
def test_a_scene_without_light_is_black(mode: str) -> None:
    dark = scene_of(BALL, drpt.Sphere((0, 2, 1), 0.5, radiance=0))
    assert not drpt.render(dark, 4, 3, mode).image.any()


@pytest.mark.parametrize("mode", drpt.Mode)
def test_a_scene_of_lights_alone_shows_them(mode: str) -> None:
    lights = scene_of(LAMP, drpt.Sphere((0, 0, 0), 1, radiance=7))
    direct = drpt.render(lights, 4, 0, mode).image
    assert direct.max() == 7
    assert np.array_equal(drpt.render(lights, 4, 3, mode).image, direct)


@pytest.mark.parametrize("mode", drpt.Mode)
def test_camera_inside_a_light_sees_nothing_of_it(mode: str) -> None:
    inside = scene_of(drpt.Sphere((0, 1, 5), 1, radiance=3), BALL)
    assert not drpt.render(inside, 4, 2, mode).image.any()


def test_a_picture_of_one_pixel() -> None:
    picture = drpt.render(scene_of(BALL, LAMP, width=1, height=1), 1000, 1, "explicit")
    assert picture.image.shape == (1, 1, 3)
    assert picture.image.min() > 0


BAD_SETTINGS: list[dict[str, Any]] = [
    {"scene": "cornell-box"},
    {"spp": 0},
    {"bounces": -1},
    {"mode": None},
    {"sampler": "halton"},
    {"seed": 0.5},
    {"jitter": 1},
    {"error": 0},
    {"checkpoint_interval": 0},
    {"progress": "yes"},
]


@pytest.mark.parametrize("bad", BAD_SETTINGS)
def test_bad_settings_are_refused_by_name(bad: dict[str, Any]) -> None:
    ((field, value),) = bad.items()
    with pytest.raises(ValueError, match=rf"^{field}: .* is not allowed; it must be") as error:
        drpt.render(**{"scene": SCENE, **bad})
    assert repr(value) in str(error.value)


def test_the_error_of_an_unknown_mode_lists_all() -> None:
    with pytest.raises(ValueError, match=r"implicit-uniform, implicit, explicit-uniform, .*, mis"):
        drpt.render(SCENE, mode="path")


def test_settings_are_checked_before_drjit_is_loaded() -> None:
    code = (
        "import sys, drpt\n"
        "scene = drpt.load_scene('furnace')\n"
        "try:\n"
        "    drpt.render(scene, spp=0)\n"
        "except ValueError:\n"
        "    print('drjit' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


def test_numpy_numbers_are_numbers() -> None:
    result = drpt.render(SCENE, np.int64(2), np.int32(1), seed=np.uint8(3))  # type: ignore[arg-type]
    assert (result.spp, result.bounces, result.seed) == (2, 1, 3)
    assert type(result.spp) is int


def test_passes_report_progress_and_can_be_stopped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("drpt.plan.LAUNCH_PATHS", 96 * 4)
    rendering = drpt.Rendering(SCENE, 10, 1)
    assert list(rendering.passes()) == [4, 8, 10]
    assert rendering.result().spp == 10
    stopped = drpt.Rendering(SCENE, 10, 1)
    next(stopped.passes())
    monkeypatch.undo()
    assert np.array_equal(stopped.result().image, drpt.render(SCENE, 4, 1).image)
    assert stopped.result().paths == 96 * 4


def test_each_pass_shows_the_picture_so_far(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("drpt.plan.LAUNCH_PATHS", 96 * 4)
    seen: list[drpt.Result] = []
    result = drpt.render(SCENE, 10, 1, on_pass=seen.append)
    assert [(so_far.spp, so_far.partial) for so_far in seen] == [(4, True), (8, True), (10, False)]
    assert np.array_equal(seen[-1].image, result.image)


@pytest.mark.parametrize("sampler", ["sobol", "independent"])
def test_the_error_changes_neither_samples_nor_rays(sampler: str) -> None:
    on, off = (drpt.render(SCENE, 100, 2, sampler=sampler, error=error) for error in (True, False))
    assert np.array_equal(on.image, off.image)
    assert on.rays == off.rays


def test_parts_of_a_pass_make_the_same_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = drpt.render(SCENE, 4, 2)
    monkeypatch.setattr("drpt.plan.LAUNCH_PIXELS", 17)
    parts = drpt.render(SCENE, 4, 2)
    assert parts.image == pytest.approx(whole.image, rel=1e-6)
    assert parts.rays == whole.rays


def test_a_render_goes_on_after_an_interrupt_amid_a_pass(monkeypatch: pytest.MonkeyPatch) -> None:
    from drpt.kernel.launch import Launcher

    monkeypatch.setattr("drpt.plan.LAUNCH_PIXELS", 17)
    whole = drpt.render(SCENE, 4, 2)
    launch, launched = Launcher.launch, []

    def interrupted(self: Launcher, *arguments: Any) -> Any:
        launched.append(arguments)
        if len(launched) == 3:
            raise KeyboardInterrupt
        return launch(self, *arguments)

    monkeypatch.setattr(Launcher, "launch", interrupted)
    rendering = drpt.Rendering(SCENE, 4, 2)
    with pytest.raises(KeyboardInterrupt):
        list(rendering.passes())
    assert list(rendering.passes()) == [4]
    resumed = rendering.result()
    assert np.array_equal(resumed.image, whole.image)
    assert resumed.rays == whole.rays


def test_injected_infinities_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    from drpt.kernel.integrators.path import Tracer

    follow = Tracer.follow

    def broken(self: Tracer, first: Any, sampler: Any) -> Any:
        import drjit as dr

        radiance, rays = follow(self, first, sampler)
        bad = dr.select(sampler.pixel == 5, float("nan"), 0)
        bad = dr.select(sampler.pixel == 7, float("inf"), bad)
        return radiance + bad, rays

    monkeypatch.setattr(Tracer, "follow", broken)
    with pytest.warns(RuntimeWarning, match="12 samples"):
        result = drpt.render(SCENE, 6, 1)
    assert result.non_finite == 12
    pixels = result.image.reshape(-1, 3)
    assert np.isnan(pixels[5]).all()
    assert np.isposinf(pixels[7]).all()
    assert np.isfinite(np.delete(pixels, [5, 7], axis=0)).all()


@pytest.mark.parametrize("sampler", ["sobol", "independent"])
def test_a_sample_that_is_not_finite_is_named_and_can_be_traced_again(
    sampler: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    from drpt.kernel.integrators.path import Tracer

    follow = Tracer.follow

    def broken(self: Tracer, first: Any, sampler: Any) -> Any:
        import drjit as dr

        radiance, rays = follow(self, first, sampler)
        bad = (sampler.pixel == 31) & (sampler.index >= 41)
        return radiance + dr.select(bad, float("inf"), 0), rays

    monkeypatch.setattr(Tracer, "follow", broken)
    monkeypatch.setattr("drpt.plan.LAUNCH_PATHS", 16 * SCENE.camera.width * SCENE.camera.height)
    monkeypatch.setattr("drpt.plan.LAUNCH_LANES", 4)
    settings: Any = {"spp": 64, "bounces": 2, "mode": "explicit", "sampler": sampler, "seed": 3}
    with pytest.warns(RuntimeWarning, match="not finite") as caught:
        result = drpt.render(SCENE, **settings)
    assert str(caught[0].message) == result.warning
    assert result.warning == (
        "23 samples were not finite, one of them in pixel (7, 2): "
        f"Rendering(scene, 64, 2, 'explicit', sampler={sampler!r}, seed=3, jitter=True)"
        ".sample(7, 2, 41) traces it again"
    )
    assert result.first_non_finite == (7, 2, 41)
    assert result.metadata["first_non_finite"] == "7 2 41"
    rendering = drpt.Rendering(SCENE, **settings)
    assert np.isposinf(rendering.sample(7, 2, 41)).all()
    assert np.isfinite(rendering.sample(7, 2, 40)).all()


def test_samples_one_by_one_are_those_of_the_picture() -> None:
    rendering = drpt.Rendering(SCENE, 4, 2)
    list(rendering.passes())
    result = rendering.result()
    assert result.warning is None
    assert "first_non_finite" not in result.metadata
    mean = np.mean([rendering.sample(3, 1, n) for n in range(4)], axis=0)
    assert mean.astype(np.float32) == pytest.approx(result.image[1, 3], rel=1e-6)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((-1, 0, 0), "column: -1 is not allowed; it must be a whole number from 0 to"),
        ((0, 10**6, 0), "row: 1000000 is not allowed"),
        ((0, 0, 4), "number: 4 is not allowed; it must be a whole number from 0 to 3"),
        ((0, 0.5, 0), "row: 0.5 is not allowed"),
    ],
)
def test_only_samples_of_the_picture_can_be_traced(
    arguments: tuple[Any, Any, Any], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        drpt.Rendering(SCENE, 4, 2).sample(*arguments)


EXPECTED_FEATURES = {
    "spheres",
    "triangles",
    "interpolated_normals",
    "diffuse",
    "phong",
    "emission",
    "direct_light",
    "light_choice",
    "mis",
}


def test_explain_names_features_and_counts_operations() -> None:
    told = drpt.explain(SCENE, bounces=2, mode="explicit")
    assert set(told.features) >= EXPECTED_FEATURES
    on = {name for name in EXPECTED_FEATURES if told.features[name]}
    assert on == {"spheres", "diffuse", "emission", "direct_light"}
    assert told.operations > 100
    lines = dict(line.split()[:2] for line in str(told).splitlines())
    assert lines["phong"] == "no"
    assert lines["diffuse"] == "yes"
    assert lines["operations"] == str(told.operations)
    assert told.reasons.keys() == told.features.keys()
    assert told.reasons["light_choice"] == "there is one light"
    assert "there is one light" in str(told)


def test_kernels_shrink_with_what_a_scene_lacks() -> None:
    wall = drpt.Mesh([[-1, -1, -2], [1, -1, -2], [0, 1, -2]], [[0, 1, 2]], material=BALL.material)
    smooth = drpt.Mesh(
        wall.vertices, wall.faces, [[0.0, 0, 1], [0.1, 0, 1], [0, 0.1, 1]], BALL.material
    )
    shiny = drpt.Sphere((2, 0, 0), 0.5, material=drpt.Phong(0.5, 20))
    lamp = drpt.Sphere((-2, 2, 0), 0.1, radiance=5)

    def operations(*shapes: Any, bounces: int = 2, mode: str = "explicit") -> int:
        return drpt.explain(scene_of(*shapes), bounces, mode).operations

    plain = operations(BALL, LAMP)
    assert operations(BALL, LAMP, wall) > plain
    assert operations(BALL, LAMP, smooth) > operations(BALL, LAMP, wall)
    assert operations(BALL, LAMP, shiny) > plain
    assert operations(BALL, LAMP, lamp) > plain
    assert operations(BALL, LAMP, mode="mis") > plain > operations(BALL, LAMP, mode="implicit")
    assert operations(BALL, LAMP, bounces=0) < operations(BALL, LAMP, bounces=1) < plain
    assert operations(BALL) < operations(BALL, LAMP, bounces=0)


@pytest.mark.parametrize(
    ("settings", "field"), [({"mode": "x"}, "mode"), ({"bounces": -1}, "bounces")]
)
def test_explain_refuses_bad_settings(settings: dict[str, Any], field: str) -> None:
    with pytest.raises(ValueError, match=rf"^{field}: "):
        drpt.explain(SCENE, **settings)


@pytest.mark.slow
def test_a_large_picture_fits_into_memory() -> None:
    code = (
        "import resource, drpt\n"
        "scene = drpt.load_scene('cornell-box')\n"
        "c = scene.camera\n"
        "camera = drpt.Camera(c.eye, c.target, c.up, c.fov, 4096, 4096)\n"
        "result = drpt.render(drpt.Scene(camera=camera, shapes=scene.shapes), 1, 2)\n"
        "print(result.image.mean(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    mean, kibibytes = map(float, done.stdout.split())
    assert mean > 0.8
    assert kibibytes * 1024 < MAX_BYTES


def test_a_picture_that_memory_cannot_hold_is_refused_with_its_size() -> None:
    scene = drpt.load_scene("cornell-box").resized(65536, 65536)
    with pytest.raises(ValueError, match=r"65536x65536 needs 721\.6 GB of memory, and .* are free"):
        drpt.Rendering(scene)
