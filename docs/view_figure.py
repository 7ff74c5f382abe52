"""Makes the picture of the live view: ``python docs/view_figure.py``, with Chromium, 20 seconds."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

from PIL import Image
from playwright.sync_api import sync_playwright

FILE = Path(__file__).parent / "view.webp"
SHOWN = (
    "scene=cornell-box-glossy&left=mis,sobol,4&right=explicit,sobol,4&pixel=118,178&path=6"
    "&divider=0.6"
)
SECONDS = 4


def main() -> None:
    """Look at a scene for some seconds, and keep what was seen."""
    command = [sys.executable, "-m", "drpt", "view", "cornell-box", "--no-browser", "--port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout
        try:
            _capture(f"{server.stdout.readline().strip()}#{SHOWN}", FILE.with_suffix(".png"))
        finally:
            server.terminate()
    with Image.open(FILE.with_suffix(".png")) as shot:
        shot.convert("RGB").save(FILE, quality=85, method=6)
    FILE.with_suffix(".png").unlink()


def _capture(url: str, path: Path) -> None:
    flags = ["--no-sandbox"] if os.geteuid() == 0 else []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=flags)
        page = browser.new_page(viewport={"width": 1440, "height": 900}, color_scheme="dark")
        page.goto(url)
        page.wait_for_timeout(1000 * SECONDS)
        page.screenshot(path=path)
        browser.close()


if __name__ == "__main__":
    main()
