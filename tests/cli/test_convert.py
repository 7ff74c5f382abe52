"""`drpt convert`: pictures of all formats, and bad input."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from drpt import cli
from drpt.output import read, write
from tests.cli.running import files, status_of

METADATA: dict[str, str | int | float] = {"mode": "mis", "spp": 16, "seconds": 0.25}
IMAGE = np.linspace(0, 2, 72, dtype=np.float32).reshape(6, 4, 3)


@pytest.fixture(autouse=True)
def picture() -> None:
    write("a.exr", IMAGE, METADATA, layers={"variance": -IMAGE})


def test_exr_keeps_metadata_and_layers() -> None:
    assert cli.main(["convert", "a.exr", "b.exr"]) == 0
    layers, metadata = read("b.exr")
    assert metadata == METADATA
    np.testing.assert_array_equal(layers["RGB"], IMAGE)
    np.testing.assert_array_equal(layers["variance"], -IMAGE)


def test_a_picture_may_take_its_own_place() -> None:
    assert cli.main(["convert", "a.exr", "a.exr"]) == 0
    np.testing.assert_array_equal(read("a.exr")[0]["RGB"], IMAGE)


def test_arrays_go_both_ways(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["convert", "a.exr", "b.npy"]) == 0
    np.testing.assert_array_equal(np.load("b.npy"), IMAGE)
    assert cli.main(["convert", "b.npy", "c.exr"]) == 0
    np.testing.assert_array_equal(read("c.exr")[0]["RGB"], IMAGE)
    assert capsys.readouterr() == ("", "")


def test_png_keeps_metadata_and_has_exposure_and_curve() -> None:
    flags = ["--exposure", "1.5", "--curve", "filmic"]
    assert cli.main(["convert", "a.exr", "a.png", *flags]) == 0
    write("expected.png", IMAGE, METADATA, exposure=1.5, curve="filmic")
    with Image.open("a.png") as picture, Image.open("expected.png") as expected:
        np.testing.assert_array_equal(np.asarray(picture), np.asarray(expected))
        assert picture.info == expected.info
        assert picture.info["drpt:spp"] == "16"


@pytest.mark.parametrize(
    ("argv", "says"),
    [
        (["no.exr", "b.png"], "no.exr: No such file or directory"),
        (["good.toml", "b.png"], "good.toml: a picture to read must end with .exr or .npy"),
        (["a.exr", "b.jpg"], "b.jpg: the name of a picture must end with .exr, .png, .npy"),
        (["a.exr", "no/b.png"], "no/b.png: the folder no does not exist"),
        (["a.exr", "b.png", "--curve", "aces"], "curve: 'aces' is not allowed; it must be one of"),
        (["a.exr", "b.png", "--exposure", "nan"], "exposure: nan is not allowed"),
        (["a.exr", "b.exr", "--exposure", "1"], "b.exr: exposure and curve are for a .png alone"),
        (["a.exr", "b.npy", "--curve", "filmic"], "b.npy: exposure and curve are for a .png alone"),
    ],
)
def test_bad_input_is_refused(
    argv: list[str], says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert status_of(cli.main, ["convert", *argv]) == 2
    printed, complaint = capsys.readouterr()
    assert printed == ""
    assert complaint.startswith(f"drpt convert: error: {says}")
    assert complaint.count("\n") == 1
    assert files() == ["a.exr", "good.toml"]
