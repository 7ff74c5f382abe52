"""The wheel alone, in an environment of its own and away from the checkout, has all it needs."""

import os
import subprocess
import sys
import venv
from pathlib import Path

import pytest

from drpt.kernel import llvm

CHECKOUT = Path(__file__).parents[1]
PINS = CHECKOUT / "constraints.txt"

pytestmark = pytest.mark.slow


def run(*command: str | Path, cwd: Path) -> str:
    """Return what a command prints; of this environment only its system libraries reach it."""
    hidden = {"PYTHONPATH", "VIRTUAL_ENV"}
    environment = {name: value for name, value in os.environ.items() if name not in hidden}
    library = llvm.choose(llvm.found(), os.environ.get(llvm.VARIABLE))
    environment[llvm.VARIABLE] = str(library.path)
    environment["LD_LIBRARY_PATH"] = f"{sys.prefix}/lib/llvm"  # where the set-up unpacks them
    done = subprocess.run(
        command, cwd=cwd, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the wheel, install it, and return the folder of its commands."""
    folder = tmp_path_factory.mktemp("install")
    pip = (sys.executable, "-m", "pip", "--disable-pip-version-check")
    wheel_options = ("--no-deps", "--build-constraint", PINS, "--wheel-dir", folder)
    run(*pip, "wheel", *wheel_options, CHECKOUT, cwd=folder)
    (wheel,) = folder.glob("drpt-*.whl")
    venv.create(folder / "venv")
    python = folder / "venv/bin/python"
    run(*pip, "--python", python, "install", "--constraint", PINS, wheel, cwd=folder)
    return folder / "venv/bin"


def test_installed_command_renders_a_built_in_scene(installed: Path, tmp_path: Path) -> None:
    size = ("--width", "16", "--height", "16", "--spp", "4")
    run(installed / "drpt-render", "cornell-box", *size, "-o", "x.exr", cwd=tmp_path)
    assert (tmp_path / "x.exr").stat().st_size > 0


def test_installed_command_lists_the_built_in_scenes(installed: Path, tmp_path: Path) -> None:
    listed = run(installed / "drpt", "scenes", cwd=tmp_path)
    assert "cornell-box-glossy" in listed
    assert "veach" in listed


def test_installed_doctor_is_content(installed: Path, tmp_path: Path) -> None:
    report = run(installed / "drpt", "doctor", cwd=tmp_path)
    assert "drpt can render" in report
