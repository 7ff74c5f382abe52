"""What is compared: drpt in every mode, Mitsuba 3, and the float64 oracle, all called alike."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

from drpt import Mode, Scene, render
from drpt.crosscheck import to_mitsuba_dict
from drpt.crosscheck.variant import load_mitsuba
from drpt.render import SAMPLERS
from tests.oracle import path_tracer

if TYPE_CHECKING:
    from numpy.typing import NDArray


class Picture(NamedTuple):
    """Linear radiance (height, width, 3), and the rays it took, where that is told."""

    image: NDArray[np.floating]
    rays: int | None


Render: TypeAlias = Callable[[int, int], Picture]
"""Takes samples per pixel and a seed."""
Factory: TypeAlias = Callable[[Scene, int], Render]
"""Loads a scene for a number of bounces."""

MITSUBA = "Mitsuba"
ORACLE = "NumPy oracle"


def drpt(mode: Mode, sampler: str) -> Factory:
    """Whole calls of `drpt.render`, with all that they do before and after the kernel.

    Each learns anew where paths are guided, though drpt would know it from the call before.
    """

    def load(scene: Scene, bounces: int) -> Render:
        def rendered(spp: int, seed: int) -> Picture:
            from drpt.kernel.launch import learned, piloted

            learned.forget()
            piloted.forget()
            result = render(scene, spp, bounces, mode, sampler=sampler, seed=seed)
            return Picture(result.image, result.rays)

        return rendered

    return load


def mitsuba(sampler: str) -> Factory:
    """Mitsuba's path integrator in ``llvm_ad_rgb``, on a scene that is loaded once."""

    def load(scene: Scene, bounces: int) -> Render:
        mi = load_mitsuba()
        table = to_mitsuba_dict(scene, bounces)
        table["sensor"]["sampler"]["type"] = sampler
        loaded = mi.load_dict(table)
        return lambda spp, seed: Picture(
            np.array(mi.render(loaded, spp=spp, seed=mi.UInt32(seed))), None
        )

    return load


def oracle(scene: Scene, bounces: int) -> Render:
    """The float64 path tracer of the tests, one sample of all pixels a pass, explicit."""
    camera = scene.camera
    rows, columns = np.indices((camera.height, camera.width)).reshape(2, -1)

    def rendered(spp: int, seed: int) -> Picture:
        rng = np.random.default_rng(seed)
        total = np.zeros((len(rows), 3))
        for _ in range(spp):
            rays = path_tracer.camera_rays(camera, rows, columns, rng)
            total += path_tracer.radiance(
                scene, *rays, bounces, rng, direct_light=True, sample_brdf=True
            )
        return Picture((total / spp).reshape(camera.height, camera.width, 3), None)

    return rendered


def label(mode: Mode, sampler: str) -> str:
    """The name of drpt in a mode with a sampler."""
    return f"drpt {mode}, {sampler}"


DRPT = {label(mode, sampler): drpt(mode, sampler) for mode in Mode for sampler in SAMPLERS}
MITSUBAS = {f"{MITSUBA}, {name}": mitsuba(name) for name in ("independent", "multijitter")}
ALL = {**DRPT, **MITSUBAS, ORACLE: oracle}
