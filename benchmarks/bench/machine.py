"""What the figures were measured on and with."""

from __future__ import annotations

import os
import platform
from pathlib import Path
from typing import Any

from drpt import distribution
from drpt.kernel import backend

PACKAGES = ("drjit", "mitsuba", "numpy")
CPU_INFO = Path("/proc/cpuinfo")


def machine() -> dict[str, Any]:
    """Processor, cores, backend and vector width; loads the backend."""
    found = backend.describe()
    return {
        "cpu": cpu_model(CPU_INFO.read_text() if CPU_INFO.exists() else ""),
        "cores": os.cpu_count(),
        "threads": found.threads,
        "backend": found.name,
        "vector_width": found.vector_width,
        "llvm": found.llvm_version,
        "system": platform.platform(),
    }


def versions() -> dict[str, str]:
    """Versions of Python and of what computes."""
    return {"python": platform.python_version(), **distribution.versions(*PACKAGES)}


def cpu_model(cpu_info: str) -> str:
    """The processor's name in the text of ``/proc/cpuinfo``, or what Python knows of it."""
    for line in cpu_info.splitlines():
        if line.startswith("model name"):
            return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
