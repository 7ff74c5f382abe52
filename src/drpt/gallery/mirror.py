"""The question why the reflection of the small box has one bounce of light less than the box."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from drpt.gallery.answers import Answer, Finding, Table
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
by way of the mirror, and one from the mirror, directly. What the mirror keeps is divided out: its
albedo, times the cosine of the angle of incidence, as Phong lobes have it."""
BOUNCES = 5
SPP = 1024
SIZE = 16
"""Pixels along the sides of the two cameras' pictures."""
SPOT = 30.0
"""Side of the spot in mm, small beside the box (165 mm), large beside the mirror's blur (10 mm)."""
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

    ``kept`` is what the mirror keeps of the radiance.
    """

    reflected: Scene
    direct: Scene
    kept: float


def mirror(darkroom: Darkroom) -> Answer:
    """Measure the same spot, reflected and directly, with 1 to 5 bounces."""
    views = make_views(darkroom.scene(GLOSSY))
    counts = range(1, BOUNCES + 1)

    def mean(view: Scene, bounces: int) -> float:
        return float(darkroom.render(view, SPP, bounces, Mode.MIS).image.mean())

    direct = [mean(views.direct, bounces) for bounces in counts]
    reflected = [mean(views.reflected, bounces) / views.kept for bounces in counts]
    table = Table(
        "Mean radiance of the spot",
        ("", *(f"{bounces} bounce{'s' * (bounces > 1)}" for bounces in counts)),
        (
            ("seen from the mirror", *(f"{value:.4f}" for value in direct)),
            ("reflected, divided by what is kept", *(f"{value:.4f}" for value in reflected)),
        ),
    )
    return Answer(QUESTION, TEXT, _findings(direct, reflected), table)


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


def make_views(scene: Scene) -> Views:
    """Return both views: the ray from the eye by way of the mirror, and what is left of it."""
    spot = _vertices(scene, Part.SMALL_BOX)[list(SIDE)].mean(axis=0)
    corner, *others = _vertices(scene, Part.LARGE_BOX)[list(FACE)]
    normal = np.cross(others[0] - corner, others[1] - corner)
    normal /= np.linalg.norm(normal)
    eye = np.array(scene.camera.eye)
    image = spot - 2 * ((spot - corner) @ normal) * normal
    share = ((eye - corner) @ normal) / ((eye - image) @ normal)
    on_mirror = eye + share * (image - eye)
    distance = float(np.linalg.norm(image - eye))
    cosine = abs(float((image - eye) @ normal)) / distance
    return Views(
        _looking(scene, eye, on_mirror, distance),
        _looking(scene, on_mirror + SKIN * normal, spot, float(np.linalg.norm(spot - on_mirror))),
        kept=cosine * _albedo(scene.shapes[Part.LARGE_BOX]),
    )


def _albedo(shape: Shape) -> float:
    assert isinstance(shape.material, Phong)
    return float(np.mean(shape.material.albedo))


def _looking(scene: Scene, eye: Point, target: Point, distance: float) -> Scene:
    """Return the scene with a camera to which the spot, so far away, fills the picture."""
    fov = 2 * np.degrees(np.arctan(SPOT / 2 / distance))
    camera = Camera(tuple(eye), tuple(target), scene.camera.up, float(fov), SIZE, SIZE)
    return replace(scene, camera=camera)


def _vertices(scene: Scene, part: Part) -> Point:
    mesh = scene.shapes[part]
    assert isinstance(mesh, Mesh)
    return mesh.vertices


def _percents(ratios: list[float]) -> str:
    return ", ".join(f"{100 * ratio:.0f} %" for ratio in ratios)
