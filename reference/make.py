"""Makes the references of the built-in scenes with Mitsuba: ``python -m reference.make``.

Each is an EXR file with the mean and, in the layer ``variance``, the variance of that mean; its
metadata says how it was made. All of them take a quarter of an hour on two cores.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from time import perf_counter

from drpt import Scene, load_scene
from drpt.crosscheck import reference
from drpt.crosscheck.references import MITSUBA
from drpt.crosscheck.stored import save_estimate
from drpt.crosscheck.variant import VARIANT
from drpt.distribution import versions
from drpt.scene.builtin import builtin_names
from drpt.scene.saving import to_toml

FOLDER = Path(__file__).parent
BOUNCES = range(5)
HEIGHT = 64
SPP = 16384


def main() -> None:
    """Render the references of some or all built-in scenes."""
    parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False)
    parser.add_argument("scenes", metavar="SCENE", nargs="*", help="by default all")
    for name in parser.parse_args().scenes or builtin_names():
        for bounces in BOUNCES:
            start = perf_counter()
            make(name, bounces)
            print(f"{path_of(name, bounces)}: {perf_counter() - start:.0f} s", flush=True)


def path_of(name: str, bounces: int) -> Path:
    """The file of a built-in scene's reference."""
    return FOLDER / f"{name}-{bounces}.exr"


def small(scene: Scene) -> Scene:
    """The same scene with the references' height."""
    camera = scene.camera
    width = round(camera.width * HEIGHT / camera.height)
    return scene.resized(width, HEIGHT)


def make(name: str, bounces: int) -> None:
    """Render a reference and write it."""
    scene = small(load_scene(name))
    metadata: dict[str, str | int | float] = {
        "renderer": MITSUBA,
        "integrator": f"path, max_depth {bounces + 1}, no Russian roulette",
        "variant": VARIANT,
        "sampler": "independent",
        "bounces": bounces,
        "seed": bounces,
        **versions("mitsuba", "drjit"),
        "scene": to_toml(scene),
    }
    estimate = reference(scene, SPP, bounces, seed=bounces)
    save_estimate(estimate, path_of(name, bounces), metadata)


if __name__ == "__main__":
    main()
