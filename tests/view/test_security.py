"""Which requests a guard lets in, by where the server listens."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from starlette.requests import HTTPConnection

from drpt.view.security import Guard, in_url

if TYPE_CHECKING:
    from starlette.types import Scope

HERE = "127.0.0.1:8765"
LOOPBACK = Guard("127.0.0.1", "127.0.0.1")
LOOPBACK_6 = Guard("0:0::1", "::1")
NAMED = Guard("render.lan", "192.168.1.5")
EVERYWHERE = Guard("::", "::")


def request(
    kind: str, host: str | None, origin: str | None = None, path: str = "/ws", token: str = ""
) -> HTTPConnection:
    headers = {"host": host, "origin": origin}
    scope: Scope = {
        "type": kind,
        "path": path,
        "query_string": f"token={token}".encode(),
        "headers": [
            (name.encode(), value.encode()) for name, value in headers.items() if value is not None
        ],
    }
    return HTTPConnection(scope)


@pytest.mark.parametrize(
    ("guard", "host"),
    [
        (LOOPBACK, HERE),
        (LOOPBACK, "localhost:8765"),
        (LOOPBACK, "LocalHost:9000"),  # a forwarded port
        (LOOPBACK, "127.0.0.1"),
        (LOOPBACK_6, "[::1]:8765"),
        (NAMED, "render.lan:8765"),
        (NAMED, "192.168.1.5:8765"),
        (EVERYWHERE, "any.name:8765"),
    ],
)
def test_a_page_of_its_own_is_let_in(guard: Guard, host: str) -> None:
    token = guard.token or ""
    assert guard.refusal(request("http", host, path="/", token=token)) is None
    assert guard.refusal(request("websocket", host, f"http://{host}", token=token)) is None


@pytest.mark.parametrize("path", ["/", "/static/main.js", "/ws"])
@pytest.mark.parametrize("guard", [LOOPBACK, LOOPBACK_6, NAMED])
@pytest.mark.parametrize(
    "host",
    [
        None,
        "",
        "evil.example:8765",
        "localhost.evil.example",
        "localhost@evil.example",
        "127.0.0.2",
    ],
)
def test_another_name_is_refused(guard: Guard, path: str, host: str | None) -> None:
    """As after DNS rebinding, where Host and Origin are the attacker's name."""
    token = guard.token or ""
    for kind in ("http", "websocket"):
        refusal = guard.refusal(request(kind, host, f"http://{host}", path, token))
        assert refusal is not None
        assert refusal.startswith(f"Host: {host or ''!r} is not allowed; it must be one of [")


@pytest.mark.parametrize("guard", [LOOPBACK, EVERYWHERE])
@pytest.mark.parametrize(
    "origin",
    [
        None,
        "",
        "null",
        "http://evil.example",
        "http://127.0.0.1",
        "http://127.0.0.1:3000",
        "http://localhost:8765",
        f"https://{HERE}",
        f"http://{HERE}.evil.example",
    ],
)
def test_another_page_opens_no_session(guard: Guard, origin: str | None) -> None:
    refusal = guard.refusal(request("websocket", HERE, origin, token=guard.token or ""))
    assert refusal == f"Origin: {origin or ''!r} is not allowed; it must be 'http://{HERE}'"


@pytest.mark.parametrize("path", ["/", "/ws", "/static", "/none"])
@pytest.mark.parametrize(
    "token", ["", "wrong", "é", pytest.param(f"{EVERYWHERE.token}x", id="longer")]
)
def test_without_the_token_others_are_refused(path: str, token: str) -> None:
    refusal = EVERYWHERE.refusal(request("http", HERE, path=path, token=token))
    assert refusal == "token: it is missing or wrong; open the URL that drpt view has printed"


def test_files_of_the_package_need_no_token() -> None:
    assert EVERYWHERE.refusal(request("http", HERE, path="/static/main.js")) is None


def test_each_server_has_a_token_of_its_own() -> None:
    assert LOOPBACK.token is None
    assert LOOPBACK_6.token is None
    assert NAMED.token != EVERYWHERE.token
    assert len(NAMED.token or "") >= 32


@pytest.mark.parametrize(
    ("host", "expected"), [("::1", "[::1]"), ("Render.LAN", "render.lan"), ("1.2.3.4", "1.2.3.4")]
)
def test_a_host_in_a_url(host: str, expected: str) -> None:
    assert in_url(host) == expected
