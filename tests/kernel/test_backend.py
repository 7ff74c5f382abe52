"""Each test runs in a process of its own: a process chooses its LLVM once."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from drpt.kernel import backend, llvm


def run(code: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )


def last_line(done: subprocess.CompletedProcess[str]) -> str:
    return (done.stdout + done.stderr).strip().splitlines()[-1]


def test_importing_the_module_does_not_import_drjit() -> None:
    done = run("import sys, drpt.kernel.backend; print('drjit' in sys.modules)")
    assert last_line(done) == "False"


def test_load_names_the_newest_library_to_drjit() -> None:
    newest = llvm.choose(llvm.found(), os.environ.get(llvm.VARIABLE))
    done = run(
        "from drpt.kernel import backend\n"
        "print(backend.load('llvm').__name__, backend.describe().llvm_path)"
    )
    assert last_line(done) == f"drjit.llvm {newest.path}"


def test_mitsuba_uses_the_same_library() -> None:
    done = run(
        "from drpt.kernel import backend\n"
        "backend.load('llvm')\n"
        "import mitsuba\n"
        "mitsuba.set_variant('llvm_ad_rgb')\n"
        "mapped = {line.split()[-1] for line in open('/proc/self/maps') if 'libLLVM' in line}\n"
        "print(mapped == {str(backend.describe().llvm_path)})"
    )
    assert last_line(done) == "True"


def test_describe_tells_what_kernels_run_on(tmp_path: Path) -> None:
    done = run(
        "from drpt.kernel import backend\n"
        "backend.load('llvm')\n"
        "backend.set_thread_count(3)\n"
        "found = backend.describe()\n"
        "print(found.name, found.vector_width in (4, 8, 16), found.threads, found.cache)",
        DRPT_BACKEND="llvm",
        DRJIT_CACHE_DIR=str(tmp_path),
    )
    assert last_line(done) == f"llvm True 3 {tmp_path}"


def test_without_a_library_the_error_comes_before_drjit() -> None:
    done = run(
        "import sys\n"
        "from drpt.kernel import backend, llvm\n"
        "llvm.found = list\n"
        "try:\n"
        "    backend.load('llvm')\n"
        "except backend.BackendError as error:\n"
        "    print(error, 'drjit' in sys.modules)",
        DRJIT_LIBLLVM_PATH="",
    )
    assert last_line(done).startswith("no libLLVM >= 16 found: install it with")
    assert last_line(done).endswith("False")


def test_library_that_cannot_be_loaded_is_named(tmp_path: Path) -> None:
    broken = tmp_path / "libLLVM.so.19.1"
    broken.touch()
    done = run(
        "from drpt.kernel import backend; backend.load('llvm')", **{llvm.VARIABLE: str(broken)}
    )
    assert last_line(done).endswith(f"name another in {llvm.VARIABLE}")
    assert f"Dr.Jit got no LLVM from {broken}" in last_line(done)


def test_too_old_a_library_that_drjit_picked_earlier_is_refused() -> None:
    done = run(
        "import drjit\n"
        "drjit.has_backend = lambda name: True\n"
        "drjit.detail.llvm_version = lambda: (15, 0, 6)\n"
        "from drpt.kernel import backend\n"
        "backend.load('llvm')",
        DRJIT_LIBLLVM_PATH="",
    )
    assert "Dr.Jit was imported before drpt and took LLVM 15.0.6" in last_line(done)


def test_environment_names_the_backend() -> None:
    done = run("from drpt.kernel import backend; print(backend.load())", DRPT_BACKEND="llvm")
    assert "drjit.llvm" in last_line(done)


def test_unknown_backend_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ValueError, match="backend must be one of llvm, cuda, got 'metal'"):
        backend.load("metal")
    monkeypatch.setenv(backend.VARIABLE, "metal")
    with pytest.raises(ValueError, match="DRPT_BACKEND must be one of llvm, cuda, got 'metal'"):
        backend.load()


def test_cuda_without_a_gpu_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(backend, "_works", lambda name: name != "CUDA")
    monkeypatch.setenv(backend.VARIABLE, "cuda")
    with pytest.raises(backend.BackendError, match="DRPT_BACKEND is cuda, which needs an NVIDIA"):
        backend.load()


@pytest.mark.parametrize(
    ("reason", "says"),
    [
        ("libatomic.so.1: no such file", r"libatomic\.so\.1: no such file\); it needs libatomic1$"),
        ("undefined symbol: x", r"cannot be imported \(undefined symbol: x\)$"),
    ],
)
def test_failed_import_says_why(reason: str, says: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(name: str) -> None:
        raise ImportError(reason)

    monkeypatch.delitem(sys.modules, "drjit")
    monkeypatch.setattr("importlib.import_module", fail)
    with pytest.raises(backend.BackendError, match=says):
        backend.load("llvm")


def test_interrupt_waits_until_drjit_is_imported(monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[str] = []

    def be_interrupted(name: str) -> None:
        signal.raise_signal(signal.SIGINT)
        done.append(name)

    monkeypatch.delitem(sys.modules, "drjit")
    monkeypatch.setattr("importlib.import_module", be_interrupted)
    with pytest.raises(KeyboardInterrupt):
        backend.load("llvm")
    assert done == ["drjit"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_loading_in_a_thread() -> None:
    done = run(
        "import threading\n"
        "from drpt.kernel import backend\n"
        "thread = threading.Thread(target=lambda: print(backend.load('llvm').__name__))\n"
        "thread.start(); thread.join()"
    )
    assert last_line(done) == "drjit.llvm"


def test_thread_count_must_be_positive() -> None:
    with pytest.raises(ValueError, match="at least 1, got 0"):
        backend.set_thread_count(0)


RENDER = """
import drpt
scene = drpt.load_scene("cornell-box").resized(2, 2)
print(drpt.render(scene, spp=1, bounces=1).image.shape)
"""


def kernels_in(folder: Path) -> list[Path]:
    return list(folder.glob("*.bin"))


def test_kernels_have_a_folder_of_their_own(tmp_path: Path) -> None:
    unset = {"DRJIT_CACHE_DIR": "", "XDG_CACHE_HOME": ""}
    assert last_line(run(RENDER, HOME=str(tmp_path), **unset)) == "(2, 2, 3)"
    assert [path.name for path in tmp_path.iterdir()] == [".cache"]
    assert kernels_in(tmp_path / ".cache/drpt/kernels")


def test_a_folder_that_is_named_is_left_alone(tmp_path: Path) -> None:
    named = {"DRJIT_CACHE_DIR": str(tmp_path / "named"), "DRJIT_CACHE_MAXSIZE": "5M"}
    ask = "import os; print(os.environ['DRJIT_CACHE_DIR'], os.environ['DRJIT_CACHE_MAXSIZE'])"
    done = run(RENDER + ask, HOME=str(tmp_path), **named)
    assert last_line(done) == f"{tmp_path / 'named'} 5M"
    assert kernels_in(tmp_path / "named")
    assert [path.name for path in tmp_path.iterdir()] == ["named"]


def test_kernels_that_were_used_least_recently_go(tmp_path: Path) -> None:
    folder = tmp_path / "drpt/kernels"
    folder.mkdir(parents=True)
    for age in range(3):
        path = folder / f"{age}.bin"
        with path.open("wb") as file:
            file.truncate(2**29)  # half of what may be there, and nothing on the disk
        os.utime(path, (10**9 - age, 10**9 - age))
    run(RENDER + "import time; time.sleep(1)", DRJIT_CACHE_DIR="", XDG_CACHE_HOME=str(tmp_path))
    stays = [path.stem for path in kernels_in(folder)]
    assert [name for name in stays if name in "012"] == ["0"]
    assert len(stays) > 1


def test_it_renders_without_a_folder() -> None:
    done = run(RENDER, DRJIT_CACHE_DIR="", XDG_CACHE_HOME="/dev/null")
    assert done.stdout == "(2, 2, 3)\n"
    assert "Traceback" not in done.stderr
