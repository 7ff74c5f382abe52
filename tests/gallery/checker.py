"""Parses a page, and checks what every page must be."""

from __future__ import annotations

from html.parser import HTMLParser
from typing import TYPE_CHECKING

from PIL import Image

if TYPE_CHECKING:
    from pathlib import Path

VOID = {"meta", "link", "img", "br"}
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
        self.images: list[dict[str, str | None]] = []
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
        if tag == "img":
            self.images.append(attributes)
        self.ids += filter(None, [attributes.get("id")])
        self.links += filter(None, [attributes.get("href"), attributes.get("src")])

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words.append(data)


def checked(path: Path) -> Page:
    """Return a page that is well-formed, complete, and asks no network for anything."""
    page = Page(path)
    assert page.open == []
    assert len(set(page.ids)) == len(page.ids)
    for link in page.links:
        if link.startswith("#"):
            assert link[1:] in page.ids
        elif link != "data:,":
            with Image.open(path.parent / link) as picture:
                picture.load()
    assert all(image["alt"] for image in page.images)
    source = path.read_text(encoding="utf-8")
    assert not any(words in source for words in ("http:", "https:", "url(", "@import", "<script"))
    return page
