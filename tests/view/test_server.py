"""The web application over real sockets: files, headers, and clients of all manners."""

from __future__ import annotations

import http.client
import socket
import struct
import time
from contextlib import ExitStack, suppress
from typing import TYPE_CHECKING, NamedTuple

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Origin

from drpt.view import server, serving
from drpt.view.security import HEADERS, Guard
from drpt.view.serving import GRACE, MESSAGE_BYTES
from tests.view import fakes
from tests.view.fakes import HELLO, PATIENCE, FakeSession, FakeWorker, raw_client

if TYPE_CHECKING:
    from collections.abc import Iterator
    from email.message import Message

    from websockets.sync.client import ClientConnection

# More than sockets and the server hold for a client that does not read.
FLOOD = bytes(2**24)
INDEX = "<title>the index</title>"


class Answer(NamedTuple):
    status: int
    headers: Message
    text: str


@pytest.fixture(scope="module")
def worker() -> FakeWorker:
    return FakeWorker()


@pytest.fixture(scope="module", autouse=True)
def static(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    folder = tmp_path_factory.mktemp("package") / "static"
    folder.mkdir()
    (folder / "index.html").write_text(INDEX)
    (folder / "main.js").write_text("start();")
    (folder.parent / "secret.js").write_text("")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(server, "STATIC", folder)
        yield


@pytest.fixture(scope="module")
def at(worker: FakeWorker, static: None) -> Iterator[str]:
    """Where a server is reached."""
    with fakes.serving(worker) as place:
        yield place


@pytest.fixture
def session(worker: FakeWorker, client: ClientConnection) -> FakeSession:
    """The server's side of `client`."""
    assert client.recv(PATIENCE) == HELLO
    return worker.sessions[-1]


@pytest.fixture
def client(at: str) -> Iterator[ClientConnection]:
    with opened(at) as client:
        yield client


def opened(place: str, query: str = "") -> ClientConnection:
    origin = Origin(f"http://{place}")
    return connect(f"ws://{place}/ws{query}", origin=origin, proxy=None, max_size=None)


def get(place: str, path: str) -> Answer:
    connection = http.client.HTTPConnection(place, timeout=PATIENCE)
    connection.request("GET", path)
    response = connection.getresponse()
    answer = Answer(response.status, response.headers, response.read().decode())
    connection.close()
    return answer


def closing(client: ClientConnection) -> tuple[int, str]:
    """Code and reason by which the server closes a connection."""
    with suppress(ConnectionClosed):
        while True:
            client.recv(PATIENCE)
    assert client.close_code is not None
    return client.close_code, client.close_reason or ""


class TestFiles:
    @pytest.mark.parametrize(
        ("path", "media", "text"),
        [("/", "text/html", INDEX), ("/static/main.js", "javascript", "start();")],
    )
    def test_come_with_their_type_and_the_headers(
        self, at: str, path: str, media: str, text: str
    ) -> None:
        response = get(at, path)
        assert (response.status, response.text) == (200, text)
        assert media in response.headers["Content-Type"]
        assert {name: response.headers[name] for name in HEADERS} == HEADERS

    @pytest.mark.parametrize("path", ["/none", "/static/none.js", "/static/../secret.js", "/ws"])
    def test_that_are_none_are_not_found(self, at: str, path: str) -> None:
        response = get(at, path)
        assert response.status == 404
        assert {name: response.headers[name] for name in HEADERS} == HEADERS


class TestASession:
    def test_passes_messages_on(self, client: ClientConnection, session: FakeSession) -> None:
        client.send("pause")
        assert client.recv(PATIENCE) == "pause"
        session.render(b"frame")
        assert client.recv(PATIENCE) == b"frame"

    def test_ends_with_its_client(self, client: ClientConnection, session: FakeSession) -> None:
        client.close()
        assert session.closed.wait(PATIENCE)

    def test_ends_with_a_client_that_vanishes(self, at: str, worker: FakeWorker) -> None:
        vanishing = raw_client(at)
        session = worker.sessions[-1]
        linger = struct.pack("ii", 1, 0)  # its end is a reset, without a word
        vanishing.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, linger)
        vanishing.close()
        assert session.closed.wait(PATIENCE)

    def test_after_its_end_can_be_ready(
        self, client: ClientConnection, session: FakeSession
    ) -> None:
        client.close()
        assert session.closed.wait(PATIENCE)
        session.render(b"late")

    @pytest.mark.parametrize(
        ("message", "code", "reason"),
        [
            pytest.param("bad", 1008, "type: 'bad' is not allowed; it must be", id="garbage"),
            pytest.param(b"view", 1008, "a binary message is not allowed", id="binary"),
            pytest.param("x" * (MESSAGE_BYTES + 1), 1009, "", id="oversize"),
        ],
    )
    def test_refuses_what_is_no_message(
        self,
        client: ClientConnection,
        session: FakeSession,
        message: str | bytes,
        code: int,
        reason: str,
    ) -> None:
        client.send(message)
        closed_by, why = closing(client)
        assert closed_by == code
        assert why.startswith(reason)
        assert session.closed.wait(PATIENCE)

    def test_refuses_what_is_no_frame(self, at: str, worker: FakeWorker) -> None:
        with raw_client(at) as client:
            client.sendall(b"\xff" * 100)
            assert worker.sessions[-1].closed.wait(PATIENCE)

    def test_takes_the_longest_message(
        self, client: ClientConnection, session: FakeSession
    ) -> None:
        client.send("x" * MESSAGE_BYTES)
        assert client.recv(PATIENCE) == "x" * MESSAGE_BYTES

    def test_that_fails_ends(
        self,
        client: ClientConnection,
        session: FakeSession,
        monkeypatch: pytest.MonkeyPatch,
        caplog: pytest.LogCaptureFixture,
    ) -> None:
        monkeypatch.setattr(session, "next_message", lambda: 1 / 0)
        session.ready()
        with pytest.raises(ConnectionClosed):
            client.recv(PATIENCE)
        assert session.closed.wait(PATIENCE)
        assert "ZeroDivisionError" in caplog.text


