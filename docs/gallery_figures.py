"""Makes the pictures of the page on the gallery: ``python docs/gallery_figures.py``, 10 seconds."""

from __future__ import annotations

from figures import strip
from PIL import Image

from drpt.gallery.figures import DIFFUSE, GLOSSY, RADII
from drpt.output import to_display
from drpt.render import Mode, render
from drpt.scene import load_scene

SIZE = 192
SMALLEST = min(RADII, key=RADII.__getitem__)


def main() -> None:
    """Write a strip for more bounces, for smaller lamps, and for glossy walls."""
    few = [
        (f"explicit, 10 spp, {bounces} bounces", picture(DIFFUSE, Mode.EXPLICIT, 10, bounces))
        for bounces in (2, 3, 4)
    ]
    many = "implicit, 1024 spp, 4 bounces", picture(DIFFUSE, Mode.IMPLICIT, 1024, 4)
    strip([*few, many], "gallery-bounces.webp")
    implicit = [
        (f"radius {radius}, implicit, 1024 spp", picture(lamp, Mode.IMPLICIT, 1024, 2))
        for lamp, radius in RADII.items()
    ]
    explicit = "radius 10, explicit, 10 spp", picture(SMALLEST, Mode.EXPLICIT, 10, 2)
    strip([*implicit, explicit], "gallery-lamps.webp")
    modes = [
        (f"{mode}, 4 bounces", picture(GLOSSY, mode, 1024, 4))
        for mode in (Mode.IMPLICIT, Mode.EXPLICIT, Mode.MIS)
    ]
    strip([("mis, 2 bounces", picture(GLOSSY, Mode.MIS, 1024, 2)), *modes], "gallery-glossy.webp")


def picture(scene: str, mode: Mode, spp: int, bounces: int) -> Image.Image:
    """Render one of the gallery's pictures, smaller, with independent samples."""
    result = render(
        load_scene(scene).resized(SIZE, SIZE), spp, bounces, mode, sampler="independent"
    )
    return Image.fromarray(to_display(result.image))


if __name__ == "__main__":
    main()
