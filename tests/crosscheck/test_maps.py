from pathlib import Path

import numpy as np
from PIL import Image

from drpt.crosscheck import Comparison, Estimate, compare
from drpt.crosscheck.maps import save_maps
from drpt.output import read_exr

NAMES = ["difference", "image", "p-value", "reference"]


def comparison(change: float) -> Comparison:
    """Of two pictures of 8×6 pixels, that differ in one pixel by so much, and a bit elsewhere."""
    mean = np.ones((6, 8, 3))
    reference = Estimate(mean, np.full_like(mean, 1e-4), 64, 64)
    changed = mean.copy()
    changed[2, 3] += change
    changed[0, 0] -= 0.001
    return compare(Estimate(changed, reference.variance, 64, 64), reference)


def test_the_pictures_are_written_under_their_names(tmp_path: Path) -> None:
    paths = save_maps(comparison(0), tmp_path / "new" / "folder", "mis-3-")
    assert sorted(path.name for path in paths) == sorted(
        f"mis-3-{name}{suffix}" for name in NAMES for suffix in (".exr", ".png")
    )
    assert all(path.is_file() for path in paths)


def test_they_show_what_differs(tmp_path: Path) -> None:
    save_maps(comparison(0.5), tmp_path)
    difference, p_value = (read_exr(tmp_path / f"{n}.exr")[0] for n in ("difference", "p-value"))
    assert np.argwhere(difference > 0.01)[:, :2].tolist() == [[2, 3]] * 3
    assert difference[2, 3, 0] == 0.5
    assert p_value[2, 3, 0] < 1e-6 < p_value[5, 7, 0]
    with Image.open(tmp_path / "difference.png") as picture:
        assert picture.getpixel((3, 2)) == (255, 0, 0)
        assert picture.getpixel((5, 5)) == (255, 255, 255)
    with Image.open(tmp_path / "p-value.png") as picture:
        assert picture.getpixel((3, 2)) == (255, 0, 0)


def test_too_dark_is_blue(tmp_path: Path) -> None:
    save_maps(comparison(-0.5), tmp_path)
    with Image.open(tmp_path / "difference.png") as picture:
        assert picture.getpixel((3, 2)) == (0, 0, 255)


def test_equal_pictures_have_maps_too(tmp_path: Path) -> None:
    image = Estimate(np.zeros((4, 4, 3)), np.zeros((4, 4, 3)), 64, 64)
    save_maps(compare(image, image), tmp_path)
    with Image.open(tmp_path / "p-value.png") as picture:
        assert picture.getcolors() == [(16, (255, 255, 255))]
