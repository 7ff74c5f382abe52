"""Ports and addresses: what is taken, what is refused, and the URL that leads there."""

from __future__ import annotations

import re
import socket
from contextlib import closing

import pytest

from drpt.view import serving
from drpt.view.serving import listen, url_of


def has_ipv6() -> bool:
    try:
        socket.create_server(("::1", 0), family=socket.AF_INET6).close()
    except OSError:
        return False
    return True


def port_of(listener: socket.socket) -> int:
    port: int = listener.getsockname()[1]
    return port


def test_a_port_that_is_taken_is_refused() -> None:
    with closing(listen("127.0.0.1", 0)) as first:
        port = port_of(first)
        message = f"cannot listen on 127.0.0.1:{port}: Address already in use"
        with pytest.raises(ValueError, match=message):
            listen("127.0.0.1", port)


def test_without_a_port_the_first_free_one_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    with closing(listen("127.0.0.1", 0)) as first, closing(listen("127.0.0.1", 0)) as second:
        free = port_of(second)
        second.close()
        monkeypatch.setattr(serving, "PORTS", (port_of(first), free))
        with closing(listen("127.0.0.1")) as third:
            assert port_of(third) == free
            with pytest.raises(ValueError, match=f"cannot listen on 127.0.0.1:{free}"):
                listen("127.0.0.1")


@pytest.mark.parametrize("host", ["no-such-host.invalid", "[::1]", "x" * 64])
def test_what_is_no_host_is_refused(host: str) -> None:
    with pytest.raises(ValueError, match=rf"host: {re.escape(repr(host))} is not allowed"):
        listen(host, 0)


def test_an_address_of_another_machine_is_refused() -> None:
    with pytest.raises(ValueError, match=r"cannot listen on 192\.0\.2\.1:0: Cannot assign"):
        listen("192.0.2.1", 0)


@pytest.mark.parametrize(
    ("host", "name"),
    [
        ("127.0.0.1", "127.0.0.1"),
        ("localhost", "localhost"),
        ("0.0.0.0", "127.0.0.1"),
        pytest.param(
            "::1", "[::1]", marks=pytest.mark.skipif(not has_ipv6(), reason="there is no IPv6")
        ),
    ],
)
def test_the_url_leads_there(host: str, name: str) -> None:
    with closing(listen(host, 0)) as listener:
        port = port_of(listener)
        assert url_of(listener, host, None) == f"http://{name}:{port}/"
        assert url_of(listener, host, "abc") == f"http://{name}:{port}/?token=abc"
        with socket.create_connection((name.strip("[]"), port), timeout=10):
            pass
