"""The web application: its files, and a session for each WebSocket."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.responses import FileResponse
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket, WebSocketDisconnect

from drpt.view.security import Guard, Guarded
from drpt.view.session import ProtocolError
from drpt.view.worker import TooManySessions

if TYPE_CHECKING:
    from starlette.requests import Request

    from drpt.view.session import Session
    from drpt.view.worker import Worker

STATIC = Path(__file__).parent / "static"
POLICY_VIOLATION, TRY_AGAIN_LATER = 1008, 1013
"""Codes of a close frame; source: RFC 6455, section 7.4, and IANA's registry."""
REASON_BYTES = 123
"""The room for words in a close frame; source: RFC 6455, section 5.5."""


def make_app(worker: Worker, guard: Guard) -> Starlette:
    """Return the application that shows what a worker renders to those whom a guard lets in."""

    async def index(_: Request) -> FileResponse:
        return FileResponse(STATIC / "index.html")

    async def show(websocket: WebSocket) -> None:
        await websocket.accept()
        try:
            await _hold_session(websocket, worker)
        except ProtocolError as error:
            await _close(websocket, POLICY_VIOLATION, error)
        except TooManySessions as error:
            await _close(websocket, TRY_AGAIN_LATER, error)

    routes = [
        Route("/", index),
        Mount("/static", StaticFiles(directory=STATIC)),
        WebSocketRoute("/ws", show),
    ]
    return Starlette(routes=routes, middleware=[Middleware(Guarded, guard)])


async def _hold_session(websocket: WebSocket, worker: Worker) -> None:
    """Pass messages between a client and a session of its own, until the client leaves."""
    loop = asyncio.get_running_loop()
    ready = asyncio.Event()

    def wake() -> None:
        with suppress(RuntimeError):  # the loop has ended, and its clients with it
            loop.call_soon_threadsafe(ready.set)

    session = worker.open(wake)
    ways = [
        asyncio.create_task(_receive(websocket, session, ready)),
        asyncio.create_task(_send(websocket, session, ready)),
    ]
    try:
        ended, _ = await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
        for way in ended:
            way.result()
    finally:
        for way in ways:
            way.cancel()
        worker.close(session)


async def _receive(websocket: WebSocket, session: Session, ready: asyncio.Event) -> None:
    """Hand on what a client says; it may be what the session has waited for."""
    while (message := await websocket.receive())["type"] != "websocket.disconnect":
        text = message.get("text")
        if text is None:
            raise ProtocolError("a binary message is not allowed; it must be text")
        session.receive(text)
        ready.set()


async def _send(websocket: WebSocket, session: Session, ready: asyncio.Event) -> None:
    """Send what a session has to say, as fast as the client takes it."""
    with suppress(WebSocketDisconnect):
        while True:
            ready.clear()
            while (message := session.next_message()) is not None:
                if isinstance(message, str):
                    await websocket.send_text(message)
                else:
                    await websocket.send_bytes(message)
            await ready.wait()


async def _close(websocket: WebSocket, code: int, error: Exception) -> None:
    reason = str(error).encode(errors="backslashreplace")[:REASON_BYTES].decode(errors="ignore")
    with suppress(WebSocketDisconnect):
        await websocket.close(code, reason)
