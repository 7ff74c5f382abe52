"""What drpt finds on this machine, whether it can render there, and what could be better."""

from __future__ import annotations

import os
import platform
import sys
from contextlib import suppress
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, requires, version
from time import perf_counter
from typing import TYPE_CHECKING

import drpt
from drpt import machine
from drpt.distribution import EXTRAS, NAME, VERSION, install_command
from drpt.kernel import backend, llvm
from drpt.messages import size_in_words
from drpt.render import render
from drpt.scene import Camera, Diffuse, Mesh, Scene, Sphere

if TYPE_CHECKING:
    from pathlib import Path

PACKAGES = ("drjit", "mitsuba", "numpy", "OpenEXR")
TOLERANCE = 1e-3
"""Of the self-test, whose estimator has no noise: far above what float32 rounds."""


@dataclass
class Report:
    """What was found.

    Attributes
    ----------
    rows
        Names and what was found.
    problems
        What keeps drpt from rendering, and what to do, a line each.
    notes
        What is worse than it could be, likewise.
    """

    rows: list[tuple[str, str]] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        width = max(len(name) for name, _ in self.rows)
        lines = [f"{name:<{width}}  {found}" for name, found in self.rows]
        verdict = [f"drpt cannot render: {problem}" for problem in self.problems]
        notes = [f"note: {note}" for note in self.notes]
        return "\n".join([*lines, "", *(verdict or ["drpt can render"]), *notes])


def report() -> Report:
    """Look at the machine and at what is installed, and render a pixel; Mitsuba is not imported."""
    found = Report()
    try:
        chosen = backend.describe()
    except (backend.BackendError, ValueError) as error:
        chosen = None
        found.problems.append(str(error))
    _look_at_llvm(found, chosen)
    _look_at_threads(found, chosen)
    _look_at_cuda(found, chosen)
    if chosen is not None:
        _look_at_cache(found, chosen)
    _look_at_packages(found)
    _look_at_extras(found)
    _look_at_namesake(found)
    if chosen is not None:
        _render_pixel(found)
    return found


def main() -> int:
    """Print the report; return 0 if drpt can render, else 1."""
    found = report()
    print(found)
    return 1 if found.problems else 0


def _look_at_llvm(found: Report, chosen: backend.Backend | None) -> None:
    if chosen is not None:
        found.rows.append(("backend", chosen.name))
    if chosen is None or chosen.llvm_version is None:
        found.rows.append(("libLLVM", "none in use"))
        path, others = None, "usable"
    else:
        path, why, others = _choice(chosen)
        found.rows.append(("libLLVM", f"{chosen.llvm_version} ({why})"))
        found.rows.append(("vector width", str(chosen.vector_width)))
    for library in llvm.found():
        if library.path != path:
            reason = others if library.usable else _reason(library)
            found.rows.append(("not chosen", f"{library}: {reason}"))


def _choice(chosen: backend.Backend) -> tuple[Path | None, str, str]:
    """Path of the library in use, why it is, and why others are not that could be."""
    path = chosen.llvm_path
    if path is None:
        return path, "picked by Dr.Jit", "usable"
    try:
        newest = llvm.choose(llvm.found()).path
    except backend.BackendError:
        newest = None
    if path == newest:
        return path, f"{path}, the newest", "usable, but no newer"
    return path, f"{path}, named in {llvm.VARIABLE}", "usable, but another is named"


def _reason(library: llvm.Library) -> str:
    if not library.version:
        return f"used if {llvm.VARIABLE} names it"
    return f"needs to be at least {llvm.OLDEST[0]}"


def _look_at_threads(found: Report, chosen: backend.Backend | None) -> None:
    cores, usable, quota = os.cpu_count() or 1, machine.usable_cores(), machine.core_quota()
    limits = [f"{cores} cores"]
    if usable < cores:
        limits.append(f"of which this process may use {usable}")
    if quota is not None and quota < usable:
        limits.append(f"of whose time this container may take {quota:g}")
    threads = min(cores, usable) if chosen is None else chosen.threads
    found.rows.append(("threads", f"{threads} ({', '.join(limits)})"))
    most = max(1, round(min(usable, quota or usable)))
    if threads > most:
        found.notes.append(
            f"{threads} threads share the time of {most}, so that they wait for each other: "
            f"render with --threads {most}"
        )


