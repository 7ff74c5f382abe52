from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from drpt import render
from drpt.crosscheck import Estimate
from drpt.crosscheck.estimate import PASSES
from drpt.crosscheck.stored import CALIBRATION, load_estimate, save_estimate
from drpt.output import write
from tests.scenes import LAMP_AND_BALL

FLOAT32 = 1e-7  # relative: the files are float32


def estimate() -> Estimate:
    rng = np.random.default_rng(0)
    return Estimate(rng.random((3, 4, 3)), 1e-9 * rng.random((3, 4, 3)), 64, 128)


def test_an_estimate_comes_back(tmp_path: Path) -> None:
    before = estimate()
    save_estimate(before, tmp_path / "a.exr", {"bounces": 2, "renderer": "x"})
    after, metadata = load_estimate(tmp_path / "a.exr")
    assert after.mean.dtype == after.variance.dtype == np.float64
    np.testing.assert_allclose(after.mean, before.mean, rtol=FLOAT32)
    np.testing.assert_allclose(after.variance, before.variance, rtol=FLOAT32)
    assert (after.passes, after.spp) == (64, 128)
    assert metadata == {"bounces": 2, "renderer": "x", "passes": 64, "spp": 128}


def test_other_programs_find_the_layers(tmp_path: Path) -> None:
    save_estimate(estimate(), tmp_path / "a.exr", {})
    channels = OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True).channels()
    assert sorted(channels) == ["B", "G", "R", "variance.B", "variance.G", "variance.R"]


def test_a_picture_without_noise_layers_has_unknown_noise(tmp_path: Path) -> None:
    write(tmp_path / "a.exr", np.ones((2, 2, 3), np.float32), {"spp": 16})
    unknown, _ = load_estimate(tmp_path / "a.exr")
    assert np.isnan(unknown.variance).all()
    assert not unknown.is_noise_known
    save_estimate(unknown, tmp_path / "b.exr", {})
    again, metadata = load_estimate(tmp_path / "b.exr")
    assert not again.is_noise_known
    assert metadata == {}


def test_the_standard_error_of_a_render_is_its_noise(tmp_path: Path) -> None:
    result = render(LAMP_AND_BALL, 64, 1)
    result.save(tmp_path / "a.exr")
    found, _ = load_estimate(tmp_path / "a.exr")
    expected = CALIBRATION * result.standard_error.astype(float) ** 2
    np.testing.assert_allclose(found.variance, expected, rtol=FLOAT32)
    assert (found.passes, found.spp) == (PASSES, 64)


def test_noise_needs_three_channels(tmp_path: Path) -> None:
    image = np.ones((2, 2, 3), np.float32)
    write(tmp_path / "a.exr", image, {"spp": 16}, layers={"standard_error": image[..., 0]})
    with pytest.raises(ValueError, match="its layer standard_error has one channel"):
        load_estimate(tmp_path / "a.exr")


@pytest.mark.parametrize(
    ("metadata", "says"),
    [
        ({}, "its passes is None; it must be a whole number >= 2"),
        ({"spp": 64, "passes": 1}, "its passes is 1; it must be a whole number >= 2"),
        ({"spp": 64, "passes": "many"}, "its passes is 'many'"),
        ({"spp": 64.0, "passes": 64}, "its spp is 64.0"),
    ],
)
def test_variances_need_passes(tmp_path: Path, metadata: dict[str, int], says: str) -> None:
    image = np.ones((2, 2, 3), np.float32)
    write(tmp_path / "a.exr", image, metadata, layers={"variance": image})
    with pytest.raises(ValueError, match=says):
        load_estimate(tmp_path / "a.exr")


@pytest.mark.parametrize("value", [-1.0, np.nan, np.inf])
@pytest.mark.parametrize("layer", ["RGB", "variance", "standard_error"])
def test_values_must_be_possible(tmp_path: Path, layer: str, value: float) -> None:
    layers = {name: np.ones((4, 4, 3), np.float32) for name in {"RGB", "variance", layer}}
    if layer == "standard_error":
        del layers["variance"]
    layers[layer][2, 1, 0] = value
    image = layers.pop("RGB")
    write(tmp_path / "a.exr", image, {"spp": 64, "passes": 64}, layers=layers)
    with pytest.raises(ValueError, match=r"a\.exr: its \w+ is .* at pixel \(1, 2\); it must be"):
        load_estimate(tmp_path / "a.exr")


@pytest.mark.parametrize("scale", [1e-40, 1e40])
def test_variances_beyond_float32_come_back(tmp_path: Path, scale: float) -> None:
    wide = Estimate(estimate().mean, scale * np.ones((3, 4, 3)), 64, 64)
    save_estimate(wide, tmp_path / "a.exr", {})
    after, _ = load_estimate(tmp_path / "a.exr")
    np.testing.assert_allclose(after.variance, wide.variance, rtol=3 * FLOAT32)
    assert (after.passes, after.spp) == (64, 64)
