"""Signals: what is noted, who is let alone, and what programs that they hit leave behind."""

from __future__ import annotations

import os
import pty
import random
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from drpt.cli.interrupts import SIGNALS, interrupts_noted, interrupts_raised
from drpt.kernel.backend import interrupts_put_off
from drpt.output import read_exr
from tests.cli.running import files

if TYPE_CHECKING:
    from collections.abc import Iterator

STATUSES = {signal.SIGINT: 130, signal.SIGTERM: 143}
RENDER = [sys.executable, "-m", "drpt", "render", "good.toml"]
# More samples than a test has time for.
FOREVER = ["--spp", "1000000000"]
# Seconds after which a program that was told to end hangs.
PATIENCE = 60
ROUNDS = 8
# Runs `python -m drpt`, once somebody knows that its first line comes next.
MARKED = """
import runpy, signal, sys
signal.signal(signal.SIGINT, signal.SIG_DFL)
print(flush=True)
sys.argv[0] = "drpt"
runpy.run_module("drpt", run_name="__main__")
"""


@pytest.fixture(autouse=True)
def handlers_stay() -> Iterator[None]:
    before = [signal.getsignal(number) for number in SIGNALS]
    yield
    assert [signal.getsignal(number) for number in SIGNALS] == before


class TestInterruptsNoted:
    def test_without_a_signal_there_is_no_status(self) -> None:
        with interrupts_noted() as request:
            pass
        assert (request.signal, request.status) == (None, 0)

    @pytest.mark.parametrize("number", SIGNALS)
    def test_the_first_is_noted(
        self, number: signal.Signals, capsys: pytest.CaptureFixture[str]
    ) -> None:
        with interrupts_noted() as request:
            signal.raise_signal(number)
        assert (request.signal, request.status) == (number, STATUSES[number])
        assert capsys.readouterr() == ("", "stopping after this pass; once more stops at once\n")

    @pytest.mark.parametrize("first", SIGNALS)
    @pytest.mark.parametrize("second", SIGNALS)
    def test_the_second_leaves(self, first: signal.Signals, second: signal.Signals) -> None:
        def render() -> None:
            with interrupts_noted():
                signal.raise_signal(first)
                signal.raise_signal(second)

        with pytest.raises(SystemExit) as leaving:
            render()
        assert leaving.value.code == STATUSES[first]

    def test_the_second_waits_for_drjit(self) -> None:
        done = []

        def render() -> None:
            with interrupts_noted():
                with interrupts_put_off():
                    signal.raise_signal(signal.SIGTERM)
                    signal.raise_signal(signal.SIGTERM)
                    done.append("kernel")
                done.append("more")

        with pytest.raises(SystemExit) as leaving:
            render()
        assert (leaving.value.code, done) == (143, ["kernel"])

    def test_nobody_has_to_hear_of_it(self, monkeypatch: pytest.MonkeyPatch) -> None:
        class Closed:
            def write(self, _: str) -> int:
                raise BrokenPipeError

        monkeypatch.setattr(sys, "stderr", Closed())
        with interrupts_noted() as request:
            signal.raise_signal(signal.SIGINT)
        assert request.status == 130

    def test_what_was_ignored_stays_so(self) -> None:
        before = signal.signal(signal.SIGINT, signal.SIG_IGN)
        try:
            with interrupts_noted() as request:
                signal.raise_signal(signal.SIGINT)
        finally:
            signal.signal(signal.SIGINT, before)
        assert request.signal is None


class TestInterruptsRaised:
    def test_the_first_raises_and_the_next_does_what_it_did(self) -> None:
        heard = []
        before = signal.signal(signal.SIGINT, lambda number, _: heard.append(number))
        try:
            with interrupts_raised():
                with pytest.raises(KeyboardInterrupt):
                    signal.raise_signal(signal.SIGINT)
                signal.raise_signal(signal.SIGINT)
            signal.raise_signal(signal.SIGINT)
        finally:
            signal.signal(signal.SIGINT, before)
        assert heard == [signal.SIGINT] * 2

    def test_what_was_ignored_stays_so(self) -> None:
        before = signal.signal(signal.SIGINT, signal.SIG_IGN)
        try:
            with interrupts_raised():
                signal.raise_signal(signal.SIGINT)
        finally:
            signal.signal(signal.SIGINT, before)

    def test_an_import_that_takes_any_exception_does_not_go_on(self) -> None:
        Path("careless.py").write_text(
            "import signal\n"
            "try:\n    signal.raise_signal(signal.SIGINT)\n"
            "except BaseException:\n    print('lost')\n"
        )
        code = (
            "from drpt.cli.interrupts import interrupts_raised\n"
            "with interrupts_raised():\n    import careless\n"
        )
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=False)
        assert (done.returncode, done.stdout, done.stderr) == (-signal.SIGINT, b"", b"")


