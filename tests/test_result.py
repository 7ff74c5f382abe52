"""Results: arrays, metadata, and what they become on disk."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest

import drpt
from drpt.error import DARK
from drpt.output import read_exr, read_exr_layers
from tests.scenes import LAMP_AND_BALL

if TYPE_CHECKING:
    from pathlib import Path

SCENE = LAMP_AND_BALL


@cache
def result_of(spp: int = 64, *, error: bool = True) -> drpt.Result:
    return drpt.render(SCENE, spp, 1, "implicit", seed=4, error=error)


def partial_result() -> drpt.Result:
    rendering = drpt.Rendering(SCENE, 1000, 1, time_limit=1e9)
    passes = rendering.passes()
    next(passes)
    passes.close()
    return rendering.result()


def test_a_result_is_an_array() -> None:
    result = result_of()
    assert np.array_equal(np.asarray(result), result.image)
    assert np.asarray(result).dtype == np.float32
    assert np.asarray(result, np.float64).dtype == np.float64
    copy = np.array(result)
    copy[:] = -1
    assert result.image.min() >= 0


def test_a_result_does_not_change_while_its_render_goes_on() -> None:
    rendering = drpt.Rendering(SCENE, 32, 1, time_limit=1e9)
    passes = rendering.passes()
    next(passes)
    early = rendering.result()
    image, paths = early.image.copy(), early.paths
    list(passes)
    assert np.array_equal(early.image, image)
    assert (early.spp, early.paths) == (16, paths)
    assert early.error > rendering.result().error


def test_metadata_says_how_good_the_picture_is() -> None:
    result = result_of()
    assert result.metadata["error"] == result.error > 0
    assert result.metadata["partial"] is False
    assert (result.metadata["spp"], result.metadata["seed"]) == (64, 4)
    assert not any(name.startswith("_") for name in result.metadata)


def test_an_error_that_is_unknown_is_left_out() -> None:
    assert "error" not in result_of(1).metadata
    assert "error" not in result_of(error=False).metadata


def test_a_partial_picture_says_so() -> None:
    result = partial_result()
    assert result.partial
    assert result.metadata["partial"] is True
    assert (result.spp, result.metadata["spp"]) == (16, 16)
    assert "partial" in str(result)


@pytest.mark.parametrize("partial", [False, True])
def test_metadata_comes_back_from_a_saved_picture(partial: bool, tmp_path: Path) -> None:
    result = partial_result() if partial else result_of()
    result.save(tmp_path / "picture.exr")
    image, metadata = read_exr(tmp_path / "picture.exr")
    assert np.array_equal(image, result.image)
    assert metadata == result.metadata
    assert {name: type(value) for name, value in metadata.items()} == {
        name: type(value) for name, value in result.metadata.items()
    }
    assert metadata["rays"] == result.rays
    assert metadata["drpt"] == drpt.__version__
    file = tmp_path / "scene.toml"
    file.write_text(str(metadata["scene"]))
    assert drpt.load_scene(file) == SCENE


def test_layers_come_back_from_an_exr(tmp_path: Path) -> None:
    result = result_of()
    result.save(tmp_path / "picture.exr")
    layers, _ = read_exr_layers(tmp_path / "picture.exr")
    assert np.array_equal(layers["RGB"], result.image)
    assert np.array_equal(layers["standard_error"], result.standard_error)
    assert result.standard_error.max() > 0


@pytest.mark.parametrize(("spp", "error"), [(1, True), (64, False)])
def test_an_error_that_is_unknown_is_no_layer(spp: int, error: bool, tmp_path: Path) -> None:
    result_of(spp, error=error).save(tmp_path / "picture.exr")
    layers, _ = read_exr_layers(tmp_path / "picture.exr")
    assert "standard_error" not in layers


@pytest.mark.parametrize("suffix", [".png", ".npy"])
def test_save_follows_the_suffix(suffix: str, tmp_path: Path) -> None:
    result_of().save(tmp_path / f"picture{suffix}")
    assert (tmp_path / f"picture{suffix}").stat().st_size > 100


def test_save_refuses_an_unknown_suffix(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"\.exr"):
        result_of().save(tmp_path / "picture.gif")
    assert list(tmp_path.iterdir()) == []


def test_the_error_is_the_mean_of_the_standard_errors() -> None:
    """Relative to a smooth picture, where no weight is in doubt."""
    camera = drpt.Camera((0, 0, 0.5), (0, 0, 0), (0, 1, 0), 60, 32, 32)
    wall = drpt.Sphere((0, 0, 0), 1, material=drpt.Diffuse(0.5))
    scene = drpt.Scene(camera, [wall, drpt.Sphere((0, 0, 0.8), 0.1, radiance=50)])
    result = drpt.render(scene, 256, 1, "explicit", sampler="independent")
    squares = result.standard_error**2 / (result.image**2 + DARK)
    assert result.error == pytest.approx(float(squares.mean()), rel=0.1)
