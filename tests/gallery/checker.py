"""Parses a page, and checks what every page must be."""

from __future__ import annotations

from base64 import b64decode
from html.parser import HTMLParser
from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

VOID = {"meta", "link", "img", "br"}
EMPTY = "data:,"
ALONE = "path", "polyline", "circle"
"""Elements of SVG that close themselves."""


class Page(HTMLParser):
    """What a page consists of."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.path = path
        self.open: list[str] = []
        self.ids: list[str] = []
        self.links: list[str] = []
        self.pictures: list[tuple[str, NDArray[np.uint8]]] = []
        """Words that stand for each, and its pixels."""
        self.words: list[str] = []
        self.feed(path.read_text(encoding="utf-8"))
        self.close()

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.words).split())

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in VOID:
            self.open.append(tag)
        self._note(tag, dict(attrs))

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        assert tag in ALONE
        self._note(tag, dict(attrs))

    def _note(self, tag: str, attributes: dict[str, str | None]) -> None:
        if tag == "img" and attributes["src"] != EMPTY:
            self.pictures.append((attributes["alt"] or "", pixels(attributes["src"] or "")))
        self.ids += filter(None, [attributes.get("id")])
        self.links += filter(None, [attributes.get("href")])

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words.append(data)


def pixels(address: str) -> NDArray[np.uint8]:
    kind, data = address.split(",")
    assert kind == "data:image/webp;base64"
    return np.asarray(Image.open(BytesIO(b64decode(data, validate=True))))


def checked(path: Path) -> Page:
    """Return a page that is well-formed, complete, and asks no network for anything."""
    page = Page(path)
    assert page.open == []
    assert len(set(page.ids)) == len(page.ids)
    for link in page.links:
        assert link == EMPTY or link[1:] in page.ids
    assert all(words for words, _ in page.pictures)
    assert [file.name for file in path.parent.iterdir()] == [path.name]
    source = path.read_text(encoding="utf-8")
    assert not any(words in source for words in ("http:", "https:", "url(", "@import"))
    return page
