"""Pictures on disk: what is written is read back, and what cannot be is refused before."""

from __future__ import annotations

import errno
import math
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image

from drpt.output import SUFFIXES, check_target, read, write
from tests.output.pictures import METADATA, grey

if TYPE_CHECKING:
    from numpy.typing import NDArray

# A picture may be copied once while it is written; the rest is code and buffers.
MEMORY_FACTOR = 1.5


def test_png_holds_the_metadata_as_text(tmp_path: Path) -> None:
    write(tmp_path / "a.png", grey(0), METADATA)
    with Image.open(tmp_path / "a.png") as picture:
        assert picture.info["drpt:mode"] == "explicit"
        assert picture.info["drpt:rays"] == str(2**40 + 1)
        assert picture.info["drpt:comment"] == ""


def test_npy_gives_back_the_same_bits(tmp_path: Path, image: NDArray[np.float32]) -> None:
    write(tmp_path / "a.npy", image, METADATA)
    read = np.load(tmp_path / "a.npy")
    np.testing.assert_array_equal(read.view(np.uint32), image.view(np.uint32))


class TestRead:
    def test_gives_back_layers_and_metadata(
        self, tmp_path: Path, image: NDArray[np.float32]
    ) -> None:
        write(tmp_path / "a.EXR", image, METADATA, layers={"more": -image})
        layers, metadata = read(tmp_path / "a.EXR")
        assert layers.keys() == {"RGB", "more"}
        np.testing.assert_array_equal(layers["RGB"], image)
        np.testing.assert_array_equal(layers["more"], -image)
        assert metadata == METADATA

    @pytest.mark.parametrize("kind", [np.float16, np.float32, np.float64, ">f4"])
    def test_takes_all_floats_of_an_npy(self, tmp_path: Path, kind: Any) -> None:
        array = np.arange(12).reshape(2, 2, 3).astype(kind)
        np.save(tmp_path / "a.npy", array)
        layers, metadata = read(tmp_path / "a.npy")
        assert layers["RGB"].dtype == np.float32
        np.testing.assert_array_equal(layers["RGB"], array)
        assert metadata == {}

    @pytest.mark.parametrize(
        ("array", "says"),
        [
            (np.zeros((4, 5)), r"its array is float64 \(4, 5\); it must be of floats"),
            (np.zeros((4, 5, 4)), r"its array is float64 \(4, 5, 4\)"),
            (np.zeros((0, 5, 3)), r"its array is float64 \(0, 5, 3\)"),
            (np.zeros((4, 5, 3), np.uint8), "its array is uint8"),
            (np.zeros((4, 5, 3), complex), "its array is complex128"),
            (np.array([[[None, 1, 2]]]), "this is not a readable NPY file"),
            (np.full((4, 5, 3), 1e39), "its values are too large for float32"),
        ],
    )
    def test_refuses_an_npy_that_is_no_picture(
        self, tmp_path: Path, array: NDArray[Any], says: str
    ) -> None:
        np.save(tmp_path / "a.npy", array)
        with pytest.raises(ValueError, match=rf"a\.npy: {says}"):
            read(tmp_path / "a.npy")

    def test_refuses_a_file_that_is_cut_off(self, tmp_path: Path) -> None:
        np.save(tmp_path / "a.npy", grey(1))
        whole = (tmp_path / "a.npy").read_bytes()
        for size in (0, 5, 100, len(whole) - 1):
            (tmp_path / "a.npy").write_bytes(whole[:size])
            with pytest.raises(ValueError, match=r"a\.npy: this is not a readable NPY file"):
                read(tmp_path / "a.npy")

    @pytest.mark.parametrize("name", ["a.exr", "a.npy"])
    def test_refuses_a_missing_file(self, tmp_path: Path, name: str) -> None:
        with pytest.raises(FileNotFoundError):
            read(tmp_path / name)

    @pytest.mark.parametrize("name", ["a.png", "a"])
    def test_refuses_other_formats(self, tmp_path: Path, name: str) -> None:
        write(tmp_path / "a.png", grey(0), {})
        with pytest.raises(ValueError, match=r"a picture to read must end with \.exr or \.npy"):
            read(tmp_path / name)


