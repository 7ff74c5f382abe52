"""What a notebook shows of a result."""

from __future__ import annotations

from base64 import b64decode
from dataclasses import replace
from html.parser import HTMLParser
from io import BytesIO

import numpy as np
import pytest
from PIL import Image

import drpt
from drpt.output import to_display


class Figure(HTMLParser):
    """Collects images, text and tags of HTML; every tag must be closed."""

    VOID = ("img", "br")

    def __init__(self, html: str) -> None:
        super().__init__()
        self.images: list[dict[str, str | None]] = []
        self.lines: list[str] = []
        self._open: list[str] = []
        self.feed(html)
        self.close()
        assert self._open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        assert tag in ("figure", "figcaption", *self.VOID)
        if tag == "img":
            self.images.append(dict(attrs))
        if tag not in self.VOID:
            self._open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.lines.append(data)


@pytest.fixture(scope="module")
def result() -> drpt.Result:
    light = drpt.Sphere(center=(0, 0, 0), radius=1, radiance=0.5)
    camera = drpt.Camera(eye=(0, 0, 5), target=(0, 0, 0), up=(0, 1, 0), fov=40, width=7, height=5)
    return drpt.render(drpt.Scene(camera, [light], "<b>A lamp</b>"), spp=16, bounces=1, seed=3)


def test_is_the_picture_as_a_png_would_show_it(result: drpt.Result) -> None:
    (image,) = Figure(result._repr_html_()).images
    assert (image["width"], image["height"]) == ("7", "5")
    kind, _, data = str(image["src"]).partition(",")
    assert kind == "data:image/png;base64"
    with Image.open(BytesIO(b64decode(data))) as picture:
        assert picture.format == "PNG"
        np.testing.assert_array_equal(np.asarray(picture), to_display(result.image))


def test_says_what_it_is_and_how_good(result: drpt.Result) -> None:
    description, settings = Figure(result._repr_html_()).lines
    assert description == "<b>A lamp</b>"
    assert settings == str(result)
    for fact in ("7x5", "16 spp", "1 bounce,", "mis", "sobol", "seed 3"):
        assert fact in settings
    assert f"relMSE {result.error:.2g}" in settings
    assert not {"partial", "biased"} & set(settings.split())


def test_says_what_is_wrong(result: drpt.Result) -> None:
    warning = "1 < 2 samples were not finite"
    bad = replace(result, partial=True, denoised=True, warning=warning, _differences=None)
    _, settings, last = Figure(bad._repr_html_()).lines
    assert settings.endswith("relMSE unknown, partial, denoised (biased)")
    assert last == warning


def test_text_alone_is_one_short_line(result: drpt.Result) -> None:
    assert repr(result) == f"<Result {result}>"
    assert "\n" not in repr(result)


def test_ipython_displays_it(result: drpt.Result) -> None:
    interactive = pytest.importorskip("IPython.core.interactiveshell")
    data, _ = interactive.InteractiveShell().display_formatter.format(result)
    assert data == {"text/html": result._repr_html_(), "text/plain": repr(result)}
