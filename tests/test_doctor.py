import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest

from drpt import doctor
from drpt.kernel import backend, llvm

CHOSEN = backend.Backend(
    name="llvm",
    llvm_path=Path("/lib/libLLVM.so.19.1"),
    llvm_version="19.1.7",
    vector_width=8,
    threads=4,
    cuda=False,
    cache=Path("/home/someone/.drjit"),
    cache_writable=False,
)
FOUND = [
    llvm.Library(Path("/lib/libLLVM-15.so.1"), (15,)),
    llvm.Library(Path("/lib/libLLVM-18.so.1"), (18,)),
    llvm.Library(Path("/lib/libLLVM.so.19.1"), (19, 1)),
]


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(backend, "describe", lambda: CHOSEN)
    monkeypatch.setattr(llvm, "found", lambda: FOUND)


@pytest.mark.usefixtures("machine")
def test_report_of_a_machine_that_can_render(capsys: pytest.CaptureFixture[str]) -> None:
    assert doctor.main() == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[:8] == [
        "backend       llvm",
        "libLLVM       19.1.7 (/lib/libLLVM.so.19.1)",
        "not chosen    15 (/lib/libLLVM-15.so.1): needs to be at least 16",
        "not chosen    18 (/lib/libLLVM-18.so.1): usable, but not preferred",
        "vector width  8",
        "threads       4",
        "CUDA          no",
        "cache folder  /home/someone/.drjit (not writable: kernels are not kept)",
    ]
    assert lines[-1] == "drpt can render"


@pytest.mark.parametrize("package", ["drjit", "mitsuba", "numpy", "OpenEXR"])
@pytest.mark.usefixtures("machine")
def test_report_tells_the_versions(package: str) -> None:
    assert (package, version(package)) in doctor.report().rows


def test_report_of_a_machine_that_cannot_render(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def describe() -> backend.Backend:
        raise backend.BackendError("no libLLVM")

    monkeypatch.setattr(backend, "describe", describe)
    assert doctor.main() == 1
    assert capsys.readouterr().out.splitlines()[-1] == "drpt cannot render: no libLLVM"


def test_packages_that_are_missing_are_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(backend, "describe", lambda: CHOSEN)
    monkeypatch.setattr(doctor, "_PACKAGES", ("no-such-package",))
    assert ("no-such-package", "not installed") in doctor.report().rows


def test_mitsuba_is_not_imported() -> None:
    code = "import sys; from drpt import doctor; doctor.report(); print('mitsuba' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"
