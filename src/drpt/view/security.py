"""Who may talk to the server: the pages that it has served itself, opened by who may see them.

A server on the loopback interface is reached by everything that runs on the machine, other sites'
pages in its browser among them. Those are told apart by two headers that no page can forge: `Host`,
the name in the browser's address bar, which is another one after DNS rebinding, and `Origin`, the
page that opens a WebSocket. What other machines reach asks for a token as well.
"""

from __future__ import annotations

import re
import secrets
from ipaddress import ip_address
from typing import TYPE_CHECKING

from starlette.datastructures import MutableHeaders
from starlette.requests import HTTPConnection
from starlette.responses import PlainTextResponse
from starlette.websockets import WebSocket

if TYPE_CHECKING:
    from starlette.types import ASGIApp, Message, Receive, Scope, Send

LOOPBACK = frozenset({"localhost", "127.0.0.1", "[::1]"})
"""Names by which a browser knows its own machine, as they stand in a URL."""
PUBLIC = "/static/"
"""What asks for no token: files of the package."""
HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; "
    "img-src 'self' blob: data:; connect-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-cache",  # files of two versions are never mixed
}
"""Of every answer; source: OWASP, HTTP Headers Cheat Sheet."""


class Guard:
    """What a request must say to be answered, by where the server listens.

    Parameters
    ----------
    host
        The name or address that the server was told to listen on.
    address
        The address that it listens on.

    Attributes
    ----------
    token
        What the URL must hold, or None: on the loopback interface, it needs none.
    """

    def __init__(self, host: str, address: str) -> None:
        bound = ip_address(address)
        self.token = None if bound.is_loopback else secrets.token_urlsafe()
        self._any_name = bound.is_unspecified  # such a server does not know all of its names
        self._names = {in_url(host), in_url(address)} | (LOOPBACK if bound.is_loopback else set())

    def refusal(self, request: HTTPConnection) -> str | None:
        """Say why a request is refused; None: it is not."""
        host = request.headers.get("host", "").lower()
        if not (self._any_name or _without_port(host) in self._names):
            return f"Host: {host!r} is not allowed; it must be one of {sorted(self._names)}"
        origin = request.headers.get("origin", "").lower()
        if request.scope["type"] == "websocket" and origin != f"http://{host}":
            return f"Origin: {origin!r} is not allowed; it must be 'http://{host}'"
        public = request.scope["path"].startswith(PUBLIC)
        if not (public or self._knows(request.query_params.get("token", ""))):
            return "token: it is missing or wrong; open the URL that drpt view has printed"
        return None

    def _knows(self, token: str) -> bool:
        if self.token is None:
            return True
        return secrets.compare_digest(token.encode(), self.token.encode())


class Guarded:
    """An ASGI application that answers what a `Guard` lets through, with `HEADERS`."""

    def __init__(self, app: ASGIApp, guard: Guard) -> None:
        self._app = app
        self._guard = guard

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request, or status 403, with the reason where it is seen."""

        async def send_with_headers(message: Message) -> None:
            if message["type"].endswith("response.start"):
                MutableHeaders(scope=message).update(HEADERS)
            await send(message)

        refusal = self._guard.refusal(HTTPConnection(scope))
        if refusal is None:
            await self._app(scope, receive, send_with_headers)
            return
        if scope["type"] == "websocket":
            await WebSocket(scope, receive, send).close()  # before it was accepted: status 403
            return
        answer = PlainTextResponse(f"{refusal}\n", status_code=403)
        await answer(scope, receive, send_with_headers)


def in_url(host: str) -> str:
    """A host as it stands in a URL: IPv6 addresses in brackets."""
    return f"[{host}]" if ":" in host else host.lower()


def _without_port(host: str) -> str:
    return re.sub(":[0-9]+$", "", host)
