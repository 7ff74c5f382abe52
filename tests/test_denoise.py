"""Denoising: less error, edges kept, and what may not be hidden."""

from __future__ import annotations

import sys
from importlib.util import find_spec
from typing import Any

import numpy as np
import pytest

from drpt.denoise import denoise, load_denoiser
from drpt.distribution import install_command

needs_denoiser = pytest.mark.skipif(
    find_spec("mitsuba_oidn") is None, reason="mitsuba-oidn is not installed"
)

SIZE = 64
# The mean square error of exponential noise of standard deviation 1, which is 1, falls by so much
# at the least; in the middle of a plane it falls by a thousand.
GAIN = 30
# How much the error falls again by guides that show the only edges there are.
GUIDED_GAIN = 2


def stripes() -> np.ndarray:
    """Dark and bright columns, four pixels wide: an albedo, (SIZE, SIZE, 3)."""
    column = np.where(np.arange(SIZE) // 4 % 2, 0.8, 0.2).astype(np.float32)
    return np.broadcast_to(column[:, None], (SIZE, SIZE, 3)).copy()


def noise(seed: int = 0) -> np.ndarray:
    """Radiance of mean 1 and standard deviation 1 in every pixel."""
    return np.random.default_rng(seed).exponential(size=(SIZE, SIZE, 3)).astype(np.float32)


def error(image: np.ndarray, truth: np.ndarray | float) -> float:
    return float(np.mean((image - truth) ** 2))


@needs_denoiser
def test_noise_goes() -> None:
    image = noise()
    kept = image.copy()
    clean = denoise(image)
    assert clean.dtype == np.float32
    assert error(clean, 1) < error(image, 1) / GAIN
    assert np.array_equal(image, kept)


@needs_denoiser
def test_guides_keep_edges() -> None:
    truth = stripes()
    image = truth * noise()
    normal = np.zeros_like(truth)
    normal[..., 2] = 1
    alone, guided = denoise(image), denoise(image, truth, normal)
    assert error(guided, truth) < error(alone, truth) / GUIDED_GAIN


@needs_denoiser
def test_radiance_may_have_any_scale() -> None:
    assert denoise(1000 * noise()).mean() == pytest.approx(1000, rel=0.1)


@needs_denoiser
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_stays_and_does_not_spread(value: float) -> None:
    image = noise()
    image[20, 30, 1] = value
    clean = denoise(image)
    assert np.array_equal(clean[20, 30], image[20, 30], equal_nan=True)
    clean[20, 30] = 1
    assert error(clean, 1) < 1 / GAIN


@pytest.mark.parametrize(
    ("image", "albedo", "named"),
    [
        ((8, 8), None, "image"),
        ((8, 8, 4), None, "image"),
        ((0, 8, 3), None, "image"),
        ((8, 8, 3), (8, 4, 3), "albedo"),
    ],
)
def test_wrong_shapes_are_named(
    image: tuple[int, ...], albedo: tuple[int, ...] | None, named: str
) -> None:
    layers = [np.zeros(shape, np.float32) for shape in (image, albedo) if shape is not None]
    with pytest.raises(ValueError, match=rf"^{named}: shape \(.*\) is not allowed; it must be \(h"):
        denoise(*layers)


@needs_denoiser
@pytest.mark.parametrize("kind", [np.float64, np.float16, ">f4", list])
def test_other_numbers_are_converted(kind: Any) -> None:
    image = np.round(noise(), 2).astype(np.float16).astype(np.float32)
    other = image.tolist() if kind is list else image.astype(kind)
    assert np.array_equal(denoise(other, other, other), denoise(image, image, image))


@needs_denoiser
def test_layout_in_memory_makes_no_difference() -> None:
    image = noise()
    assert np.array_equal(denoise(np.asfortranarray(image)), denoise(image))


def test_a_normal_wants_the_albedo() -> None:
    with pytest.raises(ValueError, match=r"^albedo: None is not allowed; there must be one where"):
        denoise(noise(), normal=noise())


@pytest.mark.parametrize("wrong", ["text", [[1], [1, 2]], noise() > 1, noise() + 1j, None])
def test_what_is_no_number_is_refused(wrong: Any) -> None:
    with pytest.raises(ValueError, match=r"^image: .* is not allowed; it must be an array of num"):
        denoise(wrong)


def test_a_missing_package_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mitsuba_oidn", None)
    with pytest.raises(ImportError, match=r"^denoise: it needs Open Image Denoise \(") as raised:
        load_denoiser()
    assert str(raised.value).endswith(f"; {install_command('denoise')} installs it")
    assert "\n" not in str(raised.value)
