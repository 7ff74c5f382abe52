"""Files are replaced whole, or not at all, by however many writers."""

from __future__ import annotations

import errno
import os
import resource
import stat
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

import numpy as np
import pytest

import drpt
from drpt.files import write_file, writing
from drpt.files.writing import ABANDONED_AFTER
from drpt.output import SUFFIXES, write
from tests.output.pictures import grey

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


@pytest.fixture
def small_file_limit() -> Iterator[None]:
    """No file may grow beyond 20 kB, as on a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, hard))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


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

    def test_the_mode_of_the_file_before_is_kept(self, tmp_path: Path, suffix: str) -> None:
        path = tmp_path / f"a{suffix}"
        for mode in (0o600, 0o664, 0o444):
            path.touch()
            path.chmod(mode)
            write(path, grey(0), {})
            assert stat.S_IMODE(path.stat().st_mode) == mode

    def test_a_link_stays_one(self, tmp_path: Path, suffix: str) -> None:
        link, path = tmp_path / f"link{suffix}", tmp_path / f"a{suffix}"
        link.symlink_to(path)
        write(link, grey(0), {})
        assert link.is_symlink()
        assert path.is_file()


WRITER = """
import sys, time
from pathlib import Path
from drpt.files import replacing
with replacing(Path(sys.argv[1])) as stream:
    stream.write(b"half")
    stream.flush()
    print("there", flush=True)
    time.sleep(60)
"""


def temporaries(folder: Path) -> list[Path]:
    return list(folder.glob(".drpt-*.tmp"))


@pytest.fixture
def half_written(tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    """A process that writes a file for a minute."""
    command = [sys.executable, "-c", WRITER, str(tmp_path / "a")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "there\n"
        yield process
        process.kill()


class TestAbandoned:
    def test_what_another_process_writes_stays_until_it_is_killed(
        self, tmp_path: Path, half_written: subprocess.Popen[str]
    ) -> None:
        write_file(tmp_path / "a", b"ours")
        assert len(temporaries(tmp_path)) == 1
        half_written.kill()
        half_written.wait()
        write_file(tmp_path / "b", b"ours, too")
        assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "b"]
        assert (tmp_path / "a").read_bytes() == b"ours"

    @pytest.mark.parametrize("name", [".drpt-01234567-89abcdef.tmp", ".drpt-0123456789abcdef.tmp"])
    def test_what_another_host_writes_goes_after_a_day(self, tmp_path: Path, name: str) -> None:
        foreign = tmp_path / name
        foreign.touch()
        write_file(tmp_path / "a", b"")
        assert foreign.exists()
        os.utime(foreign, (0, time.time() - ABANDONED_AFTER - 60))
        write_file(tmp_path / "a", b"")
        assert list(tmp_path.iterdir()) == [tmp_path / "a"]

    def test_without_locks_age_alone_decides(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def fail(_: int) -> bool:
            raise OSError(errno.ENOLCK, "No locks available")

        monkeypatch.setattr(writing, "try_lock", fail)
        stream, path = writing._create(tmp_path)
        stream.close()
        write_file(tmp_path / "a", b"")
        assert path.exists()
        os.utime(path, (0, time.time() - ABANDONED_AFTER - 60))
        write_file(tmp_path / "a", b"")
        assert not path.exists()

    def test_links_and_pipes_of_such_names_stay(self, tmp_path: Path) -> None:
        (tmp_path / ".drpt-link.tmp").symlink_to(tmp_path / "kept")
        (tmp_path / "kept").touch()
        os.mkfifo(tmp_path / ".drpt-pipe.tmp")
        write_file(tmp_path / "a", b"")
        assert {path.name for path in temporaries(tmp_path)} >= {".drpt-link.tmp"}
        assert (tmp_path / "kept").exists()


def test_many_threads_write_one_file_and_clean_its_folder(tmp_path: Path) -> None:
    path = tmp_path / "a"

    def write_often(number: int) -> None:
        for _ in range(25):
            write_file(path, bytes([number]) * 5000)
            assert len(set(path.read_bytes())) == 1

    with ThreadPoolExecutor(8) as pool:
        list(pool.map(write_often, range(8)))
    assert list(tmp_path.iterdir()) == [path]


def test_many_threads_save_one_scene(tmp_path: Path) -> None:
    mesh = drpt.Mesh(np.eye(3), [[0, 1, 2]], material=drpt.Diffuse(0.5))
    scene = drpt.Scene(drpt.Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), 40, 4, 3), [mesh])
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(lambda _: scene.save(tmp_path / "x.toml"), range(80)))
    assert drpt.load_scene(tmp_path / "x.toml") == scene
    assert len([path for path in tmp_path.rglob("*") if path.is_file()]) == 2
