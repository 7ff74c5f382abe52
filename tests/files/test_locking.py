"""Locks beside files."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from drpt.files import PathLock

if TYPE_CHECKING:
    from pathlib import Path


def test_one_holds_it_at_a_time(tmp_path: Path) -> None:
    first, second = PathLock(tmp_path / "lock"), PathLock(tmp_path / "lock")
    assert first.acquire()
    assert first.is_held
    assert not second.acquire()
    assert not second.is_held
    first.release()
    assert not first.is_held
    assert list(tmp_path.iterdir()) == []
    assert second.acquire()
    first.release()
    assert second.is_held
    assert not PathLock(tmp_path / "lock").acquire()
    second.release()


def test_it_ends_with_its_object(tmp_path: Path) -> None:
    lock = PathLock(tmp_path / "lock")
    assert lock.acquire()
    del lock
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_was_left_is_no_lock(tmp_path: Path) -> None:
    (tmp_path / "lock").touch()
    lock = PathLock(tmp_path / "lock")
    assert lock.acquire()
    lock.release()
    assert list(tmp_path.iterdir()) == []


def test_a_lock_of_another_file_of_the_name_is_left_alone(tmp_path: Path) -> None:
    """As after the folder was removed and made again."""
    first, second = PathLock(tmp_path / "lock"), PathLock(tmp_path / "lock")
    assert first.acquire()
    (tmp_path / "lock").unlink()
    assert second.acquire()
    first.release()
    assert (tmp_path / "lock").exists()
    assert not PathLock(tmp_path / "lock").acquire()
    second.release()


def test_a_fork_does_not_release_it(tmp_path: Path) -> None:
    lock = PathLock(tmp_path / "lock")
    assert lock.acquire()
    child = os.fork()
    if not child:
        lock.release()
        os._exit(0)
    os.waitpid(child, 0)
    assert not PathLock(tmp_path / "lock").acquire()
    lock.release()
