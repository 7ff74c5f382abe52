"""Merged renders: weights, errors that are honest, and what is refused."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import drpt
from drpt.error import relative_mse
from drpt.merging import merge, seeds
from drpt.output import read, write

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

ROUNDING = 2e-6  # of float32 files, 2^-24 each, and of sums of a few of them

METADATA: dict[str, str | int | float] = {
    "scene": "[camera]",
    "bounces": 3,
    "jitter": True,
    "mode": "mis",
    "sampler": "sobol",
    "spp": 16,
    "seed": 0,
    "partial": False,
    "seconds": 0.5,
    "rays": 1000,
    "non_finite": 0,
}
SHAPE = (120, 100, 3)
TRUTH = np.random.default_rng(0).uniform(0.01, 2, SHAPE)
NOISE = 4.0  # standard deviation of a sample, over the truth


class Renders:
    """Writes renders of the same truth with independent noise, and their standard errors."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def __call__(self, seed: int, spp: int = 16, **metadata: Any) -> Path:
        errors = NOISE * TRUTH / np.sqrt(spp)
        image = TRUTH + errors * np.random.default_rng(seed + 1).standard_normal(SHAPE)
        layers = {"standard_error": errors}
        return self.write(f"{seed}.exr", image, layers, seed=seed, spp=spp, **metadata)

    def write(
        self, name: str, image: NDArray[Any], layers: dict[str, NDArray[Any]], **metadata: Any
    ) -> Path:
        single = {name: layer.astype(np.float32) for name, layer in layers.items()}
        path = self.folder / name
        write(path, image.astype(np.float32), {**METADATA, **metadata}, layers=single)
        return path

    def merge(self, name: str, *paths: Path) -> Path:
        layers, metadata = merge(paths)
        write(self.folder / name, layers.pop("RGB"), metadata, layers=layers)
        return self.folder / name


@pytest.fixture
def renders(tmp_path: Path) -> Renders:
    return Renders(tmp_path)


def true_error(image: NDArray[Any]) -> float:
    return float(np.mean((image - TRUTH) ** 2 / (TRUTH**2 + 0.01)))


class TestStatistics:
    SCATTER = 0.03  # four times that of mean squares of 36000 normal numbers, √(2 / 36000)

    FEW_PIXELS = 0.3  # relMSE is that of a few noisy ones among 576
    COVERAGE = 0.03  # three times √(0.95 · 0.05 / 576): channels share their noise

    def test_four_renders_have_a_quarter_of_the_error(self, renders: Renders) -> None:
        paths = [renders(seed) for seed in range(4)]
        single = true_error(read(paths[0])[0]["RGB"])
        merged = true_error(merge(paths)[0]["RGB"])
        assert merged == pytest.approx(single / 4, rel=self.SCATTER)

    def test_standard_error_is_honest_whatever_the_weights(self, renders: Renders) -> None:
        layers, _ = merge([renders(seed, spp) for seed, spp in enumerate((4, 16, 100))])
        deviations = (layers["RGB"] - TRUTH) / layers["standard_error"]
        assert np.mean(deviations**2) == pytest.approx(1, rel=self.SCATTER)
        expected = NOISE * TRUTH / np.sqrt(120)
        np.testing.assert_allclose(layers["standard_error"], expected, rtol=ROUNDING)

    def test_renders_of_a_scene_converge_as_one(self, tmp_path: Path) -> None:
        scene = drpt.load_scene("cornell-box")
        scene = replace(scene, camera=replace(scene.camera, width=24, height=24))
        for seed in range(4):
            result = drpt.render(scene, 64, 1, "mis", sampler="independent", seed=seed)
            result.save(tmp_path / f"{seed}.exr")
        layers, metadata = merge([tmp_path / f"{seed}.exr" for seed in range(4)])
        reference = drpt.render(scene, 256, 1, "mis", sampler="independent", seed=9)
        assert metadata["error"] == pytest.approx(reference.error, rel=self.FEW_PIXELS)
        errors = np.hypot(layers["standard_error"], reference.standard_error)
        inside = np.abs(layers["RGB"] - reference.image) <= 1.96 * errors
        assert inside.mean() == pytest.approx(0.95, abs=self.COVERAGE)


