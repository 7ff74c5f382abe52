"""Pieces of the page, as HTML."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

    from drpt.gallery.answers import Answer, Finding, Shown, Table
    from drpt.gallery.figures import Crop
    from drpt.gallery.rendering import Picture

PICTURES = "pictures"
"""The folder of the pictures, beside the page."""


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
    setting = picture.setting
    source = f"{PICTURES}/{setting.name}.png"
    size = picture.image.shape[0]
    places = "".join(f'<i class="place" style="{_place(crop)}"></i>' for crop in crops)
    details = "".join(
        f'<span class="crop"><img src="{source}" alt="detail {number}" loading="lazy" '
        f'style="{_enlarged(crop)}"></span>'
        for number, crop in enumerate(crops, start=1)
    )
    return (
        f'<figure><a class="picture" href="{source}"><img src="{source}" width="{size}" '
        f'height="{size}" loading="lazy" alt="Cornell box, {escape(str(setting))}">{places}</a>\n'
        f'<span class="crops">{details}</span>\n'
        f"<figcaption><strong>{escape(setting.short)}</strong><br>{picture.seconds:.2g} s, "
        f"relMSE {picture.rel_mse:.2g}</figcaption></figure>\n"
    )


def table(content: Table) -> str:
    """A table that scrolls where the page is narrow."""
    head = "".join(f'<th scope="col">{escape(cell)}</th>' for cell in content.head)
    rows = "".join(
        f'<tr><th scope="row">{escape(first)}</th>'
        f"{''.join(f'<td>{escape(cell)}</td>' for cell in rest)}</tr>\n"
        for first, *rest in content.rows
    )
    return (
        f'<div class="wide" role="region" tabindex="0" aria-label="{escape(content.caption)}">'
        f"<table><caption>{escape(content.caption)}</caption>\n"
        f"<thead><tr>{head}</tr></thead>\n<tbody>{rows}</tbody></table></div>"
    )


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
        content.chart,
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
    source = f"{PICTURES}/{picture.name}.png"
    height, width, _ = picture.image.shape
    return (
        f'<figure><a class="picture" href="{source}"><img src="{source}" width="{width}" '
        f'height="{height}" loading="lazy" alt="{escape(picture.caption)}"></a>'
        f"<figcaption>{escape(picture.caption)}</figcaption></figure>\n"
    )


def _place(crop: Crop) -> str:
    left, top, side = (100 * share for share in crop)
    return f"left:{left:g}%;top:{top:g}%;width:{side:g}%;height:{side:g}%"


def _enlarged(crop: Crop) -> str:
    """How a whole picture lies behind a window that shows a part of it."""
    left, top, side = crop
    return f"width:{100 / side:g}%;left:{-100 * left / side:g}%;top:{-100 * top / side:g}%"
