"""A `drpt view` that runs, a browser, and pages of it on which nothing may go wrong."""

from __future__ import annotations

import subprocess
import sys
from contextlib import closing
from typing import TYPE_CHECKING, Any

import pytest

from tests.browsing import chromium

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from playwright.sync_api import Browser, Page

SIDE = 64
# The render of a new scene has to be compiled first, on a machine that does other things as well.
PATIENCE_MS = 20_000


class Viewer:
    """A server as a process of its own, which can be ended and started again."""

    def __init__(self) -> None:
        self.url = self._start("0")

    def _start(self, port: str) -> str:
        size = ["--width", str(SIDE), "--height", str(SIDE)]
        command = [sys.executable, "-m", "drpt", "view", "cornell-box", "--no-browser", *size]
        self.process = subprocess.Popen(
            [*command, "--port", port], stdout=subprocess.PIPE, text=True
        )
        assert self.process.stdout
        url = self.process.stdout.readline().strip()
        assert url, "drpt view has not started"
        return url

    def start_again(self) -> None:
        """Start on the port of the one that was ended."""
        assert self._start(self.url.rstrip("/").rpartition(":")[2]) == self.url

    def close(self) -> None:
        """End the server at once."""
        self.process.kill()
        self.process.communicate()


class Watched:
    """Pages of a browser, and what went wrong on them."""

    def __init__(self, browser: Browser) -> None:
        self._browser = browser
        self._contexts: list[Any] = []
        self.complaints: list[str] = []

    def open(self, url: str, **settings: Any) -> Page:
        """Open a URL in a window of its own."""
        context = self._browser.new_context(**{"viewport": WINDOW, **settings})
        self._contexts.append(context)
        context.set_default_timeout(PATIENCE_MS)
        page = context.new_page()
        page.on("console", lambda message: self.complaints.append(message.text))
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        page.on("requestfailed", lambda request: self.complaints.append(request.url))
        page.goto(url)
        return page

    def close(self) -> None:
        """Close all windows."""
        for context in self._contexts:
            context.close()


WINDOW = {"width": 1440, "height": 900}


@pytest.fixture(scope="module")
def viewer() -> Iterator[Viewer]:
    with closing(Viewer()) as running:
        yield running


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as running:
        yield running


@pytest.fixture
def watched(browser: Browser) -> Iterator[Watched]:
    """Windows in which the console stays empty and no request fails."""
    with closing(Watched(browser)) as pages:
        yield pages
        assert pages.complaints == []


@pytest.fixture
def open_view(watched: Watched, viewer: Viewer) -> Callable[..., Page]:
    """Open the view that a hash tells in a window with some settings."""

    def open_page(hash_: str = "", **settings: Any) -> Page:
        return watched.open(f"{viewer.url}#{hash_}", **settings)

    return open_page
