"""`drpt-render`: bad input, what reaches the rendering, what is written and what is printed."""

from __future__ import annotations

import errno
import inspect
import os
import pty
import re
import resource
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image

import drpt
from drpt import cli, output
from drpt.checkpoint import Checkpoint
from drpt.cli import render
from drpt.kernel import backend
from drpt.output import read, read_exr
from tests.cli.running import MESH, SCENE, assert_refused, files, status_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

# Bad input is answered before anything heavy is loaded: Python and NumPy take some 0.3 s to start.
# Processor time, since the clock also counts what else a machine is busy with.
MAX_SECONDS = 1.0

# Flags with which 64 samples take three passes, of 16, 16 and 32.
SHORT_PASSES = ["--time-limit", "1000"]
STOPPING = "stopping after this pass; once more stops at once\n"
# The last line of a summary, but for the error.
SPEED = r"[0-9.]+ s  [0-9.]+ Mpaths/s  [0-9.]+ Mrays/s"

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
    "curve": (["--curve", "aces"], ("curve: 'aces' is not allowed", "srgb, filmic")),
    "suffix": (["-o", "a.jpg"], ("a.jpg", ".exr, .png, .npy")),
    "folder": (["-o", "no/a.exr"], ("no/a.exr", "folder no does not exist")),
    "target error 0": (["--target-error", "0"], ("target_error", "0", "a finite number > 0")),
    "negative target error": (["--target-error", "-1"], ("target_error", "-1")),
    "target error NaN": (["--target-error", "nan"], ("target_error", "nan")),
    "target error without error": (
        ["--target-error", "1", "--no-error"],
        ("error", "target_error"),
    ),
    "time limit 0": (["--time-limit", "0"], ("time_limit", "0", "a finite number > 0")),
    "time limit NaN": (["--time-limit", "nan"], ("time_limit", "nan")),
    "infinite time limit": (["--time-limit", "inf"], ("time_limit", "inf")),
    "checkpoint interval": (["--checkpoint-interval", "0"], ("checkpoint_interval", "0")),
    "checkpoint in no folder": (["--checkpoint", "no/a.drpt"], ("no/a.drpt", "does not exist")),
    "checkpoint is a folder": (["--checkpoint", "."], (".: this is a folder",)),
    "checkpoint is no checkpoint": (
        ["--checkpoint", "good.toml"],
        ("good.toml: this is no checkpoint",),
    ),
    "checkpoint is a picture": (["--checkpoint", "./a.exr", "-o", "a.exr"], ("checkpoint: a.exr",)),
    "tev": (["--tev", "host:port"], ("tev: 'host:port' is not allowed", "localhost:14158")),
    "second output": (["-o", "a.exr", "-o", "a.tiff"], ("a.tiff",)),
    "flag without value": (["-o"], ("-o/--output: expected one argument",)),
    "abbreviated flag": (["--bounce", "2"], ("unknown arguments: --bounce 2",)),
    "two scenes": (["other.toml"], ("unknown arguments: other.toml",)),
}