def _look_at_cuda(found: Report, chosen: backend.Backend | None) -> None:
    trouble = machine.cuda_trouble()
    if chosen is not None and chosen.cuda:
        found.rows.append(("CUDA", "yes"))
    else:
        found.rows.append(("CUDA", f"no: {trouble or 'Dr.Jit cannot use the NVIDIA driver'}"))
    if trouble is None and chosen is not None and not chosen.cuda:
        found.notes.append("there is a GPU that Dr.Jit cannot use: update the NVIDIA driver")


def _look_at_cache(found: Report, chosen: backend.Backend) -> None:
    cache = chosen.cache
    what = "none" if cache is None else f"{cache} ({_kernels(cache)})"
    found.rows.append(("cache folder", what))
    if not chosen.cache_writable:
        folder = cache or os.environ.get(backend.CACHE_VARIABLE)
        why = f"{folder} is not writable" if folder else "HOME is not set"
        found.notes.append(
            f"{why}, so that every run compiles anew: "
            f"name a writable folder in {backend.CACHE_VARIABLE}"
        )


def _kernels(folder: Path) -> str:
    """Say how many compiled kernels a folder holds, and their size."""
    sizes = []
    for file in folder.glob("*.bin"):
        with suppress(FileNotFoundError):  # another process has just removed it
            sizes.append(file.stat().st_size)
    return f"{len(sizes)} kernel{'' if len(sizes) == 1 else 's'}, {size_in_words(sum(sizes))}"


def _look_at_packages(found: Report) -> None:
    found.rows.append(("Python", f"{platform.python_version()} ({sys.executable})"))
    found.rows.append((NAME, VERSION))
    for name in PACKAGES:
        found.rows.append((name, _version(name) or "not installed"))
    for requirement in _requirements():
        name, _, pinned = requirement.partition(";")[0].strip().partition("==")
        if pinned and _version(name) != pinned:
            found.problems.append(
                f"{name} is {_version(name) or 'not installed'}, and drpt needs {pinned}: "
                f"python -m pip install {name}=={pinned}"
            )


def _look_at_extras(found: Report) -> None:
    for extra, packages in EXTRAS.items():
        there = {name: _version(name) for name in packages}
        missing = [name for name, installed in there.items() if installed is None]
        if missing:
            says = f"{' and '.join(missing)} not installed ({install_command(extra)} does)"
        else:
            says = ", ".join(f"{name} {installed}" for name, installed in there.items())
        found.rows.append((f"{NAME}[{extra}]", says))


def _look_at_namesake(found: Report) -> None:
    """Look for a distribution with the name of the import, whose files would replace drpt's."""
    other = _version("drpt")
    if other is None:
        return
    intact = getattr(drpt, "Scene", None) is Scene
    again = install_command("", "--force-reinstall", "--no-deps")
    (found.notes if intact else found.problems).append(
        f"the distribution drpt {other} is not {NAME}, but installs files of the same names: "
        f"python -m pip uninstall drpt && {again}"
    )


def _requirements() -> list[str]:
    """Requirements of drpt; none if its source runs without being installed."""
    try:
        return requires(NAME) or []
    except PackageNotFoundError:
        return []


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _render_pixel(found: Report) -> None:
    """Render a point below a lamp, whose radiance is ρ L (r / d)²."""
    floor = Mesh([(-9, 0, -9), (0, 0, 18), (9, 0, -9)], [(0, 1, 2)], material=Diffuse(0.5))
    lamp = Sphere((0, 2, 0), 0.5, radiance=16)
    camera = Camera(eye=(3, 3, 0), target=(0, 0, 0), up=(0, 1, 0), fov=40, width=1, height=1)
    exact = 0.5 * 16 * (0.5 / 2) ** 2
    start = perf_counter()
    try:
        image = render(Scene(camera, [floor, lamp]), 16, 1, jitter=False, error=False).image
    except Exception as error:  # whatever it is that does not work here
        found.problems.append(f"rendering fails ({error}); please report it, with these lines")
        return
    wrong = abs(image / exact - 1).max()
    seconds = perf_counter() - start
    found.rows.append(("self-test", f"{image.mean():.6g} for {exact:g}, in {seconds:.2f} s"))
    if not wrong <= TOLERANCE:
        found.problems.append(
            f"the self-test is wrong by {100 * wrong:.3g} %: name another libLLVM in "
            f"{llvm.VARIABLE}, and please report it, with these lines"
        )
