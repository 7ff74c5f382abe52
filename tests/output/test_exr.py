"""EXR files: the same bits, and metadata with its types."""

from __future__ import annotations

import io
import math
import struct
from typing import TYPE_CHECKING, Any

import numpy as np
import OpenEXR
import pytest

from drpt.output import read, read_exr, read_exr_layers, write
from tests.output.pictures import METADATA, grey

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray


def test_gives_back_the_same_bits(tmp_path: Path, image: NDArray[np.float32]) -> None:
    write(tmp_path / "a.exr", image, {})
    read, metadata = read_exr(tmp_path / "a.exr")
    assert read.dtype == np.float32
    np.testing.assert_array_equal(read.view(np.uint32), image.view(np.uint32))
    assert metadata == {}


def test_gives_back_the_metadata_with_its_types(tmp_path: Path) -> None:
    write(tmp_path / "a.exr", grey(0), METADATA)
    _, metadata = read_exr(tmp_path / "a.exr")
    assert metadata == METADATA
    assert {k: type(v) for k, v in metadata.items()} == {k: type(v) for k, v in METADATA.items()}


def test_gives_back_numbers_that_are_not_finite(tmp_path: Path) -> None:
    write(tmp_path / "a.exr", grey(0), {"nan": math.nan, "inf": -math.inf})
    _, metadata = read_exr(tmp_path / "a.exr")
    assert metadata["inf"] == -math.inf
    assert isinstance(metadata["nan"], float)
    assert math.isnan(metadata["nan"])


def test_is_what_other_programs_expect(tmp_path: Path, image: NDArray[np.float32]) -> None:
    write(tmp_path / "a.exr", image, METADATA)
    file = OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True)
    channels, header = file.channels(), file.header()
    assert sorted(channels) == ["B", "G", "R"]
    np.testing.assert_array_equal(channels["G"].pixels, image[..., 1])
    assert channels["G"].pixels.dtype == np.float32
    assert header["compression"] == OpenEXR.ZIP_COMPRESSION
    assert header["type"] == OpenEXR.scanlineimage
    assert header["drpt:mode"] == "explicit"
    assert header["drpt:spp"] == "256"
    assert header["drpt:comment"] == ""


class TestLayers:
    def test_of_all_shapes_come_back(self, tmp_path: Path, image: NDArray[np.float32]) -> None:
        colours = {name: image * scale for name, scale in (("albedo", 2), ("normal", 3), ("X", 5))}
        flat = {"samples": image[..., 0], "depth": image[..., 1], "A": image[..., 2]}
        write(tmp_path / "a.exr", image, {}, layers={**colours, **flat})
        layers, _ = read(tmp_path / "a.exr")
        assert layers.keys() == {"RGB", *colours, *flat}
        for name, layer in {"RGB": image, **colours, **flat}.items():
            assert layers[name].dtype == np.float32
            np.testing.assert_array_equal(layers[name], layer)

    def test_have_the_channels_of_other_renderers(self, tmp_path: Path) -> None:
        layers = {"albedo": grey(1), "normal": grey(2), "depth": grey(3)[..., 0]}
        write(tmp_path / "a.exr", grey(0), {}, layers={**layers, "samples": grey(4)[..., 0]})
        channels = OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True).channels()
        values = {name: float(channel.pixels.mean()) for name, channel in channels.items()}
        assert values == {
            **dict.fromkeys(("R", "G", "B"), 0),
            **dict.fromkeys(("albedo.R", "albedo.G", "albedo.B"), 1),
            **dict.fromkeys(("normal.X", "normal.Y", "normal.Z"), 2),
            "depth.Z": 3,
            "samples": 4,
        }

    def test_of_another_program_are_written_as_they_were(self, tmp_path: Path) -> None:
        """Whatever they are called: alpha, positions, an incomplete layer, colour in ours."""
        names = ("R", "G", "B", "A", "P.X", "P.Y", "P.Z", "v.R", "v.B", "depth.R", "c.R", "c.G")
        channels = {name: np.full((2, 3), n, np.float32) for n, name in enumerate((*names, "c.B"))}
        OpenEXR.File({}, dict(channels)).write(str(tmp_path / "a.exr"))
        layers, metadata = read(tmp_path / "a.exr")
        assert {name for name, layer in layers.items() if layer.ndim == 3} == {"RGB", "c"}
        write(tmp_path / "b.exr", layers.pop("RGB"), metadata, layers=layers)
        written = OpenEXR.File(str(tmp_path / "b.exr"), separate_channels=True).channels()
        assert written.keys() == channels.keys()
        for name, plane in channels.items():
            np.testing.assert_array_equal(written[name].pixels, plane)


def test_accepts_an_array_that_is_not_contiguous(
    tmp_path: Path, image: NDArray[np.float32]
) -> None:
    turned = image[::-1].swapaxes(0, 1)
    write(tmp_path / "a.exr", turned, {})
    np.testing.assert_array_equal(read_exr(tmp_path / "a.exr")[0], turned)


def test_of_another_program_is_read(tmp_path: Path) -> None:
    half = np.arange(24, dtype=np.float16).reshape(2, 3, 4)
    path = tmp_path / "a.exr"
    OpenEXR.File({"owner": "x"}, {"RGBA": half}).write(str(path))
    read, metadata = read_exr(path)
    assert read.dtype == np.float32
    np.testing.assert_array_equal(read, half[..., :3])
    assert metadata == {}


