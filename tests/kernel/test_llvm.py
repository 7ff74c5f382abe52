import platform
import subprocess
import sys
from pathlib import Path

import pytest

from drpt.kernel import llvm

MULTIARCH = f"usr/lib/{platform.machine()}-linux-gnu"


def make_library(path: Path, *links: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.touch()
    for link in links:
        link.parent.mkdir(parents=True, exist_ok=True)
        link.symlink_to(path)
    return path


@pytest.mark.parametrize(
    ("name", "version"),
    [
        ("libLLVM-14.so.1", (14,)),
        ("libLLVM-14.0.6.so.1", (14, 0, 6)),
        ("libLLVM-19.so", (19,)),
        ("libLLVM.so.19.1", (19, 1)),
        ("libLLVM-17.dylib", (17,)),
        ("opt/llvm-18/lib/libLLVM.so", (18,)),
        ("Cellar/llvm/19.1.7/lib/libLLVM.dylib", (19, 1, 7)),
        ("Cellar/llvm@18/18.1.8/lib/libLLVM.dylib", (18, 1, 8)),
        ("elsewhere/libLLVM.so", ()),
    ],
)
def test_version_is_read_off_the_names(name: str, version: tuple[int, ...]) -> None:
    assert llvm.identify(Path("/nowhere") / name).version == version


def test_links_are_followed_to_the_version(tmp_path: Path) -> None:
    folder = tmp_path / MULTIARCH
    real = make_library(
        folder / "libLLVM.so.19.1",
        folder / "libLLVM-19.so",
        folder / "libLLVM.so",
        tmp_path / "usr/lib/llvm-19/lib/libLLVM.so.1",
    )
    assert llvm.search(tmp_path, tmp_path / "venv") == [llvm.Library(real, (19, 1))]


def test_broken_links_are_not_found(tmp_path: Path) -> None:
    folder = tmp_path / "usr/lib64"
    folder.mkdir(parents=True)
    (folder / "libLLVM-19.so").symlink_to("libLLVM.so.19.1")
    assert llvm.search(tmp_path, tmp_path / "venv") == []


def test_newest_usable_is_chosen_beside_14_and_15(tmp_path: Path) -> None:
    folder = tmp_path / MULTIARCH
    for name in ("libLLVM-14.so.1", "libLLVM-15.so.1", "libLLVM-16.so.1"):
        make_library(folder / name)
    newest = make_library(tmp_path / "usr/lib64/llvm19/lib/libLLVM.so.19.1")
    make_library(tmp_path / "usr/lib/llvm-9/lib/libLLVM-9.so.1")
    assert llvm.choose(llvm.search(tmp_path, tmp_path / "venv")).path == newest


def test_of_equal_versions_the_environment_comes_first(tmp_path: Path) -> None:
    make_library(tmp_path / MULTIARCH / "libLLVM.so.19.1")
    own = make_library(tmp_path / "venv/lib/llvm/libLLVM.so.19.1")
    assert llvm.choose(llvm.search(tmp_path, tmp_path / "venv")).path == own


def test_versions_14_and_15_are_never_chosen(tmp_path: Path) -> None:
    make_library(tmp_path / MULTIARCH / "libLLVM-14.so.1")
    make_library(tmp_path / MULTIARCH / "libLLVM-15.so.1")
    with pytest.raises(llvm.BackendError, match=r"no libLLVM >= 16 found \(only 14 .*, 15 "):
        llvm.choose(llvm.search(tmp_path, tmp_path / "venv"))


@pytest.mark.parametrize(
    ("tool", "advice"),
    [
        ("apt-get", "apt-get install libllvm19"),
        ("dnf", "dnf install llvm-libs"),
        ("pacman", "pacman -S llvm-libs"),
        ("brew", "brew install llvm"),
        ("none", "package manager"),
    ],
)
def test_nothing_found_says_in_one_line_how_to_install(
    tool: str, advice: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("shutil.which", lambda name: name if name == tool else None)
    with pytest.raises(llvm.BackendError, match=advice) as caught:
        llvm.choose([])
    assert "\n" not in str(caught.value)


def test_wanted_library_wins_over_a_newer_one(tmp_path: Path) -> None:
    wanted = make_library(tmp_path / "mine/libLLVM-16.so.1")
    newer = llvm.Library(tmp_path / "libLLVM.so.19.1", (19, 1))
    assert llvm.choose([newer], str(wanted)) == llvm.Library(wanted, (16,))


def test_wanted_library_of_unknown_version_is_trusted(tmp_path: Path) -> None:
    wanted = make_library(tmp_path / "mine/libLLVM.so")
    assert llvm.choose([], str(wanted)).path == wanted


def test_wanted_library_must_exist(tmp_path: Path) -> None:
    newer = llvm.Library(tmp_path / "libLLVM.so.19.1", (19, 1))
    with pytest.raises(llvm.BackendError, match=r"DRJIT_LIBLLVM_PATH is '/nowhere/libLLVM.so'"):
        llvm.choose([newer], "/nowhere/libLLVM.so")


def test_wanted_library_must_be_new_enough(tmp_path: Path) -> None:
    old = make_library(tmp_path / "libLLVM-15.so.1")
    with pytest.raises(llvm.BackendError, match=r"DRJIT_LIBLLVM_PATH names LLVM 15 .*>= 16"):
        llvm.choose([], str(old))


def test_registered_libraries_are_read_from_ldconfig(tmp_path: Path) -> None:
    real = make_library(tmp_path / "libLLVM.so.19.1", tmp_path / "libLLVM-19.so")
    make_library(tmp_path / "32/libLLVM-18.so")
    listing = (
        f"2 libs found in cache `/etc/ld.so.cache'\n"
        f"\tlibLLVM.so.19.1 (libc6,x86-64) => {real}\n"
        f"\tlibLLVM-19.so (libc6,x86-64) => {tmp_path}/libLLVM-19.so\n"
        f"\tlibLLVM-18.so (libc6) => {tmp_path}/32/libLLVM-18.so\n"
        f"\tlibLTO.so.19.1 (libc6,x86-64) => {tmp_path}/libLTO.so.19.1\n"
    )
    assert llvm.registered(listing) == [llvm.Library(real, (19, 1))]


def test_script_prints_the_path_without_importing_drpt(tmp_path: Path) -> None:
    wanted = make_library(tmp_path / "libLLVM-16.so.1")
    done = subprocess.run(
        [sys.executable, "-I", llvm.__file__],
        env={llvm.VARIABLE: str(wanted)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == f"{wanted}\n"