class TestCheckTarget:
    @pytest.mark.parametrize("name", ["a.exr", "a.PNG", "a b.npy"])
    def test_accepts_what_can_be_written(self, tmp_path: Path, name: str) -> None:
        check_target(tmp_path / name)
        assert list(tmp_path.iterdir()) == []

    def test_accepts_a_file_in_the_current_folder(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.chdir(tmp_path)
        check_target("a.exr")

    @pytest.mark.parametrize("name", ["a.jpg", "a", "exr", "a.exr.bak", ".exr"])
    def test_refuses_an_unknown_suffix(self, tmp_path: Path, name: str) -> None:
        with pytest.raises(ValueError, match=r"must end with \.exr, \.png, \.npy"):
            check_target(tmp_path / name)

    @pytest.mark.parametrize("exposure", [math.nan, math.inf, -101])
    def test_refuses_an_exposure_out_of_range(self, tmp_path: Path, exposure: float) -> None:
        with pytest.raises(ValueError, match=r"exposure: .* stops from -100 to 100"):
            check_target(tmp_path / "a.png", exposure=exposure)

    @pytest.mark.parametrize("exposure", ["1", None, 1j])
    def test_refuses_an_exposure_that_is_no_number(self, tmp_path: Path, exposure: Any) -> None:
        with pytest.raises(ValueError, match=r"exposure: .* stops from -100 to 100"):
            check_target(tmp_path / "a.png", exposure=exposure)

    @pytest.mark.parametrize("curve", ["aces", "", None])
    def test_refuses_an_unknown_curve(self, tmp_path: Path, curve: Any) -> None:
        with pytest.raises(ValueError, match=r"curve: .* must be one of srgb, filmic"):
            check_target(tmp_path / "a.png", curve=curve)

    @pytest.mark.parametrize("path", [None, 3, b"a.png"])
    def test_refuses_what_is_no_path(self, path: Any) -> None:
        with pytest.raises(ValueError, match="must be the path of a picture"):
            check_target(path)

    def test_refuses_a_missing_folder(self, tmp_path: Path) -> None:
        with pytest.raises(FileNotFoundError, match=r"the folder .*missing does not exist"):
            check_target(tmp_path / "missing" / "a.exr")

    def test_refuses_a_file_as_folder(self, tmp_path: Path) -> None:
        (tmp_path / "file").touch()
        with pytest.raises(NotADirectoryError, match="file is not a folder"):
            check_target(tmp_path / "file" / "a.exr")

    def test_refuses_a_folder_as_picture(self, tmp_path: Path) -> None:
        (tmp_path / "a.exr").mkdir()
        with pytest.raises(IsADirectoryError, match="this is a folder"):
            check_target(tmp_path / "a.exr")

    @pytest.mark.parametrize("link", [False, True])
    def test_refuses_a_pipe_as_picture(self, tmp_path: Path, link: bool) -> None:
        path = tmp_path / "a.exr"
        os.mkfifo(tmp_path / "pipe" if link else path)
        if link:
            path.symlink_to(tmp_path / "pipe")
        with pytest.raises(OSError, match="a pipe or a device, and it must be a file"):
            check_target(path)

    def test_refuses_a_link_into_a_missing_folder(self, tmp_path: Path) -> None:
        (tmp_path / "a.exr").symlink_to(tmp_path / "missing" / "a.exr")
        with pytest.raises(FileNotFoundError, match=r"the folder .*missing does not exist"):
            check_target(tmp_path / "a.exr")

    def test_refuses_a_folder_without_permission(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        # Root may write anywhere, so that a real folder would not do.
        def refuse(*_: object, **__: object) -> None:
            raise PermissionError(errno.EACCES, "Permission denied")

        monkeypatch.setattr(tempfile, "TemporaryFile", refuse)
        with pytest.raises(PermissionError, match="Permission denied"):
            check_target(tmp_path / "a.exr")

    @pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
    def test_refuses_a_full_disk(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        full = lambda **_: open("/dev/full", "wb", 0)  # noqa: E731, SIM115
        monkeypatch.setattr(tempfile, "TemporaryFile", full)
        with pytest.raises(OSError, match="No space left"):
            check_target(tmp_path / "a.exr")

    def test_is_what_write_does_first(self, tmp_path: Path) -> None:
        with pytest.raises(ValueError, match="must end with"):
            write(tmp_path / "a.jpg", grey(0), {})
        with pytest.raises(ValueError, match="exposure"):
            write(tmp_path / "a.png", grey(0), {}, exposure=math.nan)
        with pytest.raises(ValueError, match="curve"):
            write(tmp_path / "a.png", grey(0), {}, curve="aces")
        assert list(tmp_path.iterdir()) == []


def test_importing_loads_no_library_of_pictures() -> None:
    code = "import sys, drpt.output; print({'PIL', 'OpenEXR'} & set(sys.modules))"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout == "set()\n"


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="peak memory is read in /proc")
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_large_picture_is_written_in_little_memory(tmp_path: Path, suffix: str) -> None:
    script = f"""
import numpy as np
from pathlib import Path
from drpt.output import write

def peak():
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) * 1024 for line in lines if line.startswith("VmHWM"))

write({str(tmp_path / f"small{suffix}")!r}, np.zeros((64, 64, 3), np.float32), {{}})
image = np.random.default_rng(1).random((1536, 1536, 3), np.float32)
before = peak()
write({str(tmp_path / f"large{suffix}")!r}, image, {{}})
print((peak() - before) / image.nbytes)
"""
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert float(run.stdout) < MEMORY_FACTOR
