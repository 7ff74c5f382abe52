"""Pictures on disk: what is written is read back, and nothing is ever half-written."""

from __future__ import annotations

import math
import os
import resource
import stat
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import OpenEXR
import pytest
from PIL import Image

from drpt.output import SUFFIXES, check_target, read_exr, write

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

# Picture values halfway between two levels, this far apart from the middle in levels: a float32
# near 1 resolves 255 * 2^-24 = 1.5e-5 levels, and sRGB is at most 12.92 times steeper.
HALF_LEVEL = 0.5 - 1e-3

# A picture may be copied once while it is written; the rest is code and buffers.
MEMORY_FACTOR = 1.5

METADATA: dict[str, str | int | float] = {
    "scene": "cornell-box",
    "mode": "explicit",
    "comment": "",
    "spp": 256,
    "seed": -1,
    "rays": 2**40 + 1,
    "seconds": 0.1,
    "tiny": 5e-324,
    "text that looks like a number": "12",
    "text that looks like JSON": '{"a": [true]}',
    "quoted": '"12"',
    "name": "Küche\nλ",
    "name that is no Unicode": os.fsdecode(b"k\xfcche"),
}


@pytest.fixture
def image() -> NDArray[np.float32]:
    """Values over the whole range of float32, and those that are not finite; h != w."""
    rng = np.random.default_rng(1)
    values = rng.standard_normal((5, 7, 3)) * 10.0 ** rng.uniform(-44, 38, (5, 7, 3))
    values[1, 2] = (np.nan, np.inf, -np.inf)
    return values.astype(np.float32)


