"""What `drpt doctor` reports of good and bad machines, each problem in one line."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import drpt
from drpt import doctor, machine
from drpt.distribution import NAME, install_command
from drpt.kernel import backend, llvm

if TYPE_CHECKING:
    from collections.abc import Callable

NEW = llvm.Library(Path("/lib/libLLVM.so.19.1"), (19, 1))
OLDER = llvm.Library(Path("/lib/libLLVM-18.so.1"), (18,))
TOO_OLD = llvm.Library(Path("/lib/libLLVM-15.so.1"), (15,))
UNKNOWN = llvm.Library(Path("/lib/libLLVM.so"), ())

CHOSEN = backend.Backend(
    name="llvm",
    llvm_path=NEW.path,
    llvm_version="19.1.7",
    vector_width=8,
    threads=4,
    cuda=False,
    cache=Path("/home/someone/kernels"),
    cache_writable=True,
)


@pytest.fixture
def examine(monkeypatch: pytest.MonkeyPatch) -> Callable[..., doctor.Report]:
    """Report of a good machine with 4 cores, or of one with what differs."""

    def report(
        found: tuple[llvm.Library, ...] = (NEW,),
        cores: tuple[int, int, float | None] = (4, 4, None),
        cuda_trouble: str | None = "no NVIDIA driver",
        **chosen: Any,
    ) -> doctor.Report:
        monkeypatch.setattr(backend, "describe", lambda: replace(CHOSEN, **chosen))
        monkeypatch.setattr(llvm, "found", lambda: list(found))
        monkeypatch.setattr(os, "cpu_count", lambda: cores[0])
        monkeypatch.setattr(machine, "usable_cores", lambda: cores[1])
        monkeypatch.setattr(machine, "core_quota", lambda: cores[2])
        monkeypatch.setattr(machine, "cuda_trouble", lambda: cuda_trouble)
        return doctor.report()

    return report


def found_as(report: doctor.Report, name: str) -> list[str]:
    return [found for row, found in report.rows if row == name]


def test_a_good_machine_has_no_problems(
    examine: Callable[..., doctor.Report], capsys: pytest.CaptureFixture[str]
) -> None:
    examine()
    assert doctor.main() == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split("  ")[0] for line in lines[:6]] == [
        "backend",
        "libLLVM",
        "vector width",
        "threads",
        "CUDA",
        "cache folder",
    ]
    assert lines[-2:] == ["", "drpt can render"]


class TestLibraries:
    def test_say_which_is_used_and_why_others_are_not(
        self, examine: Callable[..., doctor.Report]
    ) -> None:
        report = examine(found=(TOO_OLD, NEW, OLDER, UNKNOWN))
        assert found_as(report, "libLLVM") == ["19.1.7 (/lib/libLLVM.so.19.1, the newest)"]
        assert found_as(report, "not chosen") == [
            "15 (/lib/libLLVM-15.so.1): needs to be at least 16",
            "18 (/lib/libLLVM-18.so.1): usable, but no newer",
            "unknown version (/lib/libLLVM.so): used if DRJIT_LIBLLVM_PATH names it",
        ]

    @pytest.mark.parametrize("found", [(NEW, OLDER), (NEW,), ()])
    def test_that_are_named_are_said_to_be(
        self, found: tuple[llvm.Library, ...], examine: Callable[..., doctor.Report]
    ) -> None:
        report = examine(found=found, llvm_path=OLDER.path, llvm_version="18.1.3")
        named = "18.1.3 (/lib/libLLVM-18.so.1, named in DRJIT_LIBLLVM_PATH)"
        assert found_as(report, "libLLVM") == [named]
        others = ["19.1 (/lib/libLLVM.so.19.1): usable, but another is named"]
        assert found_as(report, "not chosen") == others[: len(found)]

    def test_are_none_beside_cuda(self, examine: Callable[..., doctor.Report]) -> None:
        report = examine((), name="cuda", cuda=True, llvm_path=None, llvm_version=None)
        assert found_as(report, "libLLVM") == ["none in use"]
        assert report.problems == []


class TestThreads:
    @pytest.mark.parametrize(
        ("cores", "threads", "says"),
        [
            ((8, 8, None), 8, "8 (8 cores)"),
            ((8, 8, 8.0), 8, "8 (8 cores)"),
            ((8, 2, None), 2, "2 (8 cores, of which this process may use 2)"),
        ],
    )
    def test_within_the_limits_are_fine(
        self,
        cores: tuple[int, int, float | None],
        threads: int,
        says: str,
        examine: Callable[..., doctor.Report],
    ) -> None:
        report = examine(cores=cores, threads=threads)
        assert found_as(report, "threads") == [says]
        assert report.notes == []

    @pytest.mark.parametrize(("quota", "most"), [(2.0, 2), (0.5, 1)])
    def test_beyond_the_limit_of_a_container_are_too_many(
        self, quota: float, most: int, examine: Callable[..., doctor.Report]
    ) -> None:
        report = examine(cores=(8, 8, quota), threads=8)
        limit = f"of whose time this container may take {quota:g}"
        assert found_as(report, "threads") == [f"8 (8 cores, {limit})"]
        (note,) = report.notes
        assert note.startswith(f"8 threads share the time of {most}")
        assert note.endswith(f"render with --threads {most}")


class TestCuda:
    def test_is_missing_for_a_reason(self, examine: Callable[..., doctor.Report]) -> None:
        assert found_as(examine(), "CUDA") == ["no: no NVIDIA driver"]

    def test_is_there(self, examine: Callable[..., doctor.Report]) -> None:
        assert found_as(examine(cuda_trouble=None, cuda=True), "CUDA") == ["yes"]

    def test_that_drjit_cannot_use_wants_another_driver(
        self, examine: Callable[..., doctor.Report]
    ) -> None:
        report = examine(cuda_trouble=None)
        assert found_as(report, "CUDA") == ["no: Dr.Jit cannot use the NVIDIA driver"]
        assert report.notes == ["there is a GPU that Dr.Jit cannot use: update the NVIDIA driver"]


class TestCache:
    def test_is_named(self, examine: Callable[..., doctor.Report]) -> None:
        report = examine()
        assert found_as(report, "cache folder") == ["/home/someone/kernels (0 kernels, 0 bytes)"]
        assert report.notes == []

    def test_tells_its_size(self, tmp_path: Path, examine: Callable[..., doctor.Report]) -> None:
        for name in ("a.bin", "b.bin", "sweep.stamp"):
            (tmp_path / name).write_bytes(bytes(2**20))
        says = f"{tmp_path} (2 kernels, 2.097 MB)"
        assert found_as(examine(cache=tmp_path), "cache folder") == [says]

    @pytest.mark.parametrize(
        ("cache", "why"),
        [(None, "/no/kernels is not writable"), (CHOSEN.cache, f"{CHOSEN.cache} is not writable")],
    )
    def test_that_keeps_nothing_is_noted(
        self,
        cache: Path | None,
        why: str,
        examine: Callable[..., doctor.Report],
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        monkeypatch.setenv("DRJIT_CACHE_DIR", "/no/kernels")
        report = examine(cache=cache, cache_writable=False)
        (note,) = report.notes
        assert note.startswith(f"{why}, so that every run compiles anew")
        assert report.problems == []


class TestPackages:
    @pytest.mark.parametrize("package", ["drjit", "mitsuba", "numpy", "OpenEXR"])
    def test_have_versions(self, package: str, examine: Callable[..., doctor.Report]) -> None:
        assert found_as(examine(), package) == [version(package)]

    def test_that_are_optional_tell_how_to_install_them(
        self, examine: Callable[..., doctor.Report], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        packages = ("numpy", "no-such-package", "nor-this")
        monkeypatch.setattr(doctor, "EXTRAS", {"magic": packages})
        report = examine()
        does = install_command("magic")
        says = [f"no-such-package and nor-this not installed ({does} does)"]
        assert found_as(report, "drpt-render[magic]") == says
        assert report.problems == []

    def test_of_every_extra_are_listed(self, examine: Callable[..., doctor.Report]) -> None:
        rows = [row for row, _ in examine().rows]
        assert [row for row in rows if row.startswith(f"{NAME}[")] == [
            "drpt-render[denoise]",
            "drpt-render[flip]",
            "drpt-render[notebook]",
            "drpt-render[view]",
        ]

    def test_of_an_extra_have_versions(self, examine: Callable[..., doctor.Report]) -> None:
        says = [f"starlette {version('starlette')}, uvicorn {version('uvicorn')}, "]
        says += [f"websockets {version('websockets')}"]
        assert found_as(examine(), "drpt-render[view]") == ["".join(says)]

    def test_are_unknown_where_the_source_runs_without_being_installed(
        self, examine: Callable[..., doctor.Report], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(doctor, "NAME", "no-such-package")
        report = examine()
        assert found_as(report, "no-such-package") == [drpt.__version__]
        assert report.problems == []

    @pytest.mark.parametrize(("there", "is_"), [("1.4.0", "1.4.0"), (None, "not installed")])
    def test_of_another_version_than_drpt_needs_are_a_problem(
        self,
        there: str | None,
        is_: str,
        examine: Callable[..., doctor.Report],
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        others = {"drjit": there, "drpt": None}
        monkeypatch.setattr(doctor, "_version", lambda name: others.get(name, "1"))
        needs = ["drjit==1.5.0", "scipy<2,>=1.15", "oidn<1; extra == 'denoise'"]
        monkeypatch.setattr(doctor, "requires", lambda _: needs)
        does = "python -m pip install drjit==1.5.0"
        assert examine().problems == [f"drjit is {is_}, and drpt needs 1.5.0: {does}"]


class TestNamesake:
    ADVICE = "python -m pip uninstall drpt && "

    @pytest.fixture(autouse=True)
    def installed(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(doctor, "_version", lambda name: "9.1" if name == "drpt" else "1")
        monkeypatch.setattr(doctor, "requires", lambda _: [])

    def test_is_noted(self, examine: Callable[..., doctor.Report]) -> None:
        report = examine()
        (note,) = report.notes
        assert note.startswith("the distribution drpt 9.1 is not drpt-render, but installs")
        assert note.endswith(self.ADVICE + install_command("", "--force-reinstall", "--no-deps"))
        assert report.problems == []

    def test_that_has_replaced_files_is_a_problem(
        self, examine: Callable[..., doctor.Report], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.delattr(drpt, "Scene")
        (problem,) = examine().problems
        assert problem.startswith("the distribution drpt 9.1 is not drpt-render, but installs")


class TestPixel:
    def test_is_right_here(self, examine: Callable[..., doctor.Report]) -> None:
        report = examine()
        assert report.problems == []
        assert found_as(report, "self-test")[0].startswith("0.5 for 0.5, in ")

    @pytest.mark.parametrize(
        ("value", "problem"),
        [(0.51, "the self-test is wrong by 2 %: name"), (np.nan, "the self-test is wrong by nan")],
    )
    def test_that_is_wrong_is_a_problem(
        self,
        value: float,
        problem: str,
        examine: Callable[..., doctor.Report],
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        image = np.full((1, 1, 3), value, np.float32)
        monkeypatch.setattr(doctor, "render", lambda *_, **__: SimpleNamespace(image=image))
        (found,) = examine().problems
        assert found.startswith(problem)

    def test_that_cannot_be_rendered_is_a_problem(
        self, examine: Callable[..., doctor.Report], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def fail(*_: Any, **__: Any) -> None:
            raise RuntimeError("jit_run(): no")

        monkeypatch.setattr(doctor, "render", fail)
        (found,) = examine().problems
        assert found.startswith("rendering fails (jit_run(): no)")


def test_a_machine_without_a_backend_is_described_all_the_same(
    examine: Callable[..., doctor.Report],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def describe() -> backend.Backend:
        raise backend.BackendError("no libLLVM >= 16 found: install it")

    examine(found=(TOO_OLD,))
    monkeypatch.setattr(backend, "describe", describe)
    assert doctor.main() == 1
    printed = capsys.readouterr().out
    for row in ("libLLVM", "not chosen", "threads", "CUDA", "Python"):
        assert f"\n{row}  " in f"\n{printed}"
    assert printed.endswith("\ndrpt cannot render: no libLLVM >= 16 found: install it\n")


@pytest.fixture
def bad_library(tmp_path: Path) -> Path:
    path = tmp_path / "libLLVM-19.so"
    path.write_text("no library")
    return path


def run_doctor(**variables: str) -> tuple[int, list[str], bool]:
    """Exit status and last lines of the program, and whether it has imported Mitsuba."""
    code = (
        "import sys; from drpt import doctor; status = doctor.main(); "
        "print('mitsuba' in sys.modules); sys.exit(status)"
    )
    environment = {**os.environ, "DRPT_BACKEND": "llvm", **variables}
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False
    )
    *lines, imported = done.stdout.splitlines()
    return done.returncode, lines[lines.index("") + 1 :], imported == "True"


class TestProgram:
    def test_names_a_library_that_is_missing(self) -> None:
        status, (problem,), _ = run_doctor(DRJIT_LIBLLVM_PATH="/missing/libLLVM.so")
        assert status == 1
        assert problem.startswith("drpt cannot render: DRJIT_LIBLLVM_PATH is '/missing/libLLVM.so'")

    def test_names_a_library_that_is_none(self, bad_library: Path) -> None:
        status, (problem,), _ = run_doctor(DRJIT_LIBLLVM_PATH=str(bad_library))
        assert status == 1
        assert f"no LLVM from {bad_library}: name another in DRJIT_LIBLLVM_PATH" in problem

    def test_renders_without_a_cache_and_without_mitsuba(self) -> None:
        folder = "/dev/null/cache"  # where not even root can write
        status, lines, imported = run_doctor(DRJIT_CACHE_DIR=folder)
        assert status == 0
        assert lines[0] == "drpt can render"
        assert f"note: {folder} is not writable, so that every run compiles anew: name" in lines[1]
        assert not imported