class TestWeights:
    def test_are_the_samples_of_a_picture(self, renders: Renders) -> None:
        layers, metadata = merge([renders(0, 16), renders(1, 48)])
        images = [read(renders.folder / f"{seed}.exr")[0]["RGB"] for seed in (0, 1)]
        expected = (images[0] + 3 * images[1].astype(np.float64)) / 4
        np.testing.assert_allclose(layers["RGB"], expected, rtol=ROUNDING, atol=ROUNDING)
        assert metadata["spp"] == 64
        np.testing.assert_array_equal(layers["samples"], np.full(SHAPE[:2], 64, np.float32))

    def test_are_the_samples_of_each_pixel_where_they_are_known(self, renders: Renders) -> None:
        image, samples = np.ones((2, 2, 3)), np.array([[4, 0], [4, 0]])
        paths = [
            renders.write("a.exr", image, {"samples": samples}, seed=0),
            renders.write("b.exr", 3 * image, {"samples": np.array([[4, 4], [12, 0]])}, seed=1),
        ]
        layers, _ = merge(paths)
        np.testing.assert_array_equal(layers["RGB"][..., 0], [[2, 3], [2.5, 0]])
        np.testing.assert_array_equal(layers["samples"], [[8, 4], [16, 0]])

    def test_other_layers_are_means_of_all_that_have_them(self, renders: Renders) -> None:
        image, depth = np.ones((2, 2, 3)), np.array([[1, 2], [3, np.inf]])
        paths = [
            renders.write("a.exr", image, {"depth": depth, "albedo": image}, seed=0, spp=1),
            renders.write("b.exr", image, {"depth": 2 * depth, "normal": image}, seed=1, spp=3),
        ]
        layers, _ = merge(paths)
        np.testing.assert_array_equal(layers["depth"], 1.75 * depth)
        np.testing.assert_array_equal(layers["albedo"], image)
        np.testing.assert_array_equal(layers["normal"], image)


def test_merging_is_associative(renders: Renders) -> None:
    spps = (4, 16, 100, 7)
    a, b, c, d = (renders(seed, spp, mode=f"m{seed % 2}") for seed, spp in enumerate(spps))
    nested = renders.merge("abc.exr", renders.merge("ab.exr", a, b), c), d
    pairs = renders.merge("ab.exr", a, b), renders.merge("cd.exr", c, d)
    layers, metadata = merge([a, b, c, d])
    for grouped, facts in (merge(nested), merge(pairs)):
        assert facts.pop("error") == pytest.approx(metadata["error"], rel=ROUNDING)
        assert facts == {name: value for name, value in metadata.items() if name != "error"}
        assert grouped.keys() == layers.keys()
        for name, layer in layers.items():
            np.testing.assert_allclose(grouped[name], layer, rtol=ROUNDING, atol=ROUNDING)


def test_a_single_render_stays_as_it_is(renders: Renders) -> None:
    path = renders(3)
    layers, metadata = merge([path])
    assert {**metadata, "error": None} == {**read(path)[1], "error": None}
    np.testing.assert_array_equal(layers["RGB"], read(path)[0]["RGB"])


class TestMetadata:
    def test_adds_up_or_lists_what_differs(self, renders: Renders) -> None:
        paths = [renders(0, 4, non_finite=1), renders(7, 8, mode="explicit", partial=True)]
        layers, metadata = merge(paths)
        errors, image = (layers[name].astype(float) for name in ("standard_error", "RGB"))
        assert metadata.pop("error") == pytest.approx(relative_mse(errors**2, image), rel=ROUNDING)
        assert metadata == {
            **METADATA,
            "mode": "mis, explicit",
            "spp": 12,
            "seed": "0, 7",
            "partial": True,
            "seconds": 1.0,
            "rays": 2000,
            "non_finite": 1,
        }
        assert seeds(metadata) == ["0", "7"]

    def test_has_no_error_unless_all_are_known(self, renders: Renders) -> None:
        paths = [renders(0, error=1e-3), renders.write("a.exr", TRUTH, {}, seed=1)]
        layers, metadata = merge(paths)
        assert layers.keys() == {"RGB", "samples"}
        assert "error" not in metadata