@pytest.mark.parametrize("program", [["-m", "drpt"], [str(Path(sys.executable).with_name("drpt"))]])
def test_ctrl_c_ends_the_program_from_its_first_line_on(program: list[str]) -> None:
    """Interrupts the import of each module by a handler that the first line has to replace."""
    Path("sitecustomize.py").write_text(
        "import sys, signal\n"
        "class Finder:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name == 'drpt.render':\n            signal.raise_signal(signal.SIGINT)\n"
        "sys.meta_path.insert(0, Finder())\n"
    )
    environment = {**os.environ, "PYTHONPATH": "."}
    command = [sys.executable, *program, "scenes"]
    done = subprocess.run(command, env=environment, capture_output=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (-signal.SIGINT, b"", b"")


def test_a_program_that_uses_drpt_keeps_its_ctrl_c() -> None:
    code = "import signal, drpt; print(signal.getsignal(2) is signal.default_int_handler)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)
    assert done.stdout == b"True\n"


@pytest.mark.slow
@pytest.mark.parametrize("command", [["explain", "good.toml"], ["render", "good.toml"], ["scenes"]])
def test_ctrl_c_at_any_moment_ends_a_command(command: list[str]) -> None:
    for moment in range(6):
        with subprocess.Popen(
            [sys.executable, "-c", MARKED, *command], stdout=subprocess.PIPE, stderr=subprocess.PIPE
        ) as process:
            assert process.stdout is not None
            process.stdout.readline()  # Python itself has begun
            time.sleep(moment * 0.1)
            process.send_signal(signal.SIGINT)
            _, complaint = process.communicate(timeout=PATIENCE)
        assert process.returncode in (0, 130, -signal.SIGINT)
        assert b"Traceback" not in complaint


def test_sigterm_ends_a_program_with_a_picture() -> None:
    flags = ["--checkpoint", "a.drpt", "--checkpoint-interval", "1e-9"]
    with _started(*FOREVER, *flags) as process:
        _wait_for(Path("a.drpt"), process)
        process.send_signal(signal.SIGTERM)
        printed, complaint = process.communicate(timeout=PATIENCE)
    assert process.returncode == 143
    assert complaint == "stopping after this pass; once more stops at once\n"
    assert " spp (partial)  3 bounces" in printed
    assert read_exr("good.exr")[1]["partial"] is True
    assert files() == ["a.drpt", "good.exr", "good.toml"]


@pytest.mark.slow
def test_a_render_after_ctrl_c_has_the_bits_of_one_without() -> None:
    # Eight passes; a state is there after the first.
    flags = ["--spp", "2000000", "--mode", "implicit", "--checkpoint", "a.drpt"]
    terminal, its = pty.openpty()
    # In a new session, the first terminal that is opened is the one whose Ctrl-C counts.
    on_terminal = ["sh", "-c", 'exec "$@" <"$0" 2>"$0"', os.ttyname(its)]
    process = subprocess.Popen(
        [*on_terminal, *RENDER, *flags, "--checkpoint-interval", "1e-9"],
        stdout=subprocess.DEVNULL,
        start_new_session=True,
        text=True,
    )
    _wait_for(Path("a.drpt"), process)
    os.write(terminal, b"\x03")
    assert process.wait(PATIENCE) == 130
    os.close(its)
    os.close(terminal)
    assert read_exr("good.exr")[1]["partial"] is True

    subprocess.run([*RENDER, *flags, "-o", "resumed.exr"], check=True)
    Path("a.drpt").unlink()
    subprocess.run([*RENDER, *flags, "-o", "whole.exr"], check=True)
    (resumed, facts), (whole, expected) = read_exr("resumed.exr"), read_exr("whole.exr")
    assert resumed.tobytes() == whole.tobytes()
    assert {**facts, "seconds": expected["seconds"]} == expected


@pytest.mark.slow
def test_signals_at_any_moment_leave_nothing_half_done() -> None:
    chance = random.Random(0)
    for _ in range(ROUNDS):
        flags = ["--explain", "--width", "400", "--height", "300", "--layers"]
        with _started(*FOREVER, *flags, "-o", "a.exr", "-o", "b.png") as process:
            assert process.stdout is not None
            process.stdout.readline()  # the command has begun; Python itself knows no such care
            time.sleep(chance.uniform(0, 0.6))
            process.send_signal(chance.choice(SIGNALS))
            time.sleep(chance.uniform(0, 0.4))
            process.send_signal(signal.SIGTERM)
            _, complaint = process.communicate(timeout=PATIENCE)
        # Before and after what the command takes care of, the system ends it.
        assert process.returncode in (130, 143, -signal.SIGTERM)
        assert "Traceback" not in complaint
        assert set(files()) <= {"a.exr", "b.png", "good.toml"}
        if Path("a.exr").exists():
            assert read_exr("a.exr")[0].shape == (300, 400, 3)
            Path("a.exr").unlink()


@contextmanager
def _started(*flags: str) -> Iterator[subprocess.Popen[str]]:
    pipe = subprocess.PIPE
    with subprocess.Popen([*RENDER, *flags], stdout=pipe, stderr=pipe, text=True) as process:
        try:
            yield process
        finally:
            process.kill()


def _wait_for(path: Path, process: subprocess.Popen[str]) -> None:
    start = time.monotonic()
    while not path.exists():
        assert process.poll() is None
        assert time.monotonic() - start < PATIENCE
        time.sleep(0.01)
