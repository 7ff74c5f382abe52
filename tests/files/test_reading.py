"""Opening regular files, and reading no more of them than is allowed."""

from __future__ import annotations

import os
import socket
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

import drpt
from drpt.files import open_regular, read_bytes
from drpt.scene.files import MAX_BYTES

if TYPE_CHECKING:
    from collections.abc import Callable


def make_pipe(path: Path) -> None:
    os.mkfifo(path)


def make_socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(path))


def link_device(path: Path) -> None:
    path.symlink_to("/dev/zero")


@pytest.mark.parametrize("make", [Path.mkdir, make_pipe, make_socket, link_device])
@pytest.mark.parametrize("suffix", [".toml", ".obj", ".ply", ".npz"])
def test_what_is_no_regular_file_is_refused_at_once(
    make: Callable[[Path], None], suffix: str, tmp_path: Path
) -> None:
    path = tmp_path / f"a{suffix}"
    make(path)
    with pytest.raises(OSError, match="it must be a file"):
        open_regular(path)
    load = drpt.load_scene if suffix == ".toml" else drpt.Mesh.load
    with pytest.raises(drpt.SceneError, match=rf"a\{suffix}: it cannot be read: this is a .*file$"):
        load(path)


def test_a_file_is_read_up_to_a_size(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_bytes(bytes(1000))
    assert read_bytes(path, 1000) == bytes(1000)
    with pytest.raises(OSError, match="it has 1 kB, and it must have no more than 999 bytes"):
        read_bytes(path, 999)


def test_a_file_without_a_size_is_read_up_to_it_too() -> None:
    path = Path("/proc/self/maps")  # a regular file of 0 bytes, it says
    if not path.exists():
        pytest.skip("there is no /proc")
    assert path.stat().st_size == 0
    with pytest.raises(OSError, match="no more than 10 bytes"):
        read_bytes(path, 10)


def test_a_large_file_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    with open(path, "wb") as stream:
        stream.truncate(MAX_BYTES + 1)  # of which the disk holds nothing
    with pytest.raises(drpt.SceneError, match=r"a\.toml: it cannot be read: it has 67\.11 MB"):
        drpt.load_scene(path)


def test_a_null_in_a_name_is_an_error_of_the_system() -> None:
    with pytest.raises(OSError, match="null character"):
        open_regular("a\0b")
