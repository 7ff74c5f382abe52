"""`drpt compare`: what is printed, the pictures of the error, and bad input."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from drpt import cli
from drpt.comparison import compare
from drpt.output import read_exr, write
from tests.cli.running import files, status_of

A = np.full((6, 4, 3), 0.5, np.float32)
B = np.full((6, 4, 3), 0.4, np.float32)


@pytest.fixture(autouse=True)
def pictures() -> None:
    write("a.exr", A, {"mode": "mis", "spp": 16})
    write("b.exr", B, {"mode": "explicit", "spp": 16})


def test_the_numbers_are_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["compare", "a.exr", "b.exr"]) == 0
    printed, complaint = capsys.readouterr()
    lines = ["a.exr against b.exr, 4x6", "  settings    mode mis / explicit", str(compare(A, B))]
    assert printed.splitlines() == "\n".join(lines).splitlines()
    assert complaint == ""
    assert files() == ["a.exr", "b.exr", "good.toml"]


def test_an_array_is_a_picture_too(capsys: pytest.CaptureFixture[str]) -> None:
    np.save("a.npy", A.astype(np.float64))
    assert cli.main(["compare", "a.npy", "b.exr"]) == 0
    assert "settings    unknown of A\n" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("output", "written"),
    [
        ("e.png", ["e.png"]),
        ("e.exr", ["e.exr"]),
        ("here", ["here/error.exr", "here/error.png"]),
        ("new/folder", ["new/folder/error.exr", "new/folder/error.png"]),
        ("with.suffix", ["with.suffix/error.exr", "with.suffix/error.png"]),
    ],
)
def test_the_error_is_written_and_its_colours_explained(
    output: str, written: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    Path("here").mkdir()
    Path("with.suffix").mkdir()
    assert cli.main(["compare", "a.exr", "b.exr", "-o", output]) == 0
    last = capsys.readouterr().out.splitlines()[-len(written) :]
    share = f"{100 * 0.1 / np.sqrt(0.4**2 + 0.01):.3g} %"
    for path, line in zip(written, last, strict=True):
        assert Path(path).is_file()
        assert line.startswith(f"{path}: ")
        assert (f"from -{share} (blue)" in line) == path.endswith(".png")


def test_the_error_is_relative(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["compare", "a.exr", "b.exr", "-o", "e.exr"]) == 0
    np.testing.assert_array_equal(read_exr("e.exr")[0], compare(A, B).error.astype(np.float32))


@pytest.mark.parametrize(
    ("argv", "says"),
    [
        (["no.exr", "b.exr"], "no.exr: No such file or directory"),
        (["a.exr", "good.toml"], "good.toml: a picture to read must end with .exr or .npy"),
        (["a.exr", "small.exr"], "reference: its size is 1x1, and the image's is 4x6"),
        (["grey.npy", "b.exr"], "grey.npy: its array is float32 (6, 4); it must be"),
        (["a.exr", "b.exr", "-o", "no/e.png"], "no/e.png: the folder no does not exist"),
        (["a.exr", "b.exr", "-o", "e.jpg"], "e.jpg: the name of a picture must end with"),
        (["a.exr", "b.exr", "-o", "file"], "file: this is a file, and neither a folder nor .exr"),
        (["a.exr"], "the following arguments are required: B"),
    ],
)
def test_bad_input_is_refused(
    argv: list[str], says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    write("small.exr", A[:1, :1], {})
    np.save("grey.npy", A[..., 0])
    Path("file").touch()
    before = files()
    assert status_of(cli.main, ["compare", *argv]) == 2
    printed, complaint = capsys.readouterr()
    assert printed == ""
    assert complaint.startswith(f"drpt compare: error: {says}")
    assert complaint.count("\n") == 1
    assert files() == before
