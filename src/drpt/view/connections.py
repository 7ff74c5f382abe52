"""Ends the connections of clients that violate a protocol or do not respond.

Other clients are not affected, and nothing is logged.
"""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING, Any

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

if TYPE_CHECKING:
    from asyncio import Transport

HTTP_SECONDS = 30.0
"""Longest duration of an HTTP connection in seconds. The page and its files take a moment. A
WebSocket, which begins as HTTP, may last longer."""
MAX_CONNECTIONS = 256
"""Largest number of connections at once; a browser opens up to seven for each session."""
MAX_UNREAD_PONGS = 32
"""Largest number of answers to pings that wait for a client that does not read."""
INVALID_TEXT = 1007
"""Code of a close frame; source: RFC 6455, section 7.4."""


class HttpConnection(H11Protocol):
    """An HTTP connection of limited time."""

    def connection_made(self, transport: Transport) -> None:  # type: ignore[override]
        """Start, and see to the end."""
        super().connection_made(transport)
        self._end = self.loop.call_later(HTTP_SECONDS, transport.abort)
        if len(self.connections) > MAX_CONNECTIONS:
            transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        """End."""
        self._end.cancel()
        super().connection_lost(exc)

    def handle_websocket_upgrade(self, event: h11.Request) -> None:
        """Go on as a WebSocket."""
        self._end.cancel()
        super().handle_websocket_upgrade(event)

    def send_400_response(self, msg: str) -> None:
        """Answer what is not HTTP, unless another answer has begun, and end."""
        if self.cycle is not None:
            self.cycle.disconnected = True  # so that it writes no more
        with suppress(h11.LocalProtocolError):
            super().send_400_response(msg)
        self.transport.close()


class WebSocketConnection(WebSocketsSansIOProtocol):
    """A WebSocket that ends where its client breaks the protocol."""

    def __init__(self, *args: Any, **settings: Any) -> None:
        super().__init__(*args, **settings)
        self._unread_pongs = 0

    def data_received(self, data: bytes) -> None:
        """Process data from a client; the first data must be the whole request."""
        super().data_received(data)
        if not self.handshake_initiated:
            self.transport.abort()

    def send_receive_event_to_app(self) -> None:
        """Pass a message to the application, unless its text is not UTF-8."""
        try:
            if self.curr_msg_data_type == "text":
                b"".join(self.frames).decode()
        except UnicodeDecodeError:
            self.frames = []
            self.conn.fail(INVALID_TEXT, "the text is not UTF-8")
            self.handle_parser_exception()
        else:
            super().send_receive_event_to_app()

    def handle_ping(self) -> None:
        """Answer a ping; disconnect a client that sends many and does not read."""
        self._unread_pongs = 0 if self.writable.is_set() else self._unread_pongs + 1
        if self._unread_pongs > MAX_UNREAD_PONGS:
            self.transport.abort()
        else:
            super().handle_ping()
