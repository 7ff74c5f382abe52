"""Limits of processor time in all their spellings, and reasons for having no GPU."""

from __future__ import annotations

import ctypes
import os
from typing import TYPE_CHECKING

import pytest

from drpt import machine

if TYPE_CHECKING:
    from pathlib import Path

# The file of control groups, and files of limits.
QUOTAS = {
    "version 2": ("0::/\n", {"cpu.max": "150000 100000\n"}, 1.5),
    "a group above": (
        "0::/a/b\n",
        {"cpu.max": "max 100000\n", "a/cpu.max": "200000 100000\n", "a/b/cpu.max": "400000 100000"},
        2.0,
    ),
    "no limit": ("0::/a\n", {"cpu.max": "max 100000\n"}, None),
    "no files": ("0::/a\n", {}, None),
    "version 1": (
        "9:memory:/m\n3:cpu,cpuacct:/a\n0::/\n",
        {
            "cpu,cpuacct/a/cpu.cfs_quota_us": "50000\n",
            "cpu,cpuacct/a/cpu.cfs_period_us": "100000\n",
            "cpu,cpuacct/cpu.cfs_quota_us": "-1\n",
            "cpu,cpuacct/cpu.cfs_period_us": "100000\n",
        },
        0.5,
    ),
    "another controller": ("3:cpuset:/\n", {"cpuset/cpu.max": "100000 100000\n"}, None),
}


@pytest.mark.parametrize(("groups", "files", "quota"), QUOTAS.values(), ids=QUOTAS.keys())
def test_core_quota(
    tmp_path: Path, groups: str, files: dict[str, str], quota: float | None
) -> None:
    (tmp_path / "proc/self").mkdir(parents=True)
    (tmp_path / "proc/self/cgroup").write_text(groups)
    for name, text in files.items():
        file = tmp_path / "sys/fs/cgroup" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    assert machine.core_quota(tmp_path) == quota


def test_core_quota_of_a_system_without_groups(tmp_path: Path) -> None:
    assert machine.core_quota(tmp_path) is None


def test_usable_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 3, 5}, raising=False)
    assert machine.usable_cores() == 3
    monkeypatch.delattr(os, "sched_getaffinity")
    assert machine.usable_cores() == os.cpu_count()


class Driver:
    """CUDA's driver library, as far as it is asked."""

    def __init__(self, status: int) -> None:
        self.status = status

    def cuInit(self, flags: int) -> int:  # noqa: N802 -- its name
        assert flags == 0
        return self.status

    def cuGetErrorName(self, status: int, name: object) -> None:  # noqa: N802
        assert status == self.status
        ctypes.cast(name, ctypes.POINTER(ctypes.c_char_p))[0] = b"CUDA_ERROR_NO_DEVICE"  # type: ignore[arg-type]


class TestCudaTrouble:
    def test_is_a_missing_driver(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setenv("DRJIT_LIBCUDA_PATH", "/missing/libcuda.so")
        trouble = machine.cuda_trouble()
        assert trouble is not None
        assert trouble.startswith("no NVIDIA driver (/missing/libcuda.so: cannot open")

    def test_is_what_the_driver_says(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(ctypes, "CDLL", lambda _: Driver(100))
        assert machine.cuda_trouble() == "the NVIDIA driver says CUDA_ERROR_NO_DEVICE"

    def test_is_none_where_there_is_a_gpu(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(ctypes, "CDLL", lambda _: Driver(0))
        assert machine.cuda_trouble() is None
