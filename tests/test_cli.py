"""The command line: exit statuses, what is printed where, and bad input."""

from __future__ import annotations

import inspect
import os
import pty
import resource
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import drpt
from drpt import cli, doctor, output
from drpt.kernel import backend
from drpt.output import read_exr

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

# Bad input is answered before anything heavy is loaded: Python and NumPy take some 0.3 s to start.
# Processor time, since the clock also counts what else a machine is busy with.
MAX_SECONDS = 1.0

MESH = """vertices = [[-2, -1, 0], [2, -1, 0], [0, -1, 2]]
faces = [[0, 1, 2]]"""

SCENE = f"""
[camera]
eye = [0, 0, 5]
target = [0, 0, 0]
up = [0, 1, 0]
fov = 40
width = 8
height = 6

[[shapes]]
type = "sphere"
center = [0, 0, 0]
radius = 1
material = {{ type = "phong", albedo = 0.5, exponent = 10 }}

[[shapes]]
type = "sphere"
center = [0, 3, 0]
radius = 0.5
radiance = 10

[[shapes]]
type = "mesh"
{MESH}
material = {{ type = "diffuse", albedo = 0.5 }}
"""

# What is replaced in SCENE, by what, and what the error must name.
BAD_SCENES = {
    "not TOML": ("[camera]", "[camera", ("not TOML",)),
    "unknown key": ("fov", "fow", ("camera", "fow", "fov")),
    "negative radius": ("radius = 1", "radius = -1", ("shapes[0].radius", "-1")),
    "NaN radius": ("radius = 1", "radius = nan", ("shapes[0].radius", "nan")),
    "albedo above 1": ("albedo = 0.5, exp", "albedo = 1.5, exp", ("shapes[0].material", "1.5")),
    "negative radiance": ("radiance = 10", "radiance = -10", ("shapes[1].radiance", "-10")),
    "negative exponent": ("exponent = 10", "exponent = -1", ("exponent", "-1")),
    "infinite exponent": ("exponent = 10", "exponent = inf", ("exponent", "inf")),
    "material and radiance": ("radius = 1\n", "radius = 1\nradiance = 1\n", ("shapes[0]",)),
    "no shapes": (SCENE[SCENE.index("[[shapes]]") :], "", ("shapes",)),
    "eye is target": ("eye = [0, 0, 5]", "eye = [0, 0, 0]", ("camera.target",)),
    "up along the view": ("up = [0, 1, 0]", "up = [0, 0, 2]", ("camera.up",)),
    "fov 0": ("fov = 40", "fov = 0", ("camera.fov", "0")),
    "fov 180": ("fov = 40", "fov = 180", ("camera.fov", "180")),
    "zero-size image": ("width = 8", "width = 0", ("camera.width", "0")),
    "face index out of range": ("[[0, 1, 2]]", "[[0, 1, 3]]", ("shapes[2].faces", "3")),
    "NaN vertex": ("[-2, -1, 0]", "[nan, -1, 0]", ("shapes[2].vertices", "nan")),
    "unreadable mesh": (MESH, 'file = "no.ply"', ("shapes[2].file", "no.ply")),
}

# Flags after a good scene, and what the error must say.
BAD_FLAGS = {
    "mode": (["--mode", "fast"], ("mode", "fast", "explicit-uniform")),
    "sampler": (["--sampler", "halton"], ("sampler", "halton", "sobol")),
    "spp 0": (["--spp", "0"], ("spp", "0")),
    "spp not a number": (["--spp", "many"], ("--spp: 'many' is not an integer",)),
    "spp a fraction": (["--spp", "1.5"], ("--spp: '1.5' is not an integer",)),
    "spp in Python's way": (["--spp", "1_0"], ("--spp: '1_0' is not an integer",)),
    "spp in Arabic": (["--spp", "٣"], ("--spp: '٣' is not an integer",)),
    "spp too long": (["--spp", "1" * 5000], ("is not an integer",)),
    "bounces": (["--bounces", "-1"], ("bounces", "-1")),
    "width": (["--width", "0"], ("width", "0")),
    "height": (["--height", "-2"], ("height", "-2")),
    "threads": (["--threads", "0"], ("--threads: 0 is not allowed", "from 1 to 1024")),
    "too many threads": (["--threads", "5000000000"], ("--threads: 5000000000",)),
    "exposure not a number": (["--exposure", "x"], ("--exposure: 'x' is not a number",)),
    "exposure NaN": (["--exposure", "nan"], ("exposure", "nan")),
    "suffix": (["-o", "a.jpg"], ("a.jpg", ".exr, .png, .npy")),
    "folder": (["-o", "no/a.exr"], ("no/a.exr", "folder no does not exist")),
    "second output": (["-o", "a.exr", "-o", "a.tiff"], ("a.tiff",)),
    "flag without value": (["-o"], ("-o/--output: expected one argument",)),
    "abbreviated flag": (["--bounce", "2"], ("unknown arguments: --bounce 2",)),
    "two scenes": (["other.toml"], ("unknown arguments: other.toml",)),
}


