"""How long NumPy takes for the course's own pictures: ``python -m tests.gallery.course_in_numpy``.

The float64 path tracer of the tests traces one sample of each pixel of each picture, half a minute
in all, and the seconds are taken times the samples.
"""

from __future__ import annotations

from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

from drpt.gallery.figures import course_plan
from drpt.render import Mode
from drpt.scene import load_scene
from tests.oracle import path_tracer

if TYPE_CHECKING:
    from drpt.gallery.figures import Setting


def main() -> None:
    """Print hours and paths per second."""
    plan = course_plan()
    seconds = sum(setting.spp * sample_seconds(setting, plan.size) for setting in plan.course)
    paths = plan.size**2 * sum(setting.spp for setting in plan.course)
    print(f"{seconds / 3600:.1f} hours, {paths / seconds / 1e6:.3f} million paths per second")


def sample_seconds(setting: Setting, size: int) -> float:
    """Trace one sample of each pixel."""
    scene = load_scene(setting.scene).resized(size, size)
    rows, columns = np.indices((size, size)).reshape(2, -1)
    rng = np.random.default_rng(0)
    explicit = setting.mode is Mode.EXPLICIT
    start = perf_counter()
    rays = path_tracer.camera_rays(scene.camera, rows, columns, rng)
    path_tracer.radiance(
        scene, *rays, setting.bounces, rng, direct_light=explicit, sample_brdf=True
    )
    return perf_counter() - start


if __name__ == "__main__":
    main()
