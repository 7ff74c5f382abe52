"""Where the web application listens, and the server that runs it."""

from __future__ import annotations

import asyncio
import errno
import os
import socket
from contextlib import contextmanager
from typing import TYPE_CHECKING

import uvicorn

from drpt.view.connections import HttpConnection, WebSocketConnection
from drpt.view.security import in_url

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from starlette.types import ASGIApp

PORTS = range(8765, 8865)
"""Tried in turn where the user names none."""
MESSAGE_BYTES = 2**16
"""The longest message that a client may send; the state of a view takes a few kilobytes."""
PATIENCE = 30
"""Seconds that a client may leave data untaken before it counts as gone."""
PING_SECONDS = 20.0
"""Interval of pings to a WebSocket's client, and the time that it has for an answer."""
GRACE = 1
"""Seconds that clients have, when the server ends, to take what they have been sent."""


def listen(host: str, port: int | None = None) -> socket.socket:
    """Return a socket that listens on a host's first address.

    Parameters
    ----------
    host
        A name or an address of this machine.
    port
        0 takes any that is free, None the first free one of `PORTS`.

    Raises
    ------
    ValueError
        The host is not this machine's, or the port is not to be had.
    """
    for candidate in PORTS if port is None else (port,):
        try:
            return _listen(host, candidate)
        except OSError as error:
            failure = error
            if error.errno != errno.EADDRINUSE:
                break
    reason = os.strerror(failure.errno or 0)
    raise ValueError(f"cannot listen on {in_url(host)}:{candidate}: {reason}")


def _listen(host: str, port: int) -> socket.socket:
    try:
        family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
    except (socket.gaierror, UnicodeError) as error:
        allowed = "a name or an address of this machine"
        raise ValueError(f"host: {host!r} is not allowed; it must be {allowed}") from error
    both = address[0] == "::" and socket.has_dualstack_ipv6()
    listener = socket.create_server(address, family=family, dualstack_ipv6=both)
    if hasattr(socket, "TCP_USER_TIMEOUT"):  # Linux; elsewhere the system's own, longer patience
        listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, 1000 * PATIENCE)
    return listener


def url_of(listener: socket.socket, host: str, token: str | None) -> str:
    """Return the URL that opens the view in a browser on this machine."""
    address, port = listener.getsockname()[:2]
    name = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(address, host)
    query = "" if token is None else f"?token={token}"
    return f"http://{in_url(name)}:{port}/{query}"


class Server(uvicorn.Server):
    """A server of an application that ends soon after it is asked to.

    Parameters
    ----------
    app
        What answers.
    ended
        Asked ten times a second. Signals are left to others.
    """

    def __init__(self, app: ASGIApp, ended: Callable[[], bool]) -> None:
        config = uvicorn.Config(
            app,
            log_config=None,
            log_level="error",  # of drpt: what clients do wrong is not told
            access_log=False,
            lifespan="off",
            proxy_headers=False,
            server_header=False,
            http=HttpConnection,
            ws=WebSocketConnection,
            ws_ping_interval=PING_SECONDS,
            ws_ping_timeout=PING_SECONDS,
            ws_max_size=MESSAGE_BYTES,
            ws_per_message_deflate=False,  # noise does not compress
        )
        super().__init__(config)
        self._ended = ended

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Leave signals to others."""
        yield

    async def on_tick(self, counter: int) -> bool:
        """Return whether to end."""
        return await super().on_tick(counter) or self._ended()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Take leave of the clients, at last without their help."""
        asyncio.get_running_loop().call_later(GRACE, self._drop)
        await super().shutdown(sockets)

    def _drop(self) -> None:
        for connection in list(self.server_state.connections):
            connection.transport.abort()
