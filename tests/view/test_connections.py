"""Clients that break a protocol, or say nothing: theirs end, quietly, and others go on."""

from __future__ import annotations

import itertools
import socket
import struct
from contextlib import ExitStack, contextmanager
from time import sleep
from typing import TYPE_CHECKING

import pytest
from websockets.sync.client import connect
from websockets.typing import Origin

from drpt.view import connections, serving
from drpt.view.connections import INVALID_TEXT
from tests.view import fakes
from tests.view.fakes import PATIENCE, UPGRADE, FakeWorker, raw_client, raw_connection

if TYPE_CHECKING:
    from collections.abc import Iterator

    from websockets.sync.client import ClientConnection

TEXT, BINARY, CLOSE, PING, PONG = 0x1, 0x2, 0x8, 0x9, 0xA
PROTOCOL_ERROR = 1002
# Pings before a client that reads none of the answers must be gone: 30 MB, more than sockets hold.
PINGS = 300_000


def frame(opcode: int, payload: bytes, *, final: bool = True, masked: bool = True) -> bytes:
    """A WebSocket's frame of a client, of less than 126 bytes; its mask is 0."""
    head = bytes([opcode | 0x80 * final, len(payload) | 0x80 * masked])
    return head + (bytes(4) if masked else b"") + payload


def rest(plain: socket.socket) -> bytes:
    """Return what the server sends until it ends the connection."""
    said = b""
    try:
        while data := plain.recv(2**16):
            said += data
    except ConnectionResetError:
        pass
    return said


def drip(plain: socket.socket) -> None:
    """Send a byte again and again, for so long that the server must have ended the connection."""
    for _ in range(100 * PATIENCE):
        plain.send(b"x")
        sleep(0.01)


@contextmanager
def opened(place: str) -> Iterator[ClientConnection]:
    """A client that has been greeted."""
    with connect(f"ws://{place}/ws", origin=Origin(f"http://{place}"), proxy=None) as client:
        client.recv(PATIENCE)
        yield client


def is_served(client: ClientConnection) -> bool:
    """Whether a session still answers; a fake one repeats what it is told."""
    client.send("ready?")
    return client.recv(PATIENCE) == "ready?"


@pytest.fixture(scope="module")
def at() -> Iterator[str]:
    with fakes.serving(FakeWorker(most=64)) as place:
        yield place


@pytest.fixture(autouse=True)
def quiet(caplog: pytest.LogCaptureFixture) -> Iterator[None]:
    """Nothing is logged, by whomever."""
    yield
    assert caplog.get_records("call") == []


@pytest.fixture
def other(at: str) -> Iterator[ClientConnection]:
    """A client that is served before and after."""
    with opened(at) as client:
        yield client
        assert is_served(client)


@pytest.mark.usefixtures("other")
class TestFrames:
    @pytest.mark.parametrize(
        "sent",
        [
            frame(TEXT, b"\xff\xfe"),
            frame(TEXT, b"\xc3", final=False) + frame(0, b"\x28"),
            frame(CLOSE, struct.pack("!H", 1000) + b"\xff"),
        ],
        ids=["text", "fragments", "reason"],
    )
    def test_that_are_not_utf8_end_the_connection(self, sent: bytes, at: str) -> None:
        with raw_client(at) as plain:
            plain.sendall(sent)
            said = rest(plain)
        assert (said[0] & 0xF, struct.unpack("!H", said[2:4])[0]) == (CLOSE, INVALID_TEXT)

    def test_may_part_a_character(self, at: str) -> None:
        with raw_client(at) as plain:
            plain.sendall(frame(TEXT, b"\xc3", final=False) + frame(0, b"\xa9"))
            assert plain.recv(2**12) == b"\x81\x02\xc3\xa9"

    @pytest.mark.parametrize(
        "sent",
        [
            frame(TEXT, b"x", masked=False),
            frame(0x3, b"x"),
            frame(TEXT | 0x40, b"x"),
            frame(0, b"x"),
            frame(PING, b"x", final=False),
            frame(CLOSE, b"\x00\x01"),
        ],
        ids=["unmasked", "opcode", "reserved bit", "continuation", "parted ping", "code"],
    )
    def test_that_no_websocket_has_end_the_connection(self, sent: bytes, at: str) -> None:
        with raw_client(at) as plain:
            plain.sendall(sent)
            said = rest(plain)
        assert (said[0] & 0xF, struct.unpack("!H", said[2:4])[0]) == (CLOSE, PROTOCOL_ERROR)