class TestRefusals:
    @pytest.mark.parametrize(
        ("metadata", "says"),
        [
            ({"seed": 0}, r"1\.exr: its seed 0 is in .*0\.exr, too"),
            ({"seed": "5, 0"}, r"1\.exr: its seed 0 is in .*0\.exr, too"),
            ({"scene": "[film]"}, r"1\.exr: its scene is not that of .*0\.exr$"),
            ({"bounces": 2}, r"1\.exr: bounces is 2, and 3 in .*0\.exr"),
            ({"jitter": False}, r"1\.exr: jitter is False, and True in .*0\.exr"),
            ({"denoised": True}, r"1\.exr: it is denoised"),
        ],
    )
    def test_of_renders_that_do_not_fit(
        self, renders: Renders, metadata: dict[str, Any], says: str
    ) -> None:
        first = renders(0)
        other = renders.write("1.exr", TRUTH, {}, **{"seed": 1, **metadata})
        with pytest.raises(ValueError, match=says):
            merge([first, other])

    def test_of_seeds_that_a_merged_render_contains(self, renders: Renders) -> None:
        merged = renders.merge("m.exr", renders(0), renders(1))
        with pytest.raises(ValueError, match=r"1\.exr: its seed 1 is in .*m\.exr, too"):
            merge([merged, renders(1)])
        with pytest.raises(ValueError, match=r"m\.exr: its seed 1 is in .*1\.exr, too"):
            merge([renders(2), renders(1), merged])

    def test_of_another_size(self, renders: Renders) -> None:
        small = renders.write("a.exr", TRUTH[:4, :3], {}, seed=1)
        with pytest.raises(ValueError, match=r"a\.exr: its size is 3x4, that of .*0\.exr 100x120"):
            merge([renders(0), small])

    def test_of_pictures_that_are_no_renders(self, renders: Renders, tmp_path: Path) -> None:
        write(tmp_path / "a.exr", TRUTH.astype(np.float32), {"scene": "", "spp": 3})
        np.save(tmp_path / "a.npy", TRUTH)
        for name, missing in (("a.exr", "bounces, jitter, seed"), ("a.npy", "scene, bounces")):
            with pytest.raises(ValueError, match=f"this is no render: .* has no {missing}"):
                merge([tmp_path / name, renders(0)])


def test_memory_that_is_too_small_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ten copies of the picture and three of its layer, which it is: 13 · 36000 · 8 bytes."""
    path = tmp_path / "a.exr"
    write(path, TRUTH.astype(np.float32), METADATA)
    found = read(path)
    monkeypatch.setattr("drpt.merging.read", lambda _: found)
    monkeypatch.setattr("drpt.machine.free_memory", lambda: 13 * TRUTH.size * 8)
    assert merge([path])[0]["RGB"].shape == SHAPE
    monkeypatch.setattr("drpt.machine.free_memory", lambda: 13 * TRUTH.size * 8 - 1)
    with pytest.raises(ValueError, match=r"a\.exr: to merge it needs 3\.744 MB of memory"):
        merge([path])


def test_memory_for_many_pictures_is_that_for_two(tmp_path: Path) -> None:
    """The peak, in float64 copies of the picture, is below what is asked for, and two sums."""
    paths = [tmp_path / f"{seed}.exr" for seed in range(5)]
    for seed, path in enumerate(paths):
        write(path, TRUTH.astype(np.float32), {**METADATA, "seed": seed})
    merge(paths)  # imports
    tracemalloc.start()
    try:
        merge(paths)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < (10 + 3 + 2) * TRUTH.size * 8
