"""Makes the pictures of the README and the tutorial: ``python docs/figures.py``, some minutes."""

from __future__ import annotations

import re
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image, ImageDraw, ImageFont

from drpt import Mode, Scene, load_scene, render
from drpt.comparison import compare

FOLDER = Path(__file__).parent
SCENES = ("cornell-box", "cornell-box-small-light", "cornell-box-glossy", "veach", "many-lights")
HEIGHT = 256
GAP = 4
INK, PAPER = (40, 40, 40), (255, 255, 255)


def main() -> None:
    """Write a strip of scenes, a strip of modes at equal numbers of samples, and the tutorial's."""
    strip([(name, picture(load_scene(name), 1024, 4, Mode.MIS)) for name in SCENES], "scenes.png")
    glossy = load_scene("cornell-box-glossy")
    strip([(mode, picture(glossy, 16, 3, mode)) for mode in Mode], "modes.png")
    tutorial()


def tutorial() -> None:
    """Write what the tutorial's commands make, the errors side by side."""
    render(load_scene("cornell-box")).save(FOLDER / "tutorial-box.png")
    text = (FOLDER / "tutorial.md").read_text(encoding="utf-8")
    file = re.search("```toml\n(.*?)```", text, re.DOTALL)
    assert file
    with TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "balls.toml").write_text(file[1], encoding="utf-8")
        balls = load_scene(folder / "balls.toml")
        good = render(balls, 65536, target_error=1e-5)
        good.save(FOLDER / "tutorial-balls.png")
        errors: dict[str, Image.Image] = {}
        for mode in (Mode.EXPLICIT, Mode.MIS):
            path = folder / f"{mode}.png"
            compare(render(balls, 16, mode=mode), good).save_error(path)
            errors[mode] = Image.open(path).convert("RGB")
    strip(list(errors.items()), "tutorial-errors.png")


def picture(scene: Scene, spp: int, bounces: int, mode: Mode) -> Image.Image:
    """Render a scene at the height of a strip."""
    camera = scene.camera
    width = round(camera.width * HEIGHT / camera.height)
    resized = scene.resized(width, HEIGHT)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "picture.png"
        render(resized, spp, bounces, mode).save(path)
        return Image.open(path).convert("RGB")


def strip(pictures: list[tuple[str, Image.Image]], name: str) -> None:
    """Write pictures beside each other, each over its caption."""
    font = ImageFont.load_default(size=15)
    width = sum(image.width + GAP for _, image in pictures) - GAP
    height = max(image.height for _, image in pictures)
    sheet = Image.new("RGB", (width, height + 24), PAPER)
    left = 0
    for caption, image in pictures:
        sheet.paste(image, (left, 0))
        middle = left + image.width / 2
        ImageDraw.Draw(sheet).text((middle, height + 3), caption, INK, font, anchor="ma")
        left += image.width + GAP
    sheet.save(FOLDER / name, optimize=True)


if __name__ == "__main__":
    main()
