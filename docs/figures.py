"""Makes the pictures of the README: ``python docs/figures.py``, some minutes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image, ImageDraw, ImageFont

from drpt import Mode, Scene, load_scene, render

FOLDER = Path(__file__).parent
SCENES = ("cornell-box", "cornell-box-small-light", "cornell-box-glossy", "veach", "many-lights")
HEIGHT = 256
GAP = 4
INK, PAPER = (40, 40, 40), (255, 255, 255)


def main() -> None:
    """Write a strip of scenes, and a strip of modes at equal numbers of samples."""
    strip([(name, picture(load_scene(name), 1024, 4, Mode.MIS)) for name in SCENES], "scenes.png")
    glossy = load_scene("cornell-box-glossy")
    strip([(mode, picture(glossy, 16, 3, mode)) for mode in Mode], "modes.png")


def picture(scene: Scene, spp: int, bounces: int, mode: Mode) -> Image.Image:
    """Render a scene at the height of a strip."""
    camera = scene.camera
    width = round(camera.width * HEIGHT / camera.height)
    resized = replace(scene, camera=replace(camera, width=width, height=HEIGHT))
    with TemporaryDirectory() as folder:
        path = Path(folder) / "picture.png"
        render(resized, spp, bounces, mode).save(path)
        return Image.open(path).convert("RGB")


def strip(pictures: list[tuple[str, Image.Image]], name: str) -> None:
    """Write pictures beside each other, each over its caption."""
    font = ImageFont.load_default(size=15)
    width = sum(image.width + GAP for _, image in pictures) - GAP
    sheet = Image.new("RGB", (width, HEIGHT + 24), PAPER)
    left = 0
    for caption, image in pictures:
        sheet.paste(image, (left, 0))
        middle = left + image.width / 2
        ImageDraw.Draw(sheet).text((middle, HEIGHT + 3), caption, INK, font, anchor="ma")
        left += image.width + GAP
    sheet.save(FOLDER / name, optimize=True)


if __name__ == "__main__":
    main()
