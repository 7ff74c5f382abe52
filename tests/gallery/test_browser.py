"""The page in a real Chromium, where there is one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from drpt.gallery import making
from drpt.gallery.making import make_gallery
from tests.browsing import chromium

if TYPE_CHECKING:
    from pathlib import Path

    from drpt.gallery.figures import Plan

NARROW = 320
"""Pixels of CSS: a small telephone, or 1280 at a zoom of 400 %."""


@pytest.mark.slow
def test_a_picture_is_enlarged_by_the_keyboard(
    plan: Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is there, nothing sticks out of a narrow window, and Escape leads back."""
    monkeypatch.setattr(making, "QUESTIONS", ())
    path = make_gallery(tmp_path, plan)
    complaints: list[str] = []
    with chromium() as browser:
        page = browser.new_page(viewport={"width": NARROW, "height": 600})
        page.on("console", lambda message: complaints.append(message.text))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.goto(path.as_uri())
        assert page.evaluate("document.documentElement.scrollWidth") == NARROW
        small = page.locator(".picture").nth(1)
        small.focus()
        page.keyboard.press("Enter")
        large = page.get_by_role("dialog").locator("img")
        assert large.get_attribute("alt") == str(plan.settings[1])
        assert large.evaluate("image => image.naturalWidth") == plan.size
        page.keyboard.press("Escape")
        assert not large.is_visible()
        assert small.evaluate("button => button === document.activeElement")
    assert complaints == []
