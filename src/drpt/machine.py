"""What the machine lends: processor time and CUDA, asked for without Dr.Jit."""

from __future__ import annotations

import ctypes
import os
from contextlib import suppress
from pathlib import Path

from drpt.messages import size_in_words

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
    for folder in _group_folders(root, "cpu"):
        with suppress(OSError, ValueError):  # no such limit
            if (folder / "cpu.max").exists():
                quota, period = (folder / "cpu.max").read_text().split()
            else:
                quota = (folder / "cpu.cfs_quota_us").read_text()
                period = (folder / "cpu.cfs_period_us").read_text()
            quotas.append(float(quota) / float(period))
    return min((quota for quota in quotas if quota > 0), default=None)


def free_memory(root: Path = Path("/")) -> int:
    """Bytes of memory that this process can allocate now.

    This is the least of the machine's free memory, the rest of the process's control groups, and
    the rest of its limit of address space.

    Source: proc_meminfo(5), and Linux's documentation of control groups, as for `core_quota`.
    """
    free = [_machine_memory(root)]
    for folder in _group_folders(root, "memory"):
        with suppress(OSError, ValueError):  # no such limit
            free.append(_group_memory(folder))
    with suppress(ImportError, OSError, ValueError):  # Windows has no such limits
        import resource

        limit, _ = resource.getrlimit(resource.RLIMIT_AS)
        pages = int((root / "proc/self/statm").read_text().split()[0])
        if limit != resource.RLIM_INFINITY:
            free.append(limit - pages * resource.getpagesize())
    return max(0, min(free))


def require_memory(needed: int, what: str) -> None:
    """Raise `ValueError` with both sizes if more memory is needed than is free, in bytes."""
    free = free_memory()
    if needed > free:
        sizes = f"{size_in_words(needed)} of memory, and {size_in_words(free)} are free"
        raise ValueError(f"{what} needs {sizes}")


def _machine_memory(root: Path) -> int:
    try:
        text = (root / "proc/meminfo").read_text()
        kibibytes = next(line for line in text.splitlines() if line.startswith("MemAvailable:"))
        return 1024 * int(kibibytes.split()[1])
    except (OSError, StopIteration):  # no Linux
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")


def _group_memory(folder: Path) -> int:
    """Bytes that a control group has left, including pages of files that it can reclaim."""
    if (folder / "memory.max").exists():
        limit, used, cache = "memory.max", "memory.current", "inactive_file"
    else:
        limit, used = "memory.limit_in_bytes", "memory.usage_in_bytes"
        cache = "total_inactive_file"
    pairs = (line.split() for line in (folder / "memory.stat").read_text().splitlines())
    given_up = sum(int(value) for name, value in pairs if name == cache)
    return int((folder / limit).read_text()) - int((folder / used).read_text()) + given_up


def _group_folders(root: Path, controller: str) -> list[Path]:
    """Folders of the control groups of this process that may limit what it takes."""
    try:
        lines = (root / "proc/self/cgroup").read_text().splitlines()
    except OSError:  # no Linux
        return []
    folders = []
    for line in lines:
        _, controllers, group = line.split(":", 2)
        if not controllers or controller in controllers.split(","):
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
