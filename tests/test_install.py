"""The wheel alone, in an environment of its own and away from the checkout, has all it needs."""

import os
import subprocess
import sys
import venv
from pathlib import Path
from zipfile import ZipFile

import pytest

from drpt.kernel import llvm

CHECKOUT = Path(__file__).parents[1]
PINS = CHECKOUT / "constraints.txt"

PIP = (sys.executable, "-m", "pip", "--disable-pip-version-check")

pytestmark = pytest.mark.slow


def run(*command: str | Path, cwd: Path, status: int = 0) -> str:
    """Return what a command prints that ends with a status.

    Of this environment only its system libraries reach it.
    """
    hidden = {"PYTHONPATH", "VIRTUAL_ENV"}
    environment = {name: value for name, value in os.environ.items() if name not in hidden}
    library = llvm.choose(llvm.found(), os.environ.get(llvm.VARIABLE))
    environment[llvm.VARIABLE] = str(library.path)
    environment["LD_LIBRARY_PATH"] = f"{sys.prefix}/lib/llvm"  # where the set-up unpacks them
    done = subprocess.run(
        command, cwd=cwd, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == status, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the wheel, install it, and return the folder of its commands."""
    folder = tmp_path_factory.mktemp("install")
    wheel_options = ("--no-deps", "--build-constraint", PINS, "--wheel-dir", folder)
    run(*PIP, "wheel", *wheel_options, CHECKOUT, cwd=folder)
    (wheel,) = folder.glob("drpt_render-*.whl")
    venv.create(folder / "venv")
    python = folder / "venv/bin/python"
    run(*PIP, "--python", python, "install", "--constraint", PINS, wheel, "pip", cwd=folder)
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


@pytest.fixture(scope="module")
def stranger(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Wheel of another project that is called drpt, with an import and a command of that name."""
    files = {
        "drpt/__init__.py": "def main():\n    print('a stranger')\n",
        "drpt-9.1.dist-info/METADATA": "Metadata-Version: 2.1\nName: drpt\nVersion: 9.1\n",
        "drpt-9.1.dist-info/WHEEL": "Wheel-Version: 1.0\nRoot-Is-Purelib: true\n",
        "drpt-9.1.dist-info/entry_points.txt": "[console_scripts]\ndrpt = drpt:main\n",
    }
    record = [*files, "drpt-9.1.dist-info/RECORD"]
    files["drpt-9.1.dist-info/RECORD"] = "".join(f"{name},,\n" for name in record)
    wheel = tmp_path_factory.mktemp("stranger") / "drpt-9.1-py3-none-any.whl"
    with ZipFile(wheel, "w") as archive:
        for name, text in files.items():
            archive.writestr(name, text)
    return wheel


def test_a_stranger_that_is_called_drpt_is_noticed(
    installed: Path, stranger: Path, tmp_path: Path
) -> None:
    """Its files replace those of drpt-render where it is installed later."""
    install_stranger = (*PIP, "--python", installed / "python", "install", "--no-index", stranger)
    told = "the distribution drpt 9.1 is not drpt-render"
    run(*install_stranger, cwd=tmp_path)
    assert run(installed / "drpt", cwd=tmp_path) == "a stranger\n"
    report = run(installed / "python", "-m", "drpt", "doctor", cwd=tmp_path, status=1)
    assert f"drpt cannot render: {told}" in report

    advice = report.rpartition("python -m pip uninstall drpt && ")[2].rstrip()
    install_again = ("sh", "-c", f"PATH={installed}:$PATH; {advice}")
    run(*PIP, "--python", installed / "python", "uninstall", "--yes", "drpt", cwd=tmp_path)
    run(*install_again, cwd=tmp_path)
    test_installed_doctor_is_content(installed, tmp_path)

    run(*install_stranger, cwd=tmp_path)
    run(*install_again, cwd=tmp_path)
    report = run(installed / "drpt", "doctor", cwd=tmp_path)
    assert f"drpt can render\nnote: {told}" in report