class TestManyClients:
    def test_each_gets_what_is_its_own(self, at: str, worker: FakeWorker) -> None:
        before = len(worker.sessions)
        with ExitStack() as stack:
            clients = [stack.enter_context(opened(at)) for _ in range(10)]
            for number, session in enumerate(worker.sessions[before:]):
                session.render(bytes([number]))
            for number, client in enumerate(clients):
                assert [client.recv(PATIENCE), client.recv(PATIENCE)] == [HELLO, bytes([number])]

    def test_more_than_the_worker_takes_are_told(self) -> None:
        with fakes.serving(FakeWorker(most=1)) as place, opened(place) as first:
            assert first.recv(PATIENCE) == HELLO
            with opened(place) as second:
                assert closing(second) == (1013, "1 viewers at most")

    def test_one_that_does_not_read_holds_up_nobody(
        self, at: str, worker: FakeWorker, client: ClientConnection, session: FakeSession
    ) -> None:
        with raw_client(at):
            lazy = worker.sessions[-1]
            for _ in range(3):
                lazy.render(FLOOD)
                session.render(b"frame")
                assert client.recv(PATIENCE) == b"frame"
            assert len(lazy.messages) > 0  # the server holds one message for it, not all
        assert lazy.closed.wait(PATIENCE)

    @pytest.mark.slow
    def test_one_that_never_reads_loses_its_session(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(serving, "PATIENCE", 1)
        worker = FakeWorker()
        with fakes.serving(worker) as place, raw_client(place):
            worker.sessions[-1].render(FLOOD)
            assert worker.sessions[-1].closed.wait(PATIENCE)


class TestTheEnd:
    def test_is_told_to_clients(self) -> None:
        worker = FakeWorker()
        with ExitStack() as stack:
            with fakes.serving(worker) as place:
                client = stack.enter_context(opened(place))
            assert closing(client)[0] == 1012
            assert not worker.opened

    @pytest.mark.slow
    def test_does_not_wait_for_one_that_does_not_read(self) -> None:
        worker = FakeWorker()
        with ExitStack() as stack:
            with fakes.serving(worker) as place:
                stack.enter_context(raw_client(place))
                worker.sessions[-1].render(FLOOD)
                start = time.monotonic()
            assert time.monotonic() - start < GRACE + 1
            assert not worker.opened


class TestWhoIsLetIn:
    def test_no_page_of_another_site(
        self, at: str, worker: FakeWorker, caplog: pytest.LogCaptureFixture
    ) -> None:
        """And it cannot fill the log."""
        before = len(worker.sessions)
        with pytest.raises(InvalidStatus) as refused:
            connect(f"ws://{at}/ws", origin=Origin("http://evil.example"), proxy=None)
        assert refused.value.response.status_code == 403
        assert len(worker.sessions) == before
        assert not caplog.records

    def test_where_others_reach_it_only_who_knows_the_token(self) -> None:
        guard = Guard("0.0.0.0", "0.0.0.0")
        with fakes.serving(FakeWorker(), guard) as place:
            for query in ("", "?token=", "?token=wrong"):
                assert get(place, f"/{query}").status == 403
                with pytest.raises(InvalidStatus):
                    opened(place, query)
            assert get(place, f"/?token={guard.token}").text == INDEX
            assert get(place, "/static/main.js").text == "start();"
            with opened(place, f"?token={guard.token}") as client:
                assert client.recv(PATIENCE) == HELLO
