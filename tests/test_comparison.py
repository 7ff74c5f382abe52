"""Numbers and pictures of a difference, against what follows from their definitions."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image

from drpt import comparison
from drpt.comparison import compare, differing_settings
from drpt.crosscheck.flip import has_flip
from drpt.distribution import install_command
from drpt.output import read_exr

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

ROUNDING = 1e-12  # some roundings of float64
ROUNDING_32 = 1e-6  # some of float32

SETTINGS: dict[str, str | int | float] = {"mode": "mis", "spp": 64, "seed": 0, "scene": "[camera]"}


def flat(*colour: float) -> NDArray[np.float64]:
    """A picture of 4×6 pixels of one colour."""
    return np.broadcast_to(np.array(colour, np.float64), (6, 4, 3)).copy()


class TestNumbers:
    def test_are_what_their_definitions_say(self) -> None:
        found = compare(flat(0.5, 0.2, 0.3), flat(0.3, 0.3, 0.3))
        assert found.rel_mse == pytest.approx((0.04 + 0.01) / 3 / 0.1, rel=ROUNDING)
        assert found.rmse == pytest.approx(math.sqrt((0.04 + 0.01) / 3), rel=ROUNDING)
        assert found.mean_difference == pytest.approx([2 / 3, -1 / 3, 0], rel=ROUNDING)
        assert found.non_finite == (0, 0)

    def test_of_the_same_picture_are_0(self) -> None:
        image = np.random.default_rng(1).random((6, 4, 3), np.float32)
        found = compare(image, image)
        assert (found.rel_mse, found.rmse) == (0, 0)
        assert not found.mean_difference.any()
        assert found.flip in (0, None)

    def test_count_every_pixel(self) -> None:
        image = flat(1, 1, 1)
        image[5, 3, 2] += 1
        assert compare(image, flat(1, 1, 1)).rmse == pytest.approx(1 / math.sqrt(72), rel=ROUNDING)

    def test_do_not_hide_what_is_not_finite(self) -> None:
        image = flat(1, 1, 1)
        image[0, 0, 1] = np.nan
        image[0, 1] = np.inf
        found = compare(image, flat(1, 1, 1))
        assert math.isnan(found.rel_mse)
        assert found.non_finite == (2, 0)
        assert "not finite  2 and 0 pixels" in str(found)
        assert "not finite" not in str(compare(flat(1, 1, 1), flat(1, 1, 1)))

    def test_of_a_black_reference_are_no_warning(self) -> None:
        found = compare(flat(1, 0, 0), flat(0, 0, 0))
        assert found.rel_mse == pytest.approx(1 / 3 / 0.01, rel=ROUNDING)
        assert found.mean_difference[0] == math.inf
        assert found.mean_difference[1:].tolist() == [0, 0]

    @pytest.mark.skipif(not has_flip(), reason="flip-evaluator is not installed")
    def test_have_flip_if_it_is_installed(self) -> None:
        flip = compare(flat(1, 1, 1), flat(0, 0, 0)).flip
        assert flip is not None
        assert flip > 0.9

    def test_say_what_flip_needs(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(comparison, "has_flip", lambda: False)
        found = compare(flat(1, 1, 1), flat(0, 0, 0))
        assert found.flip is None
        assert f"FLIP        not computed ({install_command('flip')} adds it)" in str(found)

    def test_are_printed(self) -> None:
        lines = str(compare(flat(0.5, 0.2, 0.3), flat(0.3, 0.3, 0.3))).splitlines()
        assert lines[:2] == ["  relMSE      0.167", "  RMSE        0.129"]
        assert lines[3] == "  means       R +66.7 %, G -33.3 %, B +0 %"


class TestShapes:
    def test_of_different_size_are_refused(self) -> None:
        with pytest.raises(ValueError, match="reference: its size is 4x6, and the image's is 3x6"):
            compare(np.zeros((6, 3, 3)), flat(1, 1, 1))

    @pytest.mark.parametrize("shape", [(6, 4), (6, 4, 4), (0, 4, 3), (1, 6, 4, 3)])
    def test_of_no_picture_are_refused(self, shape: tuple[int, ...]) -> None:
        with pytest.raises(
            ValueError, match=r"image: its shape is .* must be \(height, width, 3\)"
        ):
            compare(np.zeros(shape), flat(1, 1, 1))
        with pytest.raises(ValueError, match="reference: its shape is"):
            compare(flat(1, 1, 1), np.zeros(shape))


class TestErrorPicture:
    def test_is_the_error_as_exr(self, tmp_path: Path) -> None:
        found = compare(flat(0.5, 0.2, 0.3), flat(0.3, 0.3, 0.3))
        found.save_error(tmp_path / "a.exr")
        saved, _ = read_exr(tmp_path / "a.exr")
        expected = np.array([0.2, -0.1, 0]) / math.sqrt(0.1)
        np.testing.assert_allclose(saved, flat(*expected), rtol=ROUNDING_32, atol=ROUNDING_32)
        assert found.rel_mse == pytest.approx((expected**2).mean(), rel=ROUNDING)

    def test_is_red_where_too_bright_and_blue_where_too_dark(self, tmp_path: Path) -> None:
        image = flat(1, 1, 1)
        image[0, 1] = 2
        image[2, 3] = 0
        image[4, 2] = np.nan
        found = compare(image, flat(1, 1, 1))
        found.save_error(tmp_path / "a.PNG")
        with Image.open(tmp_path / "a.PNG") as picture:
            shown = [picture.getpixel(place) for place in ((1, 0), (3, 2), (2, 4), (0, 0))]
        assert shown == [(255, 0, 0), (0, 0, 255), (255, 0, 255), (255, 255, 255)]
        assert found.error_end == pytest.approx(1 / math.sqrt(1.01), rel=ROUNDING)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({}, "the same"),
        ({"versions": "other"}, "the same"),
        ({"spp": 16, "mode": "explicit"}, "mode mis / explicit, spp 64 / 16"),
        ({"scene": "[materials]", "seed": 1}, "another scene, seed 0 / 1"),
        ({"sampler": "sobol"}, "sampler ? / sobol"),
    ],
)
def test_settings_that_differ_are_named(changes: dict[str, Any], says: str) -> None:
    assert differing_settings(SETTINGS, {**SETTINGS, **changes}) == says


def test_settings_that_are_unknown_are_said_to_be() -> None:
    assert differing_settings({}, SETTINGS) == "unknown of A"
    assert differing_settings({}, {}) == "unknown of A and B"


def test_memory_that_is_too_small_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("drpt.machine.free_memory", lambda: 10 * 8 * 4 * 6 * 3 - 1)
    with pytest.raises(ValueError, match=r"comparison of 4x6 pixels needs 5\.76 kB of memory"):
        compare(flat(1, 1, 1), flat(1, 1, 1))