@dataclass
class Fake:
    """Stands for a launcher that takes no rendering; keeps what `Rendering` is called with."""

    on_pass: Callable[[], object] = lambda: None
    sample: float = 0.25
    arguments: dict[str, Any] = field(default_factory=dict)
    passes: int = 0
    paths_per_ray = 1

    def rendering(self, *args: Any, **kwargs: Any) -> drpt.Rendering:
        self.arguments = inspect.signature(drpt.Rendering).bind(*args, **kwargs).arguments
        return drpt.Rendering(*args, **kwargs)

    def launch(self, pixels: range, samples: range, run: int, _: int) -> SimpleNamespace:
        self.passes += 1
        self.on_pass()
        sums = np.full((len(samples) // run, len(pixels), 3), run * self.sample)
        bad = 0 if np.isfinite(self.sample) else len(samples) * len(pixels)
        return SimpleNamespace(radiance=sums, rays=4 * len(pixels) * len(samples), non_finite=bad)

    def signal_in_pass(self, number: int, chosen: int) -> None:
        """Have a signal come in one of the passes, counted from 1."""

        def on_pass() -> None:
            if self.passes == chosen:
                signal.raise_signal(number)

        self.on_pass = on_pass


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> Fake:
    fake = Fake()
    machine = SimpleNamespace(name="llvm", llvm_version="22", vector_width=8)
    monkeypatch.setattr(render, "Rendering", fake.rendering)
    monkeypatch.setattr(drpt.Rendering, "launcher", fake)
    monkeypatch.setattr(drpt.Rendering, "_measure", lambda _, estimate: estimate)
    monkeypatch.setattr(drpt.Rendering, "_digest", lambda _: "that of the launcher")
    monkeypatch.setattr(backend, "load", lambda: None)
    monkeypatch.setattr(backend, "describe", lambda: machine)
    return fake


def children_seconds() -> float:
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


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
    def test_defaults_are_those_of_the_function(self, fake: Fake) -> None:
        assert cli.render_main(["good.toml"]) == 0
        defaults = {
            name: parameter.default
            for name, parameter in inspect.signature(drpt.Rendering).parameters.items()
        }
        assert {**fake.arguments, "scene": defaults["scene"]} == defaults

    def test_flags_reach_the_rendering(self, fake: Fake) -> None:
        flags = "--spp 5 --bounces 0 --mode explicit --sampler independent --seed 7 --no-jitter"
        size = "--width 4 --height 3"
        end = "--target-error 9 --time-limit 8 --checkpoint a.drpt --checkpoint-interval 7"
        assert cli.render_main(["good.toml", *f"{flags} {size} {end}".split()]) == 0
        scene = fake.arguments.pop("scene")
        assert fake.arguments == {
            "spp": 5,
            "bounces": 0,
            "mode": "explicit",
            "sampler": "independent",
            "seed": 7,
            "jitter": False,
            "error": True,
            "target_error": 9,
            "time_limit": 8,
            "checkpoint": Path("a.drpt"),
            "checkpoint_interval": 7,
        }
        assert (scene.camera.width, scene.camera.height) == (4, 3)
        assert scene.camera.fov == 40

    def test_one_side_of_the_picture_can_be_changed(self, fake: Fake) -> None:
        assert cli.render_main(["good.toml", "--width", "4"]) == 0
        camera = fake.arguments["scene"].camera
        assert (camera.width, camera.height) == (4, 3)

    def test_threads_reach_the_backend(self, fake: Fake, monkeypatch: pytest.MonkeyPatch) -> None:
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
        image, metadata = read_exr("a.exr")
        np.testing.assert_array_equal(image, np.full((6, 8, 3), 0.25, np.float32))
        assert (metadata["spp"], metadata["partial"]) == (64, False)

    @pytest.mark.usefixtures("fake")
    def test_exposure_reaches_the_png(self) -> None:
        assert cli.render_main(["good.toml", "-o", "a.png", "--exposure", "-100"]) == 0
        with Image.open("a.png") as picture:
            assert not np.asarray(picture).any()

    @pytest.mark.usefixtures("fake")
    def test_curve_reaches_the_png(self) -> None:
        argv = ["good.toml", "-o", "a.png", "--exposure", "2", "--curve", "filmic"]
        assert cli.render_main(argv) == 0
        with Image.open("a.png") as picture:
            levels = np.asarray(picture)
        radiance = np.full((6, 8, 3), 0.25, np.float32)
        np.testing.assert_array_equal(levels, output.to_display(radiance, 2, "filmic"))

    @pytest.mark.usefixtures("fake")
    def test_says_what_was_done(self, capsys: pytest.CaptureFixture[str]) -> None:
        argv = ["good.toml", "--bounces", "1", "--mode", "explicit", "-o", "a.exr", "-o", "a.png"]
        assert cli.render_main(argv) == 0
        printed, complaint = capsys.readouterr()
        what, speed, *places = printed.splitlines()
        assert what == "good  8x6  64 spp  1 bounce  explicit  sobol"
        assert re.fullmatch(rf"{SPEED}  relMSE about 0\.0e\+00", speed)
        assert places == ["a.exr", "a.png"]
        assert complaint == ""

    @pytest.mark.usefixtures("fake")
    def test_without_error_there_is_none(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert cli.render_main(["good.toml", "--no-error"]) == 0
        assert re.fullmatch(SPEED, capsys.readouterr().out.splitlines()[1])
        layers, metadata = read("good.exr")
        assert "standard_error" not in layers
        assert "error" not in metadata

    @pytest.mark.usefixtures("fake")
    def test_enough_is_not_partial(self, capsys: pytest.CaptureFixture[str]) -> None:
        argv = ["good.toml", "--spp", "1000000000", "--target-error", "1e-9"]
        assert cli.render_main(argv) == 0
        assert "8x6  64 spp  3 bounces" in capsys.readouterr().out
        assert read_exr("good.exr")[1]["partial"] is False

    @pytest.mark.parametrize("sample", [np.nan, np.inf])
    def test_quiet_says_nothing_but_warnings(
        self, sample: float, fake: Fake, capsys: pytest.CaptureFixture[str]
    ) -> None:
        fake.sample = sample
        assert cli.render_main(["good.toml", "--quiet"]) == 0
        printed, complaint = capsys.readouterr()
        assert printed == ""
        assert complaint.startswith("drpt-render: warning: 3072 samples were not finite, one of")
        assert complaint.count("\n") == 1

    @pytest.mark.parametrize(
        "error", [backend.BackendError("no libLLVM found"), MemoryError("48 GiB are not there")]
    )
    def test_a_machine_that_cannot_do_it_is_a_failed_run(
        self, error: Exception, fake: Fake, capsys: pytest.CaptureFixture[str]
    ) -> None:
        def fail() -> None:
            raise error

        fake.on_pass = fail
        assert cli.render_main(["good.toml"]) == 1
        assert capsys.readouterr() == ("", f"drpt-render: error: {error}\n")

    def test_without_stderr_the_picture_is_written(
        self, fake: Fake, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(sys, "stderr", None)
        assert cli.render_main(["good.toml"]) == 0
        assert fake.passes == 1
        assert files() == ["good.exr", "good.toml"]


class TestExplain:
    @pytest.fixture(autouse=True)
    def explained(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(
            render, "explain", lambda scene, *facts: (scene.camera.width, *map(str, facts))
        )

    def test_is_printed_before_the_first_pass(
        self, fake: Fake, capsys: pytest.CaptureFixture[str]
    ) -> None:
        printed: list[str] = []
        fake.on_pass = lambda: printed.append(capsys.readouterr().out)
        argv = ["good.toml", "--explain", "--width", "4", "--bounces", "1", "--mode", "explicit"]
        assert cli.render_main(argv) == 0
        assert printed == ["(4, '1', 'explicit')\n"]
        assert capsys.readouterr().out.startswith("good  4x3")

    @pytest.mark.usefixtures("fake")
    def test_that_nobody_reads_keeps_no_picture_away(self, monkeypatch: pytest.MonkeyPatch) -> None:
        theirs, ours = os.pipe()
        os.close(theirs)
        with os.fdopen(ours, "w") as stdout, monkeypatch.context() as patch:
            patch.setattr(sys, "stdout", stdout)
            assert cli.render_main(["good.toml", "--explain"]) == 0
        assert files() == ["good.exr", "good.toml"]


class TestLayers:
    @pytest.fixture(autouse=True)
    def first_hits(self, fake: Fake, monkeypatch: pytest.MonkeyPatch) -> None:
        layers = {
            "albedo": np.full((6, 8, 3), 0.5, np.float32),
            "normal": np.full((6, 8, 3), -1, np.float32),
        }
        monkeypatch.setattr(drpt.Rendering, "first_hits", lambda _: layers)

    @pytest.fixture
    def denoiser(self, monkeypatch: pytest.MonkeyPatch) -> None:
        def guided_mean(*layers: NDArray[np.float32], hdr: bool) -> NDArray[np.float32]:
            assert hdr
            return np.asarray(np.mean(layers, axis=0))

        package = SimpleNamespace(denoise=guided_mean)
        monkeypatch.setitem(sys.modules, "mitsuba_oidn", package)

    @pytest.mark.parametrize(("flags", "more"), [([], set()), (["--layers"], {"albedo", "normal"})])
    def test_are_written_where_asked_for(self, flags: list[str], more: set[str]) -> None:
        assert cli.render_main(["good.toml", *flags]) == 0
        layers, metadata = read("good.exr")
        assert layers.keys() == {"RGB", "samples", "standard_error", *more}
        assert metadata["denoised"] is False

    @pytest.mark.usefixtures("denoiser")
    @pytest.mark.parametrize(("flags", "more"), [([], set()), (["--layers"], {"albedo", "normal"})])
    def test_guide_the_denoiser(
        self, flags: list[str], more: set[str], capsys: pytest.CaptureFixture[str]
    ) -> None:
        assert cli.render_main(["good.toml", "--denoise", *flags]) == 0
        layers, metadata = read("good.exr")
        assert layers.keys() == {"RGB", "samples", *more}
        assert metadata["denoised"] is True
        np.testing.assert_allclose(layers["RGB"], np.mean([0.25, 0.5, -1]))
        what, speed, _ = capsys.readouterr().out.splitlines()
        assert what.endswith("  denoised (biased)")
        assert re.fullmatch(SPEED, speed)

    def test_denoising_without_the_package_is_refused(
        self, fake: Fake, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        monkeypatch.setitem(sys.modules, "mitsuba_oidn", None)
        assert_refused(capsys, ["good.toml", "--denoise"], ("denoise:", "[denoise]'"))
        assert fake.passes == 0


class TestCheckpoint:
    FLAGS = ("--checkpoint", "a.drpt", *SHORT_PASSES)

    def test_is_gone_on_from(self, fake: Fake) -> None:
        fake.signal_in_pass(signal.SIGTERM, 2)
        assert cli.render_main(["good.toml", *self.FLAGS]) == 143
        assert read_exr("good.exr")[1]["spp"] == 32
        assert cli.render_main(["good.toml", *self.FLAGS]) == 0
        assert fake.passes == 3
        assert read_exr("good.exr")[1]["spp"] == 64
        assert files() == ["a.drpt", "good.exr", "good.toml"]

    def test_of_a_finished_render_writes_the_picture_again(self, fake: Fake) -> None:
        assert cli.render_main(["good.toml", *self.FLAGS]) == 0
        picture = Path("good.exr").read_bytes()
        assert cli.render_main(["good.toml", *self.FLAGS]) == 0
        assert fake.passes == 3
        assert Path("good.exr").read_bytes() == picture

    @pytest.mark.parametrize(
        ("flags", "says"),
        [
            (["--spp", "8"], "spp is 64 there and 8 here"),
            (["--seed", "1"], "seed is 0 there and 1 here"),
            (["--no-error"], "error is True there and False here"),
            (["--width", "4"], "scene is width = 8 there and width = 4 here"),
        ],
    )
    def test_of_another_command_is_refused(
        self, flags: list[str], says: str, fake: Fake, capsys: pytest.CaptureFixture[str]
    ) -> None:
        assert cli.render_main(["good.toml", "--quiet", *self.FLAGS]) == 0
        saved, passes = Path("a.drpt").read_bytes(), fake.passes
        assert_refused(capsys, ["good.toml", *self.FLAGS, *flags], ("a.drpt", says))
        assert (Path("a.drpt").read_bytes(), fake.passes) == (saved, passes)

    @pytest.mark.usefixtures("fake")
    @pytest.mark.parametrize("cut", [0, 100, 1000, -1])
    def test_that_is_cut_off_is_refused(self, cut: int, capsys: pytest.CaptureFixture[str]) -> None:
        assert cli.render_main(["good.toml", "--quiet", *self.FLAGS]) == 0
        Path("a.drpt").write_bytes(Path("a.drpt").read_bytes()[:cut])
        assert_refused(capsys, ["good.toml", *self.FLAGS], ("a.drpt: ",))

    @pytest.mark.usefixtures("fake")
    def test_in_a_folder_for_reading_is_refused(
        self, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        shut = Path("shut")
        shut.mkdir()

        # As the system answers whoever is not root, who may write everywhere.
        opened = tempfile.TemporaryFile

        def refuse(**arguments: Any) -> Any:
            if arguments["dir"] == shut:
                raise PermissionError(errno.EACCES, "Permission denied")
            return opened(**arguments)

        monkeypatch.setattr(tempfile, "TemporaryFile", refuse)
        argv = ["good.toml", "--checkpoint", "shut/a.drpt"]
        assert_refused(capsys, argv, ("shut/a.drpt", "cannot be written to"))

    @pytest.mark.usefixtures("fake")
    @pytest.mark.filterwarnings("default")
    def test_that_cannot_be_saved_is_a_warning(
        self, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        def full(*_: object) -> None:
            raise OSError("a.drpt: there is no room")

        monkeypatch.setattr(Checkpoint, "save", full)
        argv = ["good.toml", "--quiet", *self.FLAGS, "--checkpoint-interval", "1e-9"]
        assert cli.render_main(argv) == 0
        printed, complaint = capsys.readouterr()
        assert printed == ""
        # Whether amid the passes or after the last; not for each state.
        warning = "drpt-render: warning: no checkpoint: a.drpt: there is no room"
        assert complaint.splitlines() == 2 * [warning]
        assert files() == ["good.exr", "good.toml"]


@pytest.mark.usefixtures("fake")
@pytest.mark.filterwarnings("default")
def test_no_tev_is_a_single_warning(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket() as deaf:
        deaf.bind(("127.0.0.1", 0))
        at = "{}:{}".format(*deaf.getsockname())
        assert cli.render_main(["good.toml", "--quiet", "--tev", at, *SHORT_PASSES]) == 0
    printed, complaint = capsys.readouterr()
    assert printed == ""
    assert complaint.startswith(f"drpt-render: warning: no preview: tev at {at}")
    assert complaint.count("\n") == 1


class TestSaving:
    def test_to_a_folder_that_has_gone_keeps_the_picture(
        self, fake: Fake, capsys: pytest.CaptureFixture[str]
    ) -> None:
        Path("folder").mkdir()
        fake.on_pass = lambda: shutil.rmtree("folder")
        assert cli.render_main(["good.toml", "-o", "folder/a.exr", "-o", "b.png"]) == 1
        (kept,) = Path.cwd().glob("a-*.exr")
        assert read_exr(kept)[1]["spp"] == 64
        assert files() == [kept.name, "b.png", "good.toml"]
        printed, complaint = capsys.readouterr()
        assert printed.splitlines()[2:] == [str(kept), "b.png"]
        assert complaint.splitlines() == [
            "drpt-render: error: folder/a.exr: the folder folder does not exist",
            f"drpt-render: the picture is kept in {kept}",
        ]

    def test_where_the_current_folder_has_gone_keeps_the_picture_at_home(
        self, fake: Fake, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        home = Path.cwd()
        gone = home / "gone"
        gone.mkdir()
        monkeypatch.setenv("HOME", str(home))
        monkeypatch.chdir(gone)
        fake.on_pass = gone.rmdir
        assert cli.render_main(["../good.toml"]) == 1
        (kept,) = home.glob("good-*.exr")
        assert f"kept in {kept}\n" in capsys.readouterr().err

    @pytest.mark.slow
    def test_where_files_may_not_grow_says_so_in_plain_words(self) -> None:
        argv = [sys.executable, "-m", "drpt", "render", "good.toml", "--checkpoint", "a.drpt"]
        run = subprocess.run(
            ["sh", "-c", 'ulimit -f 1; exec "$@"', "sh", *argv],
            capture_output=True,
            text=True,
            check=False,
        )
        warning, error, lost = run.stderr.splitlines()
        assert warning.startswith("drpt-render: warning: no checkpoint: a.drpt: it could not be wr")
        assert error == "drpt-render: error: good.exr: it could not be written (File too large)"
        assert lost.startswith("drpt-render: the picture is lost")
        assert run.returncode == 1
        assert files() == ["good.toml"]

    @pytest.mark.usefixtures("fake")
    def test_nowhere_says_that_the_picture_is_lost(
        self, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        def full(_: int) -> None:
            raise OSError(28, "No space left on device")

        monkeypatch.setattr(os, "fsync", full)
        assert cli.render_main(["good.toml", "--quiet"]) == 1
        printed, complaint = capsys.readouterr()
        assert printed == ""
        error, lost = complaint.splitlines()
        why = "good.exr: it could not be written (No space left on device)"
        assert error == f"drpt-render: error: {why}"
        assert lost.startswith("drpt-render: the picture is lost")
        assert files() == ["good.toml"]


class TestInterrupt:
    @pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
    def test_leaves_a_partial_picture(
        self, number: int, status: int, fake: Fake, capsys: pytest.CaptureFixture[str]
    ) -> None:
        fake.signal_in_pass(number, 2)
        assert cli.render_main(["good.toml", *SHORT_PASSES]) == status
        metadata = read_exr("good.exr")[1]
        assert (metadata["spp"], metadata["partial"]) == (32, True)
        printed, complaint = capsys.readouterr()
        assert "  32 spp (partial)  3 bounces" in printed
        assert complaint == STOPPING

    @pytest.mark.usefixtures("fake")
    def test_while_the_picture_is_written_lets_it_be(
        self, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        def fsync(_: int) -> None:  # of the file, and of its folder
            monkeypatch.setattr(os, "fsync", lambda _: None)
            signal.raise_signal(signal.SIGTERM)

        monkeypatch.setattr(os, "fsync", fsync)
        assert cli.render_main(["good.toml", "--quiet"]) == 143
        assert read_exr("good.exr")[1]["partial"] is False
        assert capsys.readouterr() == ("", STOPPING)

    @pytest.mark.parametrize(
        ("first", "second", "status"),
        [
            (signal.SIGINT, signal.SIGINT, 130),
            (signal.SIGINT, signal.SIGTERM, 130),
            (signal.SIGTERM, signal.SIGINT, 143),
            (signal.SIGTERM, signal.SIGTERM, 143),
        ],
    )
    def test_for_the_second_time_leaves_nothing(
        self,
        first: int,
        second: int,
        status: int,
        fake: Fake,
        monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str],
    ) -> None:
        fake.signal_in_pass(first, 1)
        monkeypatch.setattr(os, "fsync", lambda _: signal.raise_signal(second))
        assert status_of(cli.render_main, ["good.toml"]) == status
        assert capsys.readouterr() == ("", STOPPING)
        assert files() == ["good.toml"]


class TestProgress:
    def test_is_drawn_on_a_terminal(self, fake: Fake, monkeypatch: pytest.MonkeyPatch) -> None:
        fake.on_pass = lambda: time.sleep(0.01)
        shown = shown_on_terminal(["good.toml", *SHORT_PASSES], monkeypatch)
        assert "64/64 spp" in shown
        assert "relMSE 0.0e+00" in shown
        assert "Mpaths/s" in shown
        assert "0:00:0" in shown

    @pytest.mark.usefixtures("fake")
    def test_is_not_drawn_when_quiet(self, monkeypatch: pytest.MonkeyPatch) -> None:
        assert shown_on_terminal(["good.toml", "--quiet"], monkeypatch) == ""

    def test_gives_way_to_an_interrupt(self, fake: Fake, monkeypatch: pytest.MonkeyPatch) -> None:
        fake.signal_in_pass(signal.SIGINT, 1)
        shown = shown_on_terminal(["good.toml", *SHORT_PASSES], monkeypatch, status=130)
        assert "stopping after this pass; once more stops at once" in shown
        assert read_exr("good.exr")[1]["spp"] == 16


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


def test_the_program_renders_what_the_function_renders() -> None:
    flags = ["--spp", "4", "--bounces", "2", "--mode", "explicit", "--seed", "3", "--width", "5"]
    run = subprocess.run(
        [sys.executable, "-m", "drpt", "render", "good.toml", *flags],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (run.returncode, run.stderr) == (0, "")
    assert run.stdout.startswith("good  5x4  4 spp  2 bounces  explicit  sobol\n")
    image, metadata = read_exr("good.exr")
    scene = drpt.load_scene("good.toml")
    scene = replace(scene, camera=replace(scene.camera, width=5, height=4))
    expected = drpt.render(scene, spp=4, bounces=2, mode="explicit", seed=3)
    np.testing.assert_array_equal(image, expected.image)
    assert image.any()
    assert (metadata["spp"], metadata["mode"], metadata["seed"]) == (4, "explicit", 3)


@pytest.mark.filterwarnings("default:surfaces overlap in one place")
def test_shapes_that_overlap_give_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    mesh = f'[[shapes]]\ntype = "mesh"\n{MESH}\nmaterial = {{ type = "diffuse", albedo = 0.9 }}\n'
    Path("two.toml").write_text(SCENE + mesh, encoding="utf-8")
    assert cli.render_main(["two.toml", "--spp", "1", "--quiet", "--explain"]) == 0
    assert capsys.readouterr().err == (
        "drpt-render: warning: surfaces overlap in one place, where the later one is seen: "
        "shapes[2] and shapes[3]\n"
    )