@dataclass
class Picture:
    """A result that took no rendering."""

    image: NDArray[np.float32]
    spp: int
    bounces: int
    mode: str
    sampler: str
    warning: str | None = None
    seconds: float = 0.5
    rays: int = 4_000_000
    paths: int = 1_000_000

    def save(self, path: Path, *, exposure: float = 0.0) -> None:
        output.write(path, self.image, {"spp": self.spp}, exposure=exposure)


@dataclass
class FakeRendering:
    """Stands for `Rendering`: keeps what it is called with, and does as the test says."""

    on_pass: Callable[[], None] = lambda: None
    warning: str | None = None
    settings: dict[str, Any] = field(default_factory=dict)

    def __call__(self, *args: Any, **kwargs: Any) -> FakeRendering:
        self.settings = inspect.signature(drpt.render).bind(*args, **kwargs).arguments
        return self

    def __getattr__(self, name: str) -> Any:
        return self.settings[name]

    def passes(self) -> Iterator[int]:
        for spp in range(1, self.settings["spp"] + 1):
            self.on_pass()
            yield spp

    def result(self) -> Picture:
        camera = self.settings["scene"].camera
        settings = {name: self.settings[name] for name in ("spp", "bounces", "mode", "sampler")}
        image = np.full((camera.height, camera.width, 3), 0.25, np.float32)
        return Picture(image, **settings, warning=self.warning)


@pytest.fixture(autouse=True)
def in_folder_with_scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("good.toml").write_text(SCENE)


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> FakeRendering:
    rendering = FakeRendering()
    monkeypatch.setattr(cli, "Rendering", rendering)
    monkeypatch.setattr(backend, "load", lambda: None)
    return rendering


def status_of(run: Callable[[list[str]], int], argv: list[str]) -> int | str | None:
    try:
        return run(argv)
    except SystemExit as leave:
        return leave.code


def children_seconds() -> float:
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def files() -> list[str]:
    return sorted(path.name for path in Path().iterdir())


def assert_refused(
    capsys: pytest.CaptureFixture[str], argv: list[str], says: tuple[str, ...]
) -> None:
    before = files()
    assert status_of(cli.render_main, argv) == 2
    printed, complaint = capsys.readouterr()
    assert printed == ""
    assert complaint.startswith("drpt-render: error: ")
    assert complaint.count("\n") == 1
    assert complaint.endswith("\n")
    for words in says:
        assert words in complaint
    assert files() == before


