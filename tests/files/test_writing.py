"""Pictures are replaced whole, or not at all."""

from __future__ import annotations

import os
import resource
import stat
from typing import TYPE_CHECKING

import numpy as np
import pytest

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

    def test_a_link_stays_one(self, tmp_path: Path, suffix: str) -> None:
        link, path = tmp_path / f"link{suffix}", tmp_path / f"a{suffix}"
        link.symlink_to(path)
        write(link, grey(0), {})
        assert link.is_symlink()
        assert path.is_file()
