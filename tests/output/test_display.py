"""From radiance to the levels of a PNG."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

from drpt.output import write
from drpt.output.display import filmic
from tests.output.pictures import grey

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

# Picture values halfway between two levels, this far apart from the middle in levels: a float32
# near 1 resolves 255 * 2^-24 = 1.5e-5 levels, and sRGB is at most 12.92 times steeper.
HALF_LEVEL = 0.5 - 1e-3

ROUNDING = 1e-12  # some roundings of float64


def linear(level: float) -> float:
    """Return the linear value of an sRGB level in [0, 255]."""
    encoded = level / 255
    return encoded / 12.92 if encoded <= 0.04045 else ((encoded + 0.055) / 1.055) ** 2.4


def png_levels(
    path: Path, image: NDArray[np.float32], exposure: float = 0.0, curve: str = "srgb"
) -> NDArray[np.uint8]:
    write(path, image, {}, exposure=exposure, curve=curve)
    with Image.open(path) as picture:
        assert picture.mode == "RGB"
        return np.asarray(picture)


class TestPng:
    def test_encodes_every_level_and_rounds_at_its_edges(self, tmp_path: Path) -> None:
        levels = np.arange(256)
        edges = levels[:, None] + np.array([-HALF_LEVEL, 0, HALF_LEVEL])
        values = [[linear(min(max(level, 0), 255)) for level in row] for row in edges]
        written = png_levels(tmp_path / "a.png", np.array([values], np.float32))
        np.testing.assert_array_equal(written[0], np.repeat(levels[:, None], 3, axis=1))

    @pytest.mark.parametrize(
        ("value", "level"),
        [(-1.0, 0), (-math.inf, 0), (1.5, 255), (math.inf, 255), (3e38, 255), (1e-45, 0)],
    )
    def test_clips_to_what_a_display_shows(self, tmp_path: Path, value: float, level: int) -> None:
        assert (png_levels(tmp_path / "a.png", grey(value)) == level).all()

    def test_shows_pixels_that_are_not_a_number_as_magenta(self, tmp_path: Path) -> None:
        image = grey(0.25)
        image[0, 1, 1] = np.nan
        levels = png_levels(tmp_path / "a.png", image)
        np.testing.assert_array_equal(levels[0, 1], (255, 0, 255))
        np.testing.assert_array_equal(levels[0, 0], (137, 137, 137))

    @pytest.mark.parametrize(("exposure", "factor"), [(2.0, 4.0), (-1.0, 0.5), (0.5, 2**0.5)])
    def test_exposure_counts_stops(self, tmp_path: Path, exposure: float, factor: float) -> None:
        path = tmp_path / "a.png"
        np.testing.assert_array_equal(
            png_levels(path, grey(0.2), exposure), png_levels(path, grey(0.2 * factor))
        )

    def test_row_0_is_the_top(self, tmp_path: Path) -> None:
        image = grey(0)
        image[0] = 1
        np.testing.assert_array_equal(png_levels(tmp_path / "a.png", image)[:, 0, 0], (255, 0))


class TestFilmic:
    @pytest.mark.parametrize(
        ("radiance", "shown"),
        [(0, 0), (1, 2.54 / 3.16), (2, 10.1 / 11.04), (4, 40.28 / 41.38), (math.inf, 1)],
    )
    def test_is_the_published_formula(self, radiance: float, shown: float) -> None:
        assert filmic(np.array(radiance)) == pytest.approx(shown, rel=ROUNDING)

    def test_is_monotone_until_it_is_white(self) -> None:
        """It meets 1 where 0.08 x² - 0.56 x - 0.14 = 0."""
        white = (0.56 + math.sqrt(0.56**2 + 4 * 0.08 * 0.14)) / (2 * 0.08)
        below = filmic(np.geomspace(1e-9, white, 10_000))
        assert (np.diff(below) > 0).all()
        assert below[-1] == pytest.approx(1, rel=ROUNDING)
        assert (filmic(np.geomspace(1.001 * white, 1e30, 1000)) == 1).all()

    def test_stands_before_the_encoding_and_behind_the_exposure(self, tmp_path: Path) -> None:
        path = tmp_path / "a.png"
        np.testing.assert_array_equal(
            png_levels(path, grey(0.25), 2.0, "filmic"), png_levels(path, grey(2.54 / 3.16))
        )

    def test_shows_what_is_not_finite_as_srgb_does(self, tmp_path: Path) -> None:
        image = grey(np.inf)
        image[0, 1, 1] = np.nan
        image[1, 0] = -np.inf
        levels = png_levels(tmp_path / "a.png", image, curve="filmic")
        np.testing.assert_array_equal(levels, png_levels(tmp_path / "a.png", image))