class TestBadInput:
    @pytest.mark.parametrize(("old", "new", "says"), BAD_SCENES.values(), ids=BAD_SCENES.keys())
    def test_in_a_scene_is_refused(
        self,
        old: str,
        new: str,
        says: tuple[str, ...],
        capsys: pytest.CaptureFixture[str],
    ) -> None:
        assert old in SCENE
        Path("bad.toml").write_text(SCENE.replace(old, new, 1))
        assert_refused(capsys, ["bad.toml"], says)

    @pytest.mark.parametrize(("flags", "says"), BAD_FLAGS.values(), ids=BAD_FLAGS.keys())
    def test_in_a_flag_is_refused(
        self, flags: list[str], says: tuple[str, ...], capsys: pytest.CaptureFixture[str]
    ) -> None:
        assert_refused(capsys, ["good.toml", *flags], says)

    @pytest.mark.parametrize("scene", ["missing.toml", "no-such-scene", ".", "good.toml/x.toml"])
    def test_without_a_scene_is_refused(
        self, scene: str, capsys: pytest.CaptureFixture[str]
    ) -> None:
        assert_refused(capsys, [scene], (scene,))

    def test_a_similar_scene_is_suggested(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert_refused(capsys, ["cornel-box"], ("'cornell-box'",))

    def test_no_arguments_are_refused(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert_refused(capsys, [], ("SCENE",))

    def test_drpt_render_speaks_as_drpt_render(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert status_of(cli.main, ["render", "good.toml", "--spp", "0"]) == 2
        assert capsys.readouterr().err.startswith("drpt-render: error: spp")

    @pytest.mark.parametrize(
        ("argv", "starts"),
        [
            ([], "drpt: error: "),
            (["paint"], "drpt: error: COMMAND: invalid choice: 'paint'"),
            (["scenes", "--all"], "drpt scenes: error: unknown arguments: --all"),
            (["explain", "no-such-scene"], "drpt explain: error: "),
            (["explain", "good.toml", "--mode", "fast"], "drpt explain: error: mode"),
        ],
    )
    def test_to_another_command_is_refused(
        self, argv: list[str], starts: str, capsys: pytest.CaptureFixture[str]
    ) -> None:
        assert status_of(cli.main, argv) == 2
        printed, complaint = capsys.readouterr()
        assert printed == ""
        assert complaint.startswith(starts)
        assert complaint.count("\n") == 1

    @pytest.mark.parametrize(
        "argv",
        [
            ["no-such-scene"],
            ["good.toml", "--mode", "fast"],
            ["good.toml", "-o", "a.jpg"],
            ["good.toml", "--threads", "0"],
        ],
    )
    def test_is_answered_at_once_and_without_drjit(self, argv: list[str]) -> None:
        script = (
            "import atexit, sys\n"
            "atexit.register(lambda: print('drjit' in sys.modules))\n"
            "from drpt.cli import render_main\n"
            "render_main()\n"
        )
        before = children_seconds()
        run = subprocess.run(
            [sys.executable, "-c", script, *argv], capture_output=True, text=True, check=False
        )
        seconds = children_seconds() - before
        assert (run.returncode, run.stdout) == (2, "False\n")
        assert run.stderr.startswith("drpt-render: error: ")
        assert run.stderr.count("\n") == 1
        assert seconds < MAX_SECONDS


class TestRender:
    def test_defaults_are_those_of_the_function(self, fake: FakeRendering) -> None:
        assert cli.render_main(["good.toml"]) == 0
        defaults = {
            name: parameter.default
            for name, parameter in inspect.signature(drpt.render).parameters.items()
            if name in fake.settings and name != "scene"
        }
        assert {name: fake.settings[name] for name in defaults} == defaults
        assert {"spp", "bounces", "mode", "sampler", "seed", "jitter"} <= defaults.keys()

    def test_flags_reach_the_rendering(self, fake: FakeRendering) -> None:
        flags = "--spp 5 --bounces 0 --mode explicit --sampler independent --seed 7 --no-jitter"
        size = "--width 4 --height 3"
        assert cli.render_main(["good.toml", *flags.split(), *size.split()]) == 0
        scene = fake.settings.pop("scene")
        assert fake.settings == {
            "spp": 5,
            "bounces": 0,
            "mode": "explicit",
            "sampler": "independent",
            "seed": 7,
            "jitter": False,
        }
        assert (scene.camera.width, scene.camera.height) == (4, 3)
        assert scene.camera.fov == 40

    def test_one_side_of_the_picture_can_be_changed(self, fake: FakeRendering) -> None:
        assert cli.render_main(["good.toml", "--width", "4"]) == 0
        camera = fake.settings["scene"].camera
        assert (camera.width, camera.height) == (4, 6)

    def test_threads_reach_the_backend(
        self, fake: FakeRendering, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        counts: list[int] = []
        monkeypatch.setattr(backend, "set_thread_count", counts.append)
        assert cli.render_main(["good.toml", "--threads", "3"]) == 0
        assert counts == [3]

    @pytest.mark.usefixtures("fake")
    def test_output_is_named_after_the_scene(self) -> None:
        Path("folder").mkdir()
        Path("folder/other.toml").write_text(SCENE)
        assert cli.render_main(["folder/other.toml"]) == 0
        assert files() == ["folder", "good.toml", "other.exr"]

    @pytest.mark.usefixtures("fake")
    def test_outputs_can_be_several(self) -> None:
        argv = ["good.toml", "-o", "a.exr", "-o", "a.png", "--output", "b.npy"]
        assert cli.render_main(argv) == 0
        assert files() == ["a.exr", "a.png", "b.npy", "good.toml"]
        assert read_exr("a.exr")[1] == {"spp": 64}

    @pytest.mark.usefixtures("fake")
    def test_exposure_reaches_the_png(self) -> None:
        from PIL import Image

        assert cli.render_main(["good.toml", "-o", "a.png", "--exposure", "-100"]) == 0
        with Image.open("a.png") as picture:
            assert not np.asarray(picture).any()

    @pytest.mark.usefixtures("fake")
    def test_says_what_was_done(self, capsys: pytest.CaptureFixture[str]) -> None:
        argv = ["good.toml", "--bounces", "1", "--mode", "explicit", "-o", "a.exr", "-o", "a.png"]
        assert cli.render_main(argv) == 0
        printed, complaint = capsys.readouterr()
        assert printed.splitlines() == [
            "good  8x6  64 spp  1 bounce  explicit  sobol",
            "0.50 s  2.0 Mpaths/s  8.0 Mrays/s",
            "a.exr",
            "a.png",
        ]
        assert complaint == ""

    def test_quiet_says_nothing_but_warnings(
        self, fake: FakeRendering, capsys: pytest.CaptureFixture[str]
    ) -> None:
        fake.warning = "12 of 64 samples were not finite"
        assert cli.render_main(["good.toml", "--quiet"]) == 0
        printed, complaint = capsys.readouterr()
        assert printed == ""
        assert complaint == "drpt-render: warning: 12 of 64 samples were not finite\n"

    def test_a_full_disk_is_a_failed_run(
        self,
        fake: FakeRendering,
        monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str],
    ) -> None:
        def full(_: int) -> None:
            raise OSError(28, "No space left on device")

        monkeypatch.setattr(os, "fsync", full)
        assert cli.render_main(["good.toml"]) == 1
        complaint = "good.exr: it could not be written (No space left on device)"
        assert capsys.readouterr() == ("", f"drpt-render: error: {complaint}\n")
        assert files() == ["good.toml"]

    @pytest.mark.parametrize(
        "error", [backend.BackendError("no libLLVM found"), MemoryError("48 GiB are not there")]
    )
    def test_a_machine_that_cannot_do_it_is_a_failed_run(
        self, error: Exception, fake: FakeRendering, capsys: pytest.CaptureFixture[str]
    ) -> None:
        def fail() -> None:
            raise error

        fake.on_pass = fail
        assert cli.render_main(["good.toml"]) == 1
        assert capsys.readouterr() == ("", f"drpt-render: error: {error}\n")

    @pytest.mark.parametrize("argv", [["--help"], ["render", "--version"], ["scenes"]])
    @pytest.mark.parametrize("unbuffered", ["", "1"])
    def test_text_that_nobody_gets_is_a_failed_run(self, argv: list[str], unbuffered: str) -> None:
        with Path("/dev/full").open("w") as full:
            run = subprocess.run(
                [sys.executable, "-m", "drpt", *argv],
                stdout=full,
                stderr=subprocess.PIPE,
                text=True,
                env={**os.environ, "PYTHONUNBUFFERED": unbuffered},
                check=False,
            )
        assert run.returncode != 0
        assert "error: [Errno 28] No space left on device" in run.stderr

    def test_an_interrupt_leaves_no_picture(
        self, fake: FakeRendering, capsys: pytest.CaptureFixture[str]
    ) -> None:
        fake.on_pass = lambda: signal.raise_signal(signal.SIGINT)
        assert cli.render_main(["good.toml"]) == 130
        assert capsys.readouterr() == ("", "drpt-render: interrupted\n")
        assert files() == ["good.toml"]


class TestProgress:
    def test_is_drawn_on_a_terminal(
        self, fake: FakeRendering, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        fake.on_pass = lambda: time.sleep(0.01)
        shown = shown_on_terminal(["good.toml"], monkeypatch)
        assert "/64 spp" in shown
        assert "Mpaths/s" in shown
        assert "0:00:0" in shown

    @pytest.mark.usefixtures("fake")
    def test_is_not_drawn_when_quiet(self, monkeypatch: pytest.MonkeyPatch) -> None:
        assert shown_on_terminal(["good.toml", "--quiet"], monkeypatch) == ""

    def test_gives_way_to_an_interrupt(
        self, fake: FakeRendering, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        fake.on_pass = lambda: signal.raise_signal(signal.SIGINT)
        shown = shown_on_terminal(["good.toml"], monkeypatch, status=130)
        assert shown.endswith("drpt-render: interrupted\r\n")


def shown_on_terminal(argv: list[str], monkeypatch: pytest.MonkeyPatch, status: int = 0) -> str:
    """Run `drpt-render` with a terminal as stderr, and return all that it shows there."""
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "100")
    ours, theirs = pty.openpty()
    shown: list[bytes] = []
    reader = threading.Thread(target=_read_all, args=(ours, shown))
    reader.start()
    with os.fdopen(theirs, "w") as stderr, monkeypatch.context() as patch:
        patch.setattr(sys, "stderr", stderr)
        left_with = cli.render_main(argv)
    reader.join()
    os.close(ours)
    assert left_with == status
    return b"".join(shown).decode()


def _read_all(terminal: int, shown: list[bytes]) -> None:
    # Linux reports a terminal that its last writer has closed as an error.
    with suppress(OSError):
        while data := os.read(terminal, 4096):
            shown.append(data)


class TestOtherCommands:
    def test_scenes_lists_each_with_a_line(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert cli.main(["scenes"]) == 0
        lines = capsys.readouterr().out.splitlines()
        assert [line.split()[0] for line in lines] == list(drpt.scene.builtin_names())
        assert "cornell-box" in drpt.scene.builtin_names()
        assert all(len(line.split()) > 3 for line in lines)

    def test_explain_prints_the_explanation(
        self, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        def explain(scene: drpt.Scene, *, bounces: int, mode: str) -> str:
            return f"{len(scene.shapes)} shapes, {bounces}, {mode}"

        monkeypatch.setattr(drpt, "explain", explain)
        assert cli.main(["explain", "good.toml", "--bounces", "2", "--mode", "explicit"]) == 0
        assert capsys.readouterr().out == "3 shapes, 2, explicit\n"

    @pytest.mark.parametrize("status", [0, 1])
    def test_doctor_decides_on_the_status(
        self, status: int, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(doctor, "main", lambda: status)
        assert cli.main(["doctor"]) == status

    @pytest.mark.parametrize("unbuffered", ["", "1"])
    def test_a_reader_that_has_enough_is_no_error(self, unbuffered: str) -> None:
        theirs, ours = os.pipe()
        os.close(theirs)
        run = subprocess.run(
            [sys.executable, "-m", "drpt", "scenes"],
            stdout=ours,
            stderr=subprocess.PIPE,
            env={**os.environ, "PYTHONUNBUFFERED": unbuffered},
            check=False,
        )
        os.close(ours)
        assert (run.returncode, run.stderr) == (0, b"")

    @pytest.mark.parametrize(
        ("argv", "says"),
        [
            (["--help"], ("render", "scenes", "doctor", "explain", "drpt scenes")),
            (["render", "--help"], ("--spp", "SCENE.exr", "implicit-uniform", "drpt-render ")),
            (["--version"], (f"drpt {drpt.__version__}",)),
            (["render", "--version"], (f"drpt-render {drpt.__version__}",)),
        ],
    )
    def test_help_and_version_are_printed(
        self, argv: list[str], says: tuple[str, ...], capsys: pytest.CaptureFixture[str]
    ) -> None:
        assert status_of(cli.main, argv) == 0
        printed = capsys.readouterr().out
        for words in says:
            assert words in printed


def test_the_program_renders_what_the_function_renders() -> None:
    flags = ["--spp", "4", "--bounces", "2", "--mode", "explicit", "--seed", "3", "--width", "5"]
    run = subprocess.run(
        [sys.executable, "-m", "drpt", "render", "good.toml", *flags],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (run.returncode, run.stderr) == (0, "")
    assert run.stdout.startswith("good  5x6  4 spp  2 bounces  explicit  sobol\n")
    image, metadata = read_exr("good.exr")
    scene = drpt.load_scene("good.toml")
    scene = replace(scene, camera=replace(scene.camera, width=5))
    expected = drpt.render(scene, spp=4, bounces=2, mode="explicit", seed=3)
    np.testing.assert_array_equal(image, expected.image)
    assert image.any()
    assert (metadata["spp"], metadata["mode"], metadata["seed"]) == (4, "explicit", 3)


CHECK_FLAGS = ["--spp", "64", "--bounces", "1", "--width", "16", "--height", "12"]


class TestCheck:
    @pytest.mark.parametrize(
        ("flags", "says"),
        [
            (["--mode", "fast"], "mode: 'fast'"),
            (["--spp", "100"], "spp: 100 is not allowed; it must be a multiple of 64"),
            (["--bounces", "-1"], "bounces: -1"),
            (["--sampler", "halton"], "sampler: 'halton'"),
            (["--width", "0"], "width: 0"),
            (["--against", "no.exr"], "no.exr"),
            (["--against", "good.toml"], "good.toml: this is not a readable EXR file"),
            (["-o", "good.toml"], "good.toml: this is a file, and maps need a folder"),
            (["--against", "a.npy"], "a.npy: No such file or directory"),
        ],
    )
    def test_bad_input_is_refused(
        self, flags: list[str], says: str, capsys: pytest.CaptureFixture[str]
    ) -> None:
        before = files()
        assert status_of(cli.main, ["check", "good.toml", *flags]) == 2
        printed, complaint = capsys.readouterr()
        assert printed == ""
        assert complaint.startswith("drpt check: error: ")
        assert says in complaint
        assert complaint.count("\n") == 1
        assert files() == before

    def test_all_modes_are_held_against_mitsuba(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert cli.main(["check", "good.toml", "--mode", "all", *CHECK_FLAGS]) == 0
        printed, complaint = capsys.readouterr()
        assert printed.startswith("reference: Mitsuba 3.9.1 (llvm_ad_rgb), 64 spp, 16x12, 1 bounce")
        assert [mode for mode in drpt.Mode if f"\n{mode}, sobol, 64 spp: " in printed] == [
            *drpt.Mode
        ]
        assert complaint == ""
        assert files() == ["good.toml"]

    def test_maps_are_written_where_they_are_asked_for(self) -> None:
        assert cli.main(["check", "good.toml", "-o", "maps", *CHECK_FLAGS]) == 0
        assert sorted(path.name for path in Path("maps").glob("*.exr")) == [
            f"mis-1-{name}.exr" for name in ("difference", "image", "p-value", "reference")
        ]

    @pytest.mark.parametrize(
        ("flags", "says"),
        [
            (["--width", "16", "--height", "12"], "width: 16 is not allowed; it must be 8, as in"),
            (["--bounces", "2"], "bounces: 2 is not allowed; it must be 1, as in a.exr"),
        ],
    )
    def test_settings_must_be_those_of_the_reference(
        self, flags: list[str], says: str, capsys: pytest.CaptureFixture[str]
    ) -> None:
        drpt.render(drpt.load_scene("good.toml"), 4, 1).save("a.exr")
        command = ["check", "good.toml", "--against", "a.exr", "--spp", "64", "-o", "maps"]
        assert status_of(cli.main, [*command, *flags]) == 2
        assert says in capsys.readouterr().err
        assert files() == ["a.exr", "good.toml"]

    def test_nobody_who_reads_it_is_no_pass(self) -> None:
        script = "from drpt.cli import main; import sys; sys.exit(main())"
        command = [sys.executable, "-c", script, "check", "good.toml", *CHECK_FLAGS]
        reader, writer = os.pipe()
        os.close(reader)
        assert subprocess.run(command, stdout=writer, check=False).returncode == 1
        os.close(writer)

    def test_a_picture_that_differs_fails(self, capsys: pytest.CaptureFixture[str]) -> None:
        """The reference is brighter by a tenth; it tells its own bounces and size."""
        scene = drpt.load_scene("good.toml")
        picture = drpt.render(scene, 4096, 1)
        output.write("a.exr", 1.1 * picture.image, picture.metadata)
        assert cli.main(["check", "good.toml", "--against", "a.exr", "--spp", "65536"]) == 1
        printed, _ = capsys.readouterr()
        assert "reference: a.exr, 8x6, 1 bounce" in printed
        assert "mis, sobol, 65536 spp: FAIL" in printed
        assert "good-check/mis-1-p-value.png" in printed
        assert Path("good-check/mis-1-difference.png").is_file()
