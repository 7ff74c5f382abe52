"""Images measured with their errors, and the gates that compare them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

import drpt
from tests.oracle.statistics import assert_means_agree, smallest_detectable

if TYPE_CHECKING:
    import numpy.typing as npt

    from drpt.scene import Shape
    from tests.oracle.arrays import Floats

SIGNIFICANCE = 1e-4
"""Probability that a gate fails by chance: about a hundred of them are passed."""

ROUNDING = 4e-6
"""Error of a mean, relative, that is left where samples have no noise: of float32."""

PILOT_PATHS = 2**18
PILOT_MARGIN = 1.5
"""Of variance: what a pilot may underestimate."""


@dataclass(frozen=True)
class Measured:
    """Mean radiance of an image (3,) and its standard error (3,)."""

    mean: Floats
    standard_error: Floats

    def __mul__(self, factor: float) -> Measured:
        return Measured(self.mean * factor, self.standard_error * factor)

    def detects(self, other: Measured | None = None) -> float:
        """Smallest bias, relative to the mean, that `assert_agree` sees 19 times out of 20."""
        error = self.standard_error if other is None else _joint_error(self, other)
        return float((smallest_detectable(error, SIGNIFICANCE, 3) / self.mean).max())


def measure(
    scene: drpt.Scene,
    paths: int,
    bounces: int,
    mode: str,
    *,
    seed: int = 1,
    reflected: bool = False,
    **options: Any,
) -> Measured:
    """Render twice, with about so many paths in all, and take the error from the difference.

    The pixels' errors are independent, and so are both seeds; the expectation of
    ((a − b) / 2)² is the variance of the mean of a and b. Where only ``reflected`` light is
    asked for, light that is seen directly is taken off; it has the same noise in every mode.
    """
    spp = max(1, paths // (2 * scene.camera.width * scene.camera.height))
    options = {"sampler": "independent", **options}

    def image(bounces: int, seed: int) -> Floats:
        picture = drpt.render(scene, spp, bounces, mode, seed=seed, **options).image
        return picture.reshape(-1, 3).astype(np.float64)

    seeds = (2 * seed, 2 * seed + 1)
    a, b = (image(bounces, s) - (image(0, s) if reflected else 0) for s in seeds)
    mean = ((a + b) / 2).mean(axis=0)
    noise = np.sqrt((((a - b) / 2) ** 2).sum(axis=0)) / len(a)
    return Measured(mean, np.hypot(noise, ROUNDING * np.abs(mean)))


def measure_to(
    detectable: float,
    scene: drpt.Scene,
    bounces: int,
    mode: str,
    *,
    seed: int = 1,
    **options: Any,
) -> Measured:
    """Measure with as many paths as it takes to detect such a bias, by a pilot's error."""
    pilot = measure(scene, PILOT_PATHS, bounces, mode, seed=0, **options)
    factor = max(1, (pilot.detects() / detectable) ** 2 * PILOT_MARGIN)
    return measure(scene, int(factor * PILOT_PATHS), bounces, mode, seed=seed, **options)


def assert_agree(measured: Measured, other: Measured | npt.ArrayLike, detectable: float) -> None:
    """Assert that means agree, by a gate that sees a bias of this size relative to the mean."""
    if not isinstance(other, Measured):
        other = Measured(np.broadcast_to(np.asarray(other, np.float64), 3), np.zeros(3))
    detected = measured.detects(other)
    assert detected <= detectable, f"the gate detects {detected:.3%} only"
    assert_means_agree(
        measured.mean, measured.standard_error, other.mean, other.standard_error, SIGNIFICANCE
    )


def with_picture(scene: drpt.Scene, width: int, height: int) -> drpt.Scene:
    """The same scene with a picture of another size."""
    camera = scene.camera
    return drpt.Scene(
        camera=drpt.Camera(camera.eye, camera.target, camera.up, camera.fov, width, height),
        shapes=scene.shapes,
    )


def with_radiance(scene: drpt.Scene, factor: float) -> drpt.Scene:
    """The same scene, its lights brighter by a factor."""

    def brighter(shape: Shape) -> Shape:
        if shape.radiance is None:
            return shape
        radiance = tuple(factor * x for x in shape.radiance)
        if isinstance(shape, drpt.Sphere):
            return drpt.Sphere(shape.center, shape.radius, radiance=radiance)
        return drpt.Mesh(shape.vertices, shape.faces, shape.normals, radiance=radiance)

    return drpt.Scene(camera=scene.camera, shapes=[brighter(shape) for shape in scene.shapes])


def _joint_error(a: Measured, b: Measured) -> Floats:
    return np.hypot(a.standard_error, b.standard_error)
