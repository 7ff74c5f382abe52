"""`drpt view`: bad input, the URL, the browser, and how it ends."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import threading
import webbrowser
from contextlib import ExitStack, closing
from typing import TYPE_CHECKING, Any
from urllib.request import urlopen

import pytest
from websockets.sync.client import connect
from websockets.typing import Origin

from drpt import cli
from drpt.cli import view
from drpt.distribution import install_command
from drpt.view import serving, worker
from tests.cli.running import files, status_of

if TYPE_CHECKING:
    import socket

    from websockets.sync.client import ClientConnection

URL = re.compile(r"http://127\.0\.0\.1:\d+/\n")
# Seconds after which a program that was told to end hangs; it may have to compile first.
PATIENCE = 60


class FakeWorker:
    """Renders nothing; keeps what it is called with."""

    calls: list[Any]

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        type(self).calls = [(args, kwargs)]

    def start(self) -> None:
        self.calls.append("start")

    def stop(self) -> None:
        self.calls.append("stop")


class AtOnce(threading.Thread):
    """A thread that is none."""

    def start(self) -> None:
        self.run()


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> type[FakeWorker]:
    """A worker, and a server that gets a Ctrl-C as soon as it runs."""
    monkeypatch.setattr(worker, "Worker", FakeWorker)
    ctrl_c(monkeypatch, signal.SIGINT)
    return FakeWorker


def ctrl_c(monkeypatch: pytest.MonkeyPatch, number: signal.Signals) -> None:
    class Server:
        def __init__(self, _: object, ended: Any) -> None:
            self.ended = ended

        def run(self, sockets: list[socket.socket]) -> None:
            assert not self.ended()
            signal.raise_signal(number)
            assert self.ended()

    monkeypatch.setattr(serving, "Server", Server)


@pytest.mark.parametrize(
    ("argv", "says"),
    [
        ([], "SCENE"),
        (["no-such-scene"], "no-such-scene"),
        (["good.toml", "--width", "0"], "width: 0 is not allowed"),
        (
            ["good.toml", "--port", "65536"],
            "--port: 65536 is not allowed; it must be a whole number",
        ),
        (["good.toml", "--port", "-1"], "--port: -1 is not allowed"),
        (["good.toml", "--port", "http"], "--port: 'http' is not an integer"),
        (["good.toml", "--host", "[::1]"], "host: '[::1]' is not allowed"),
        (["good.toml", "--threads", "0"], "--threads: 0 is not allowed"),
    ],
)
def test_bad_input_is_refused(
    argv: list[str], says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    before = files()
    assert status_of(cli.main, ["view", *argv]) == 2
    printed, complaint = capsys.readouterr()
    assert printed == ""
    assert complaint.startswith("drpt view: error: ")
    assert says in complaint
    assert complaint.count("\n") == 1
    assert files() == before


def test_a_port_that_is_taken_is_refused(
    fake: type[FakeWorker], capsys: pytest.CaptureFixture[str]
) -> None:
    with closing(serving.listen("127.0.0.1", 0)) as taken:
        place = "{}:{}".format(*taken.getsockname())
        assert status_of(cli.main, ["view", "good.toml", "--port", place.split(":")[1]]) == 2
    error = f"cannot listen on {place}: Address already in use"
    assert capsys.readouterr() == ("", f"drpt view: error: {error}\n")
    assert len(fake.calls) == 1


@pytest.mark.parametrize("package", view.PACKAGES)
def test_without_the_extra_it_says_how_to_get_it(
    package: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    assert status_of(cli.main, ["view", "good.toml"]) == 2
    printed, complaint = capsys.readouterr()
    assert printed == ""
    assert complaint.startswith(f"drpt view: error: view: it needs {package} (")
    assert complaint.endswith(f"; {install_command('view')} installs it\n")


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_ends_it(
    number: signal.Signals,
    status: int,
    fake: type[FakeWorker],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    ctrl_c(monkeypatch, number)
    assert cli.main(["view", "good.toml", "--width", "4", "--no-browser"]) == status
    assert fake.calls == [(("good.toml",), {"width": 4, "height": None}), "start", "stop"]
    assert URL.fullmatch(capsys.readouterr().out)


def test_where_others_reach_it_the_url_holds_a_token(
    fake: type[FakeWorker], capsys: pytest.CaptureFixture[str]
) -> None:
    cli.main(["view", "good.toml", "--host", "0.0.0.0", "--port", "0", "--no-browser"])
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+/\?token=[\w-]{32,}\n", capsys.readouterr().out)


@pytest.mark.parametrize(
    ("flags", "display", "opens"),
    [([], ":0", True), ([], "", False), (["--no-browser"], ":0", False)],
)
def test_the_browser_opens_where_there_is_one(
    flags: list[str],
    display: str,
    opens: bool,
    fake: type[FakeWorker],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    opened: list[str] = []
    monkeypatch.setattr(threading, "Thread", AtOnce)
    monkeypatch.setattr(webbrowser, "open", opened.append)
    monkeypatch.setattr(sys, "platform", "linux")
    for name in view.DISPLAYS:
        monkeypatch.setenv(name, display)
    cli.main(["view", "good.toml", *flags])
    assert opened == ([capsys.readouterr().out.strip()] if opens else [])


@pytest.mark.slow
@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_from_the_url_to_frames_and_the_end(number: signal.Signals, status: int) -> None:
    command = [sys.executable, "-m", "drpt", "view", "good.toml", "--no-browser"]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True) as process:
        try:
            assert process.stdout is not None
            url = process.stdout.readline()
            assert URL.fullmatch(url)
            with urlopen(url.strip(), timeout=PATIENCE) as page:
                assert b"<!doctype html>" in page.read().lower()
            with ExitStack() as stack:
                clients = [stack.enter_context(opened(url.strip())) for _ in range(10)]
                for client in clients:
                    see_a_frame(client)
                process.send_signal(number)
                printed, complaint = process.communicate(timeout=PATIENCE)
        finally:
            process.kill()
    assert (process.returncode, printed) == (status, "")
    assert complaint == "stopping after this pass; once more stops at once\n"


def opened(url: str) -> ClientConnection:
    place = url.removeprefix("http").removesuffix("/")
    return connect(f"ws{place}/ws", origin=Origin(f"http{place}"), proxy=None, max_size=None)


def see_a_frame(client: ClientConnection) -> None:
    hello = json.loads(client.recv(PATIENCE))
    assert hello["type"] == "hello"
    client.send(json.dumps({"type": "view", "number": 1, "state": hello["state"]}))
    types: set[str] = set()
    while not {"scene", "frame"} <= types:
        message = client.recv(PATIENCE)
        if isinstance(message, bytes):
            message = message[4 : 4 + int.from_bytes(message[:4], "little")].decode()
        types.add(json.loads(message)["type"])
