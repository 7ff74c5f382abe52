"""What is rendered: built-in scenes, and seeded ones of any size."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from drpt import Camera, Diffuse, Mesh, Scene, Sphere, load_scene

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats: TypeAlias = NDArray[np.float64]

CORNELL_BOXES = (
    "cornell-box",
    "cornell-box-medium-light",
    "cornell-box-small-light",
    "cornell-box-glossy",
)
CORNELL_BOUNCES = (2, 4)
MESH_TRIANGLES = 500_000
SIDE = 256
"""Pixels, of the Cornell boxes too."""
SEED = 5
WAVES = 24
"""Sines that a terrain is the sum of."""


@dataclass(frozen=True)
class Configuration:
    """A scene with a number of bounces."""

    name: str
    scene: Scene
    bounces: int

    @property
    def paths_per_sample(self) -> int:
        """Pixels of the picture."""
        return self.scene.camera.width * self.scene.camera.height

    def __str__(self) -> str:
        return f"{self.name}, {self.bounces} bounces"


def builtin(name: str, bounces: int) -> Configuration:
    """One of drpt's scenes."""
    return Configuration(name, load_scene(name), bounces)


def mesh(triangles: int = MESH_TRIANGLES) -> Configuration:
    """A terrain, diffuse, with 2 bounces."""
    return Configuration(f"{triangles // 1000} k triangles", terrain(triangles), 2)


def configurations() -> list[Configuration]:
    """All that error is measured on, as a function of time."""
    boxes = [builtin(name, bounces) for name in CORNELL_BOXES for bounces in CORNELL_BOUNCES]
    return [*boxes, *(builtin(name, 4) for name in ("spheres", "many-lights", "veach")), mesh()]


def resized(scene: Scene, height: int) -> Scene:
    """The same scene with another number of pixels."""
    camera = scene.camera
    width = round(camera.width * height / camera.height)
    return scene.resized(width, height)


def terrain(triangles: int) -> Scene:
    """Hills in an open box under a sphere light; about so many triangles besides the walls."""
    side = max(1, round((triangles / 2) ** 0.5))
    vertices, faces = _grid(side)
    rng = np.random.default_rng(SEED)
    for wave in range(1, WAVES + 1):
        direction, phase = rng.normal(scale=wave, size=2), rng.uniform(0, 2 * np.pi)
        vertices[:, 1] += 0.12 / wave * np.sin(vertices[:, ::2] @ direction + phase)
    ground = Mesh(vertices, faces, material=Diffuse((0.5, 0.6, 0.4)))
    camera = Camera((0, 1.7, 2.9), (0, 0.3, 0), (0, 1, 0), 40, SIDE, SIDE)
    lamp = Sphere((0.2, 1.4, 0.1), 0.15, radiance=30)
    return Scene(camera, [ground, _wall(0, -1), _wall(0, 1), _wall(2, -1), lamp])


def ball_pit(count: int) -> Scene:
    """So many diffuse spheres in a box with walls behind and below, under a sphere light."""
    rng = np.random.default_rng(SEED)
    centers = rng.uniform((-1, 0, -1), (1, 1.2, 1), (count, 3))
    radius = 0.3 * count ** (-1 / 3)
    material = Diffuse((0.6, 0.5, 0.4))
    balls = [Sphere(tuple(center), radius, material) for center in centers.tolist()]
    camera = Camera((0, 1.0, 4.2), (0, 0.6, 0), (0, 1, 0), 40, SIDE, SIDE)
    lamp = Sphere((0.2, 1.9, 0.1), 0.15, radiance=30)
    return Scene(camera, [*balls, _wall(1, 0), _wall(0, -1), _wall(0, 1), _wall(2, -1), lamp])


def lanterns(count: int) -> Scene:
    """The scene ``many-lights`` with so many sphere lights of unequal sizes and radiances.

    Their area and power together hardly depend on their number.
    """
    rng = np.random.default_rng(SEED)
    scene = load_scene("many-lights")
    dull = [shape for shape in scene.shapes if not shape.is_light]
    centers = rng.uniform((-5, 3, -2.5), (5, 5.5, 4), (count, 3))
    radii = 0.25 * count**-0.5 * np.exp(rng.normal(scale=0.3, size=count))
    radiances = 60 * np.exp(rng.normal(scale=1.0, size=count))
    rows = zip(centers.tolist(), radii.tolist(), radiances.tolist(), strict=True)
    lights = [Sphere(center, radius, radiance=radiance) for center, radius, radiance in rows]
    return replace(scene, shapes=(*dull, *lights))


def _grid(side: int) -> tuple[Floats, NDArray[np.int64]]:
    """Vertices and faces of a flat square from -1 to 1, of 2 side² triangles."""
    x, z = np.meshgrid(*2 * [np.linspace(-1, 1, side + 1)])
    vertices = np.stack([x.ravel(), np.zeros(x.size), z.ravel()], axis=-1)
    i, j = np.indices((side, side)).reshape(2, -1)
    a = i * (side + 1) + j
    b, c, d = a + side + 1, a + side + 2, a + 1
    return vertices, np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])


def _wall(axis: int, offset: float) -> Mesh:
    """A square 2 wide, at a coordinate of an axis; upright ones stand on the ground."""
    corners = np.insert([(-1.0, -1.0), (1, -1), (1, 1), (-1, 1)], axis, offset, axis=1)
    if axis != 1:
        corners[:, 1] += 0.9
    return Mesh(corners, [(0, 1, 2), (0, 2, 3)], material=Diffuse(0.7))