@pytest.fixture
def small_file_limit() -> Iterator[None]:
    """No file may grow beyond 20 kB, as on a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, hard))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def grey(value: float) -> NDArray[np.float32]:
    return np.full((2, 2, 3), value, np.float32)


def linear(level: float) -> float:
    """Return the linear value of an sRGB level in [0, 255]."""
    encoded = level / 255
    return encoded / 12.92 if encoded <= 0.04045 else ((encoded + 0.055) / 1.055) ** 2.4


def png_levels(path: Path, image: NDArray[np.float32], exposure: float = 0.0) -> NDArray[np.uint8]:
    write(path, image, {}, exposure=exposure)
    with Image.open(path) as picture:
        assert picture.mode == "RGB"
        return np.asarray(picture)


class TestExr:
    def test_gives_back_the_same_bits(self, tmp_path: Path, image: NDArray[np.float32]) -> None:
        write(tmp_path / "a.exr", image, {})
        read, metadata = read_exr(tmp_path / "a.exr")
        assert read.dtype == np.float32
        np.testing.assert_array_equal(read.view(np.uint32), image.view(np.uint32))
        assert metadata == {}

    def test_gives_back_the_metadata_with_its_types(self, tmp_path: Path) -> None:
        write(tmp_path / "a.exr", grey(0), METADATA)
        _, metadata = read_exr(tmp_path / "a.exr")
        assert metadata == METADATA
        assert {k: type(v) for k, v in metadata.items()} == {
            k: type(v) for k, v in METADATA.items()
        }

    def test_gives_back_numbers_that_are_not_finite(self, tmp_path: Path) -> None:
        write(tmp_path / "a.exr", grey(0), {"nan": math.nan, "inf": -math.inf})
        _, metadata = read_exr(tmp_path / "a.exr")
        assert metadata["inf"] == -math.inf
        assert isinstance(metadata["nan"], float)
        assert math.isnan(metadata["nan"])

    def test_is_what_other_programs_expect(
        self, tmp_path: Path, image: NDArray[np.float32]
    ) -> None:
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

    def test_accepts_an_array_that_is_not_contiguous(
        self, tmp_path: Path, image: NDArray[np.float32]
    ) -> None:
        turned = image[::-1].swapaxes(0, 1)
        write(tmp_path / "a.exr", turned, {})
        np.testing.assert_array_equal(read_exr(tmp_path / "a.exr")[0], turned)

    def test_of_another_program_is_read(self, tmp_path: Path) -> None:
        half = np.arange(24, dtype=np.float16).reshape(2, 3, 4)
        path = tmp_path / "a.exr"
        OpenEXR.File({"owner": "x"}, {"RGBA": half}).write(str(path))
        read, metadata = read_exr(path)
        assert read.dtype == np.float32
        np.testing.assert_array_equal(read, half[..., :3])
        assert metadata == {}

    def test_that_is_missing_or_broken_is_refused(self, tmp_path: Path) -> None:
        with pytest.raises(FileNotFoundError):
            read_exr(tmp_path / "a.exr")
        (tmp_path / "a.exr").write_text("no picture")
        with pytest.raises(ValueError, match=r"a\.exr: this is not a readable EXR file"):
            read_exr(tmp_path / "a.exr")

    def test_without_colours_is_refused(self, tmp_path: Path) -> None:
        path = tmp_path / "a.exr"
        OpenEXR.File({}, {"Z": np.zeros((2, 3), np.float32)}).write(str(path))
        with pytest.raises(ValueError, match="its channels are Z, not R, G and B"):
            read_exr(path)


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

    def test_holds_the_metadata_as_text(self, tmp_path: Path) -> None:
        write(tmp_path / "a.png", grey(0), METADATA)
        with Image.open(tmp_path / "a.png") as picture:
            assert picture.info["drpt:mode"] == "explicit"
            assert picture.info["drpt:rays"] == str(2**40 + 1)
            assert picture.info["drpt:comment"] == ""


def test_npy_gives_back_the_same_bits(tmp_path: Path, image: NDArray[np.float32]) -> None:
    write(tmp_path / "a.npy", image, METADATA)
    read = np.load(tmp_path / "a.npy")
    np.testing.assert_array_equal(read.view(np.uint32), image.view(np.uint32))


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
        with pytest.raises(OSError, match="a pipe or a device, and a picture must be a file"):
            check_target(path)

    def test_refuses_a_link_into_a_missing_folder(self, tmp_path: Path) -> None:
        (tmp_path / "a.exr").symlink_to(tmp_path / "missing" / "a.exr")
        with pytest.raises(FileNotFoundError, match=r"the folder .*missing does not exist"):
            check_target(tmp_path / "a.exr")

    def test_refuses_a_folder_without_permission(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        # Root may write anywhere, so that a real folder would not do.
        monkeypatch.setattr(os, "access", lambda place, mode: Path(place) != tmp_path)
        with pytest.raises(PermissionError, match="may not be written to"):
            check_target(tmp_path / "a.exr")

    def test_is_what_write_does_first(self, tmp_path: Path) -> None:
        with pytest.raises(ValueError, match="must end with"):
            write(tmp_path / "a.jpg", grey(0), {})
        with pytest.raises(ValueError, match="exposure"):
            write(tmp_path / "a.png", grey(0), {}, exposure=math.nan)
        assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("suffix", SUFFIXES)
class TestReplacing:
    def test_a_failure_leaves_the_old_picture(
        self, tmp_path: Path, suffix: str, small_file_limit: None
    ) -> None:
        path = tmp_path / f"a{suffix}"
        path.write_text("old")
        noise = np.random.default_rng(1).random((100, 100, 3), np.float32)
        with pytest.raises(OSError, match=rf"a\{suffix}: it could not be written \(.+\)"):
            write(path, noise, {})
        assert path.read_text() == "old"
        assert list(tmp_path.iterdir()) == [path]

    def test_an_interrupt_leaves_nothing(
        self, tmp_path: Path, suffix: str, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def interrupt(_: int) -> None:
            raise KeyboardInterrupt

        monkeypatch.setattr(os, "fsync", interrupt)
        with pytest.raises(KeyboardInterrupt):
            write(tmp_path / f"a{suffix}", grey(0), {})
        assert list(tmp_path.iterdir()) == []

    def test_a_success_leaves_the_new_picture_alone(self, tmp_path: Path, suffix: str) -> None:
        path = tmp_path / f"a{suffix}"
        write(path, grey(0), {})
        old = path.read_bytes()
        write(path, grey(1), {})
        assert path.read_bytes() != old
        assert list(tmp_path.iterdir()) == [path]

    def test_permissions_follow_the_umask(self, tmp_path: Path, suffix: str) -> None:
        path = tmp_path / f"a{suffix}"
        umask = os.umask(0o027)
        try:
            write(path, grey(0), {})
        finally:
            os.umask(umask)
        assert stat.S_IMODE(path.stat().st_mode) == 0o640

    def test_a_link_stays_one(self, tmp_path: Path, suffix: str) -> None:
        link, path = tmp_path / f"link{suffix}", tmp_path / f"a{suffix}"
        link.symlink_to(path)
        write(link, grey(0), {})
        assert link.is_symlink()
        assert path.is_file()


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
