"""`drpt merge`: what is written and printed, and bad input."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from drpt import cli
from drpt.merging import merge
from drpt.output import read, write
from tests.cli.running import files, status_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

METADATA: dict[str, str | int | float] = {"scene": "s", "bounces": 3, "jitter": True, "spp": 16}
IMAGE = np.linspace(0, 2, 72, dtype=np.float32).reshape(6, 4, 3)
LAYERS: dict[str, NDArray[Any]] = {
    "standard_error": IMAGE / 10,
    "samples": np.full((6, 4), 16, np.float32),
    "albedo": IMAGE / 2,
    "normal": -IMAGE,
    "depth": IMAGE[..., 0],
}


@pytest.fixture(autouse=True)
def renders() -> None:
    for seed, name in enumerate(("a.exr", "b.exr")):
        write(name, (1 + seed) * IMAGE, {**METADATA, "seed": seed}, layers=LAYERS)


def test_all_layers_are_merged_and_written(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["merge", "a.exr", "b.exr", "-o", "c.exr"]) == 0
    layers, metadata = read("c.exr")
    expected, facts = merge(["a.exr", "b.exr"])
    assert metadata == facts
    assert layers.keys() == {"RGB", *LAYERS}
    for name, layer in layers.items():
        np.testing.assert_array_equal(layer, expected[name])
    error = f"relMSE {metadata['error']:.2g}"
    assert capsys.readouterr() == (f"4x6  32 spp  2 seeds  {error}\nc.exr\n", "")


def test_a_single_render_is_told_in_the_singular(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["merge", "a.exr", "-o", "c.exr"]) == 0
    assert "  1 seed  " in capsys.readouterr().out


def test_an_unknown_error_is_called_so(capsys: pytest.CaptureFixture[str]) -> None:
    write("a.exr", IMAGE, {**METADATA, "seed": 2})
    assert cli.main(["merge", "a.exr", "b.exr", "-o", "a.exr"]) == 0
    assert "2 seeds  relMSE unknown\n" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("argv", "says"),
    [
        (["no.exr", "-o", "c.exr"], "no.exr: No such file or directory"),
        (["a.exr", "a.exr", "-o", "c.exr"], "a.exr: its seed 0 is in a.exr, too"),
        (["a.exr", "good.toml", "-o", "c.exr"], "good.toml: a picture to read must end with"),
        (["plain.npy", "-o", "c.exr"], "plain.npy: this is no render: its metadata has no scene"),
        (["a.exr", "b.exr", "-o", "c.png"], "c.png: the name of a merged picture must end with"),
        (["a.exr", "b.exr", "-o", "no/c.exr"], "no/c.exr: the folder no does not exist"),
        (["a.exr", "b.exr"], "the following arguments are required: -o/--output"),
        (["-o", "c.exr"], "the following arguments are required: IN"),
    ],
)
def test_bad_input_is_refused(
    argv: list[str], says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    np.save("plain.npy", IMAGE)
    before = files()
    assert status_of(cli.main, ["merge", *argv]) == 2
    printed, complaint = capsys.readouterr()
    assert printed == ""
    assert complaint.startswith(f"drpt merge: error: {says}")
    assert complaint.count("\n") == 1
    assert files() == before
