"""A worker that renders nothing, and a server of it in a thread."""

from __future__ import annotations

import socket
import threading
from collections import deque
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, cast

from drpt.view.security import Guard
from drpt.view.server import make_app
from drpt.view.serving import Server, listen
from drpt.view.session import ProtocolError
from drpt.view.worker import TooManySessions

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from drpt.view.worker import Worker

HELLO = "hello"
# A handshake; the key is the one of RFC 6455.
UPGRADE = (
    "GET /ws HTTP/1.1\r\nHost: {0}\r\nOrigin: http://{0}\r\nConnection: Upgrade\r\n"
    "Upgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
)
# Seconds after which what was waited for does not come.
PATIENCE = 10
LOCAL = Guard("127.0.0.1", "127.0.0.1")


@dataclass
class FakeSession:
    """Says hello and repeats what it is told; `bad` is no message of its protocol."""

    ready: Callable[[], None]
    messages: deque[str | bytes] = field(default_factory=lambda: deque([HELLO]))
    closed: threading.Event = field(default_factory=threading.Event)

    def receive(self, text: str) -> None:
        if text == "bad":
            raise ProtocolError("type: 'bad' is not allowed; " + "it must be good " * 20)
        self.messages.append(text)

    def next_message(self) -> str | bytes | None:
        return self.messages.popleft() if self.messages else None

    def render(self, frame: bytes) -> None:
        """Have something to send, from another thread than the server's."""
        self.messages.append(frame)
        self.ready()


@dataclass
class FakeWorker:
    most: int = 16
    sessions: list[FakeSession] = field(default_factory=list)

    def open(self, ready: Callable[[], None]) -> FakeSession:
        if len(self.opened) == self.most:
            raise TooManySessions(f"{self.most} viewers at most")
        self.sessions.append(FakeSession(ready))
        return self.sessions[-1]

    def close(self, session: FakeSession) -> None:
        session.closed.set()

    @property
    def opened(self) -> list[FakeSession]:
        return [session for session in self.sessions if not session.closed.is_set()]


@contextmanager
def serving(worker: FakeWorker, guard: Guard = LOCAL) -> Iterator[str]:
    """Run a server; gives the ``host:port`` where it is reached."""
    listener = listen("127.0.0.1", 0)
    end = threading.Event()
    server = Server(make_app(cast("Worker", worker), guard), end.is_set)
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]})
    thread.start()
    try:
        yield "{}:{}".format(*listener.getsockname())
    finally:
        end.set()
        thread.join(PATIENCE)
        assert not thread.is_alive()


def raw_connection(place: str) -> socket.socket:
    host, port = place.split(":")
    return socket.create_connection((host, int(port)), PATIENCE)


def raw_client(place: str) -> socket.socket:
    """A socket on which a session has said hello, and nothing is read since."""
    plain = raw_connection(place)
    plain.sendall(UPGRADE.format(place).encode())
    answer = b""
    while not answer.endswith(HELLO.encode()):
        answer += plain.recv(2**12)
    assert answer.startswith(b"HTTP/1.1 101 ")
    return plain
