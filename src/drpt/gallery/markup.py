"""Pieces of the page, as HTML."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

from drpt.gallery.embedding import address, cut

if TYPE_CHECKING:
    from collections.abc import Iterable

    import numpy as np
    from numpy.typing import NDArray

    from drpt.gallery.answers import Answer, Finding, Shown, Table
    from drpt.gallery.figures import Crop
    from drpt.gallery.rendering import Picture


def section(number: int, title: str, body: str) -> str:
    """A part of the page."""
    return f'<section id="part-{number}">\n<h2>{escape(title)}</h2>\n{body}\n</section>'


def link(number: int, title: str) -> str:
    """A line of the contents, which leads to a part."""
    return f'<li><a href="#part-{number}">{escape(title)}</a></li>'


def paragraph(text: str) -> str:
    """A paragraph of plain words; `backticks` mark code."""
    parts = escape(text).split("`")
    marked = (f"<code>{part}</code>" if odd % 2 else part for odd, part in enumerate(parts))
    return f"<p>{''.join(marked)}</p>"


def row(label: str, cards: Iterable[str]) -> str:
    """Cards beside each other, where there is room."""
    return f'<h3>{escape(label)}</h3>\n<div class="row">\n{"".join(cards)}</div>\n'


def card(picture: Picture, crops: tuple[Crop, ...]) -> str:
    """A picture, places in it enlarged, its setting and its measures."""
    setting, image = picture.setting, picture.image
    places = "".join(f'<i class="place" style="{_place(crop)}"></i>' for crop in crops)
    details = "".join(
        f'<img src="{address(cut(image, crop))}" alt="detail: {escape(crop.name)}" loading="lazy">'
        for crop in crops
    )
    return (
        f"<figure>{_button(image, str(setting), places)}\n"
        f'<span class="crops">{details}</span>\n'
        f"<figcaption><strong>{escape(setting.short)}</strong><br>{picture.seconds:.2g} s, "
        f"relMSE {picture.rel_mse:.2g}</figcaption></figure>\n"
    )


def table(content: Table) -> str:
    """A table."""
    head = "".join(f'<th scope="col">{escape(cell)}</th>' for cell in content.head)
    rows = "".join(
        f'<tr><th scope="row">{escape(first)}</th>'
        f"{''.join(f'<td>{escape(cell)}</td>' for cell in rest)}</tr>\n"
        for first, *rest in content.rows
    )
    return wide(
        content.caption,
        f"<table><caption>{escape(content.caption)}</caption>\n"
        f"<thead><tr>{head}</tr></thead>\n<tbody>{rows}</tbody></table>",
    )


def wide(label: str, body: str) -> str:
    """What scrolls by itself where the page is narrow."""
    return f'<div class="wide" role="region" tabindex="0" aria-label="{escape(label)}">{body}</div>'


def folded(summary: str, body: str) -> str:
    """What opens when it is asked for."""
    return f"<details><summary>{escape(summary)}</summary>\n{body}</details>"


def answer(content: Answer) -> str:
    """What the pictures say to a question."""
    findings = "\n".join(_finding(finding) for finding in content.findings)
    pictures = "".join(_shown(picture) for picture in content.pictures)
    parts = (
        paragraph(content.text),
        f'<h3>Measured</h3>\n<ul class="findings">\n{findings}\n</ul>',
        wide("Chart", content.chart) if content.chart else "",
        f'<div class="row">\n{pictures}</div>' if pictures else "",
        table(content.table),
    )
    return "\n".join(filter(None, parts))


def _finding(finding: Finding) -> str:
    sign, words, kind = (
        ("✓", "holds", "holds") if finding.holds else ("✗", "does not hold", "fails")
    )
    verdict = (
        f'<span class="verdict"><span aria-hidden="true">{sign}</span>'
        f'<span class="aside">{words}: </span></span>'
    )
    return f'<li class="{kind}">{verdict}{escape(finding.text)}</li>'


def _shown(picture: Shown) -> str:
    button = _button(picture.image, picture.caption)
    return f"<figure>{button}<figcaption>{escape(picture.caption)}</figcaption></figure>\n"


def _button(image: NDArray[np.floating], words: str, marks: str = "") -> str:
    """A picture that is shown large when it is chosen."""
    height, width, _ = image.shape
    return (
        f'<button type="button" class="picture" aria-haspopup="dialog"><img src="{address(image)}" '
        f'width="{width}" height="{height}" loading="lazy" alt="{escape(words)}">{marks}</button>'
    )


def _place(crop: Crop) -> str:
    left, top, side = (100 * share for share in (crop.left, crop.top, crop.side))
    return f"left:{left:g}%;top:{top:g}%;width:{side:g}%;height:{side:g}%"