def test_that_is_missing_or_broken_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        read_exr(tmp_path / "a.exr")
    (tmp_path / "a.exr").write_text("no picture")
    with pytest.raises(ValueError, match=r"a\.exr: this is not a readable EXR file"):
        read_exr(tmp_path / "a.exr")


def test_without_colours_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    OpenEXR.File({}, {"Z": np.zeros((2, 3), np.float32)}).write(str(path))
    with pytest.raises(ValueError, match="its channels are Z, not R, G and B"):
        read_exr(path)


def file_of(channels: dict[str, Any], attributes: dict[str, Any] | None = None) -> bytes:
    stream = io.BytesIO()
    layout = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION}
    OpenEXR.File({**layout, **(attributes or {})}, dict(channels)).write(stream)
    return stream.getvalue()


RGB = {letter: np.ones((6, 7), np.float32) for letter in "RGB"}
FLAT = np.full((6, 7), 2, np.float32)


def refusal(path: Path, capfd: pytest.CaptureFixture[str]) -> str:
    """Return the refusal of a file; nothing else may be printed, as OpenEXR does by itself."""
    with pytest.raises((ValueError, OSError)) as error:
        read_exr_layers(path)
    assert str(error.value).startswith(f"{path}: ")
    assert str(error.value).isprintable()
    assert capfd.readouterr() == ("", "")
    return str(error.value)


class TestOtherPrograms:
    @pytest.mark.parametrize(
        "channels",
        [
            {"normal": FLAT},
            {"depth": FLAT},
            {"RGB": FLAT, "RGB.R": FLAT, "RGB.G": FLAT, "RGB.B": FLAT},
            {"RGBA": FLAT, "A": FLAT, "Y": FLAT},
            {"normal": FLAT, "normal.X": FLAT, "normal.Y": FLAT, "normal.Z": FLAT},
            {"x.R": FLAT, "x.G": FLAT},
            {".R": FLAT, "R.": FLAT, "a.b.R": FLAT},
        ],
        ids=" ".join,
    )
    def test_layers_go_through_a_file(self, channels: dict[str, Any], tmp_path: Path) -> None:
        path = tmp_path / "a.exr"
        path.write_bytes(file_of({**RGB, **channels}))
        layers, _ = read_exr_layers(path)
        np.testing.assert_array_equal(layers["RGB"], np.ones((6, 7, 3)))
        write(tmp_path / "b.exr", layers.pop("RGB"), {}, layers=layers)
        again, _ = read_exr_layers(tmp_path / "b.exr")
        assert again.keys() == {"RGB", *layers}
        np.testing.assert_array_equal(again["RGB"], np.ones((6, 7, 3)))

    @pytest.mark.parametrize("attribute", [(1.0, 2.0), ["a", "b"]])
    def test_a_damaged_attribute_is_refused_with_its_file(
        self, attribute: Any, tmp_path: Path, capfd: pytest.CaptureFixture[str]
    ) -> None:
        path = tmp_path / "a.exr"
        path.write_bytes(file_of(RGB, {"drpt:spp": attribute}))
        assert "its spp is " in refusal(path, capfd)

    def test_attributes_that_are_no_text_are_refused(
        self, tmp_path: Path, capfd: pytest.CaptureFixture[str]
    ) -> None:
        path = tmp_path / "a.exr"
        content = file_of(RGB, {"drpt:scene": "abcdefgh"})
        path.write_bytes(content.replace(b"abcdefgh", b"ab\xff\xfe\x00\x1bgh"))
        refusal(path, capfd)


class TestDamage:
    def test_a_file_that_ends_early_is_one_line(
        self, tmp_path: Path, capfd: pytest.CaptureFixture[str]
    ) -> None:
        path, whole = tmp_path / "a.exr", file_of(RGB)
        for length in range(0, len(whole), 20):
            path.write_bytes(whole[:length])
            refusal(path, capfd)

    @pytest.mark.parametrize(
        ("width", "height"), [(65536, 65536), (10**5, 10**6), (7, 10**8), (2**28, 6), (2**28, 1)]
    )
    def test_a_size_that_the_file_cannot_hold_is_refused(
        self, width: int, height: int, tmp_path: Path, capfd: pytest.CaptureFixture[str]
    ) -> None:
        path = tmp_path / "a.exr"
        path.write_bytes(resized(file_of(RGB), width, height))
        assert f"{width}x{height} pixels in 3 channels" in refusal(path, capfd)

    def test_a_size_that_memory_cannot_hold_is_refused(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
    ) -> None:
        path = tmp_path / "a.exr"
        path.write_bytes(file_of(RGB))
        monkeypatch.setattr("drpt.machine.free_memory", lambda: 1000)
        assert "its picture needs 1.512 kB of memory, and 1 kB are free" in refusal(path, capfd)

    def test_a_layer_without_a_name_is_refused(self, tmp_path: Path) -> None:
        path = tmp_path / "a.exr"
        with pytest.raises(ValueError, match=r"a\.exr: no EXR file can hold this picture"):
            write(path, np.ones((6, 7, 3), np.float32), {}, layers={"": FLAT})
        assert not path.exists()


def resized(content: bytes, width: int, height: int) -> bytes:
    """A file whose header tells of another size."""
    mark = b"dataWindow\0box2i\0"
    start = content.index(mark) + len(mark) + 4
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    return content[:start] + window + content[start + len(window) :]