@pytest.mark.usefixtures("other")
class TestPings:
    def test_that_nobody_reads_end_the_connection(self, at: str) -> None:
        with raw_client(at) as plain, pytest.raises(ConnectionError):
            plain.sendall(PINGS * frame(PING, bytes(100)))

    def test_that_are_read_are_answered(self, at: str) -> None:
        payload = bytes(100)
        with raw_client(at) as plain:
            for _ in range(300):
                plain.sendall(10 * frame(PING, payload))
                expected = 10 * (bytes([0x80 | PONG, len(payload)]) + payload)
                assert plain.recv(len(expected), socket.MSG_WAITALL) == expected


@pytest.mark.usefixtures("other")
class TestRequests:
    GET = "GET / HTTP/1.1\r\nHost: {0}\r\n"

    @pytest.mark.parametrize(
        "sent",
        [
            "\x16\x03\x01\x02\x00\x01\r\n\r\n",
            "GET /\xff HTTP/1.1\r\nHost: {0}\r\n\r\n",
            "GET / HTTP/1.1\r\n\r\n",
            GET + "Content-Length: -1\r\n\r\n",
            GET + "x" * 2**17,
            UPGRADE.replace("/ws", "/ws?\xff"),
        ],
        ids=["TLS", "path", "no host", "length", "long", "upgrade"],
    )
    def test_that_are_no_http_are_refused(self, sent: str, at: str) -> None:
        with raw_connection(at) as plain:
            plain.sendall(sent.format(at).encode("latin-1"))
            assert rest(plain).startswith(b"HTTP/1.1 400 ")

    def test_with_a_body_that_is_none_are_refused_amid_the_answer(self, at: str) -> None:
        sent = "POST / HTTP/1.1\r\nHost: {0}\r\nTransfer-Encoding: chunked\r\n\r\nno chunk\r\n"
        with raw_connection(at) as plain:
            plain.sendall(sent.format(at).encode())
            assert rest(plain).startswith(b"HTTP/1.1 400 ")

    def test_after_which_something_else_comes_are_answered(self, at: str) -> None:
        with raw_connection(at) as plain:
            plain.sendall((self.GET + "\r\nno request\r\n\r\n").format(at).encode())
            assert rest(plain).startswith(b"HTTP/1.1 ")

    @pytest.mark.parametrize(
        "header",
        [
            "Content-Length: 4",
            "Transfer-Encoding: chunked",
            "X-Long: " + "x" * 10_000,
            "\r\n".join(f"X-{n}: x" for n in range(300)),
        ],
        ids=["body", "chunked", "long", "many"],
    )
    def test_for_a_websocket_that_it_does_not_take_end(self, header: str, at: str) -> None:
        with raw_connection(at) as plain:
            plain.sendall(f"{UPGRADE.format(at)[:-2]}{header}\r\n\r\n".encode())
            assert rest(plain) == b""


class TestSilence:
    """Clients that do not go on; a WebSocket is opened before, and outlives them."""

    @pytest.fixture
    def hasty(self, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
        monkeypatch.setattr(connections, "HTTP_SECONDS", 0.3)
        with fakes.serving(FakeWorker()) as place, opened(place) as client:
            yield place
            assert is_served(client)

    @pytest.mark.parametrize(
        "sent", ["", "GET / HT", UPGRADE[:-2]], ids=["nothing", "half a line", "half a handshake"]
    )
    def test_in_a_request_ends_the_connection(self, sent: str, hasty: str) -> None:
        with raw_connection(hasty) as plain:
            plain.sendall(sent.format(hasty).encode())
            assert rest(plain) == b""

    def test_that_is_broken_byte_by_byte_ends_it_too(self, hasty: str) -> None:
        with raw_connection(hasty) as plain:
            plain.sendall(f"GET / HTTP/1.1\r\nHost: {hasty}\r\nX: ".encode())
            with pytest.raises(ConnectionError):
                drip(plain)

    def test_after_a_ping_ends_a_websocket(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(serving, "PING_SECONDS", 0.3)
        with fakes.serving(FakeWorker()) as place, opened(place) as client:
            with raw_client(place) as plain:
                assert rest(plain)[0] & 0xF == PING
            assert is_served(client)


def test_there_is_an_end_to_connections(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connections, "MAX_CONNECTIONS", 3)
    with ExitStack() as stack:
        place = stack.enter_context(fakes.serving(FakeWorker()))
        client = stack.enter_context(opened(place))
        first, _ = (stack.enter_context(raw_connection(place)) for _ in range(2))
        assert rest(stack.enter_context(raw_connection(place))) == b""
        first.close()
        for _ in itertools.repeat(None, 100):
            with raw_connection(place) as plain:
                plain.sendall(b"no request\r\n\r\n")
                if rest(plain).startswith(b"HTTP/1.1 400 "):
                    break
        else:
            pytest.fail("a connection that has ended is still counted")
        assert is_served(client)
