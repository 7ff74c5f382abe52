"""The question why the reflection of the small box has one bounce of light less than the box."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from drpt.gallery.answers import Answer, Finding, Shown, Table
from drpt.gallery.figures import GLOSSY
from drpt.gallery.parts import Part
from drpt.render import Mode
from drpt.scene import Camera, Mesh, Phong

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from drpt.gallery.rendering import Darkroom
    from drpt.scene import Scene
    from drpt.scene.model import Shape

    Point = NDArray[np.float64]

QUESTION = (
    "Why does the small box, reflected in the large one, seem to have one bounce of light less?"
)
TEXT = """Because it has. Light that comes from the small box by way of the mirror has bounced once
more when it reaches the eye, and `bounces` counts that one, too. To see it in numbers, two cameras
look at the same spot of the small box, on the side that the large box reflects: one from the eye,
by way of the mirror, and one from the mirror, directly. What comes by way of the mirror is divided
by the share that the mirror reflects: its albedo, times the cosine of the angle of incidence, as
Phong lobes have it. The pictures show more of that side. Those of the reflection are turned back,
left to right, and begin where the box itself stands before it."""
BOUNCES = 5
SPP = 1024
SIZE = 16
"""Pixels along the sides of the two cameras' pictures."""
SPOT = 30.0
"""Side of the spot in mm, small beside the box (165 mm), large beside the mirror's blur (10 mm)."""
SHOWN_BOUNCES, SHOWN_SPP, SHOWN_SIZE = 2, 256, 192
SHOWN = 100.0
"""Side of what the pictures show, in mm: more than half of that side of the small box."""
SIDE = (2, 3, 6, 7)
"""Vertices of the side of the small box that the mirror shows."""
FACE = (0, 4, 5)
"""Those of the mirror."""
SKIN = 0.01
"""How far in front of the mirror its camera stands, in mm."""
TOLERANCE = 0.02
"""The mirror's lobe (exponent 1000) blurs a spot that is not quite even, and noise is left."""
ABSENT = 0.01
"""Share of the light that is as good as none."""


@dataclass(frozen=True)
class Views:
    """The scene, seen from the eye by way of the mirror, and from the mirror.

    ``reflectance`` is the share of the radiance that the mirror reflects.
    """

    reflected: Scene
    direct: Scene
    reflectance: float


def mirror(darkroom: Darkroom) -> Answer:
    """Measure the same spot, reflected and directly, with 1 to 5 bounces."""
    views = make_views(darkroom.scene(GLOSSY), SPOT, SIZE)
    counts = range(1, BOUNCES + 1)

    def mean(view: Scene, bounces: int) -> float:
        return float(darkroom.render(view, SPP, bounces, Mode.MIS).image.mean())

    direct = [mean(views.direct, bounces) for bounces in counts]
    reflected = [mean(views.reflected, bounces) / views.reflectance for bounces in counts]
    table = Table(
        "Mean radiance of the spot",
        ("", *(f"{bounces} bounce{'s' * (bounces > 1)}" for bounces in counts)),
        (
            ("seen from the mirror", *(f"{value:.4f}" for value in direct)),
            ("reflected, divided by the share", *(f"{value:.4f}" for value in reflected)),
        ),
    )
    return Answer(QUESTION, TEXT, _findings(direct, reflected), table, pictures=_pictures(darkroom))


def _pictures(darkroom: Darkroom) -> tuple[Shown, ...]:
    """The side of the box, and its reflection with as many bounces and with one more."""
    views = make_views(darkroom.scene(GLOSSY), SHOWN, SHOWN_SIZE)

    def image(view: Scene, bounces: int) -> NDArray[np.float32]:
        return darkroom.render(view, SHOWN_SPP, bounces, Mode.MIS).image

    return (
        Shown(f"Seen from the mirror, {SHOWN_BOUNCES} bounces", image(views.direct, SHOWN_BOUNCES)),
        *(
            Shown(
                f"Reflected, {bounces} bounces",
                image(views.reflected, bounces)[:, ::-1] / views.reflectance,
            )
            for bounces in (SHOWN_BOUNCES, SHOWN_BOUNCES + 1)
        ),
    )


def _findings(direct: list[float], reflected: list[float]) -> tuple[Finding, ...]:
    same = [there / here for there, here in zip(reflected, direct, strict=True)]
    shifted = [there / here for there, here in zip(reflected[1:], direct, strict=False)]
    return (
        Finding(
            "With 1 bounce the spot is lit, and its reflection is black: "
            f"{direct[0]:.2g} against {reflected[0]:.2g}.",
            reflected[0] < ABSENT * direct[0],
        ),
        Finding(
            f"With equal bounces the reflection is darker: {_percents(same)} of the spot's "
            f"radiance with 1 to {BOUNCES} bounces.",
            max(same) < 1,
        ),
        Finding(
            "With one bounce more than the direct view it has the same radiance: "
            f"{_percents(shifted)} (with 2 to {BOUNCES} against 1 to {BOUNCES - 1}).",
            all(abs(ratio - 1) < TOLERANCE for ratio in shifted),
        ),
    )


def make_views(scene: Scene, side: float, size: int) -> Views:
    """Return both views: the ray from the eye by way of the mirror, and what is left of it.

    Their pictures have ``size`` × ``size`` pixels, and show so many mm of the small box.
    """
    spot = _vertices(scene, Part.SMALL_BOX)[list(SIDE)].mean(axis=0)
    corner, *others = _vertices(scene, Part.LARGE_BOX)[list(FACE)]
    normal = np.cross(others[0] - corner, others[1] - corner)
    normal /= np.linalg.norm(normal)
    eye = np.array(scene.camera.eye)
    image = spot - 2 * ((spot - corner) @ normal) * normal
    share = ((eye - corner) @ normal) / ((eye - image) @ normal)
    on_mirror = eye + share * (image - eye)
    before_mirror = on_mirror + SKIN * normal
    distance = np.linalg.norm(image - eye)
    cosine = abs(float((image - eye) @ normal / distance))
    return Views(
        _looking(scene, eye, on_mirror, _fov(side, distance), size),
        _looking(scene, before_mirror, spot, _fov(side, np.linalg.norm(spot - on_mirror)), size),
        reflectance=cosine * _albedo(scene.shapes[Part.LARGE_BOX]),
    )


def _albedo(shape: Shape) -> float:
    assert isinstance(shape.material, Phong)
    return float(np.mean(shape.material.albedo))


def _fov(side: float, distance: np.floating) -> float:
    """Angle, in degrees, under which a length is seen."""
    return float(2 * np.degrees(np.arctan(side / 2 / distance)))


def _looking(scene: Scene, eye: Point, target: Point, fov: float, size: int) -> Scene:
    """Return the scene with another camera."""
    camera = Camera(tuple(eye), tuple(target), scene.camera.up, fov, size, size)
    return replace(scene, camera=camera)


def _vertices(scene: Scene, part: Part) -> Point:
    mesh = scene.shapes[part]
    assert isinstance(mesh, Mesh)
    return mesh.vertices


def _percents(ratios: list[float]) -> str:
    return ", ".join(f"{100 * ratio:.0f} %" for ratio in ratios)
