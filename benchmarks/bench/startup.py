"""Whole processes from a shell: seconds, with a cold and a warm kernel cache, and memory."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import TYPE_CHECKING, Any, NamedTuple

from drpt.kernel.llvm import VARIABLE

if TYPE_CHECKING:
    from benchmarks.bench.effort import Effort

DRPT, MITSUBA = (Path(sys.executable).with_name(name) for name in ("drpt-render", "mitsuba"))
SCENE, SPP, BOUNCES = "cornell-box", 64, 3
"""Bounces are those that drpt-render takes by default."""
RUNS = 7
MEMORY_SPP = (16, 64)
"""At 1920x1080, where passes have 16 samples: what 64 need beyond 16 tells if 4096 need more."""
PREPARE = f"""
import os, sys
from drpt import load_scene
from drpt.crosscheck import to_mitsuba_xml
to_mitsuba_xml(load_scene({SCENE!r}), sys.argv[1], {BOUNCES})
print(os.environ[{VARIABLE!r}])
"""
"""Writes the scene for Mitsuba, and says which libLLVM drpt has found: Mitsuba gets the same."""


class Process(NamedTuple):
    """Wall-clock seconds of a process, and the most memory it had resident."""

    seconds: float
    peak_mib: float


def measure_all(effort: Effort) -> dict[str, Any]:
    """Measure both programs, cold and warm, and the memory of a large picture."""
    print("startup: whole processes", flush=True)
    with TemporaryDirectory() as folder:
        runs = 1 if effort.quick else RUNS
        return {"processes": _programs(Path(folder), runs), "memory": _memory(Path(folder))}


def run(command: str, cache: Path, llvm: str | None = None) -> Process:
    """Run a command with a folder for kernels, without its output; raises if it fails.

    To be called early: Linux counts the memory of the process that starts another as its own.
    """
    environment = {**os.environ, "DRJIT_CACHE_DIR": str(cache)}
    if llvm:
        environment[VARIABLE] = llvm
    begin = perf_counter()
    process = subprocess.Popen(
        shlex.split(command),
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    _, status, usage = os.wait4(process.pid, 0)
    seconds = perf_counter() - begin
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise RuntimeError(f"{command}: it failed with {process.returncode}")
    return Process(seconds, usage.ru_maxrss / 1024)


def _programs(folder: Path, runs: int) -> list[dict[str, Any]]:
    """Run drpt's program and Mitsuba's in turn, each with an empty cache and then once more."""
    xml = folder / "scene.xml"
    llvm = subprocess.check_output([sys.executable, "-c", PREPARE, xml], text=True).strip()
    drpt = f"{DRPT} {SCENE} --spp {SPP} -o {folder}/drpt.exr"
    mitsuba = f"{MITSUBA} -m llvm_ad_rgb -D spp={SPP} -o {folder}/mitsuba.exr {xml}"
    done: dict[tuple[str, str], list[Process]] = {}
    for _ in range(runs):
        for command, library in ((drpt, None), (mitsuba, llvm)):
            with TemporaryDirectory(dir=folder) as cache:
                for state in ("cold", "warm"):
                    key = Path(shlex.split(command)[0]).name, state
                    done.setdefault(key, []).append(run(command, Path(cache), library))
    return [
        {
            "program": program,
            "cache": state,
            "seconds": median(process.seconds for process in processes),
            "peak_mib": max(process.peak_mib for process in processes),
        }
        for (program, state), processes in done.items()
    ]


def _memory(folder: Path) -> list[dict[str, float]]:
    rows = []
    for spp in MEMORY_SPP:
        command = f"{DRPT} {SCENE} --width 1920 --height 1080 --spp {spp} -o {folder}/large.exr"
        rows.append({"spp": spp, **run(command, folder / "cache")._asdict()})
    return rows
