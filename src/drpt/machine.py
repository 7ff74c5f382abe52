"""What the machine lends: processor time and CUDA, asked for without Dr.Jit."""

from __future__ import annotations

import ctypes
import os
from contextlib import suppress
from pathlib import Path

CUDA_VARIABLE = "DRJIT_LIBCUDA_PATH"
"""The environment variable that names CUDA's driver library for Dr.Jit."""


def usable_cores() -> int:
    """Cores that this process may run on."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def core_quota(root: Path = Path("/")) -> float | None:
    """Cores' worth of time that the control group, such as a container, may take, if limited.

    ``root`` is that of the file system. Source: Linux's documentation of control groups, versions 1
    and 2, whose groups inherit the limits of those above.
    """
    quotas = []
    for folder in _group_folders(root):
        with suppress(OSError, ValueError):  # no such limit
            if (folder / "cpu.max").exists():
                quota, period = (folder / "cpu.max").read_text().split()
            else:
                quota = (folder / "cpu.cfs_quota_us").read_text()
                period = (folder / "cpu.cfs_period_us").read_text()
            quotas.append(float(quota) / float(period))
    return min((quota for quota in quotas if quota > 0), default=None)


def _group_folders(root: Path) -> list[Path]:
    """Folders of the control groups of this process that may limit its time."""
    try:
        lines = (root / "proc/self/cgroup").read_text().splitlines()
    except OSError:  # no Linux
        return []
    folders = []
    for line in lines:
        _, controllers, group = line.split(":", 2)
        if not controllers or "cpu" in controllers.split(","):
            group_path = Path(group.lstrip("/"))
            top = root / "sys/fs/cgroup" / controllers
            folders += [top / part for part in (group_path, *group_path.parents)]
    return folders


def cuda_trouble() -> str | None:
    """Why CUDA's driver offers no GPU; None if it offers one."""
    library = os.environ.get(CUDA_VARIABLE) or "libcuda.so.1"
    try:
        cuda = ctypes.CDLL(library)
        status = cuda.cuInit(0)
    except (OSError, AttributeError) as error:
        return f"no NVIDIA driver ({error})"
    if status == 0:
        return None
    name = ctypes.c_char_p()
    cuda.cuGetErrorName(status, ctypes.byref(name))
    return f"the NVIDIA driver says {(name.value or str(status).encode()).decode()}"
