"""Whether guided paths are ever noisier than those of ``mis``: ``python -m benchmarks.guided``.

For each scene and number of bounces, the relMSE of ``guided`` over that of ``mis`` with as many
samples, and the interval that covers 95 % of it, by a bootstrap over seeds. Where nothing is guided
both modes have the same kernel, and there is "=": one sample of each pixel has the same bits by
both, and no more is rendered. The exit status is 1 where the upper end is beyond a bound, where the
means of both modes differ, or where those bits do. All scenes take half an hour on two cores; each
can be named.
"""

from __future__ import annotations

import sys
from argparse import ArgumentParser
from functools import partial
from random import Random
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from benchmarks.bench.scenes import CORNELL_BOXES
from drpt import Camera, Diffuse, Mesh, Mode, Phong, Scene, Sphere, load_scene
from drpt.error import DARK
from drpt.render import Rendering
from drpt.scene.builtin import builtin_names
from tests.random_scenes import tame_scene

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from drpt.scene import Shape

    Floats = NDArray[np.float64]

SIDE, SPP, SEEDS = 32, 16, 32
"""Pixels along a side of a picture, samples of each, and pictures of each mode."""
BOX_SIDE = 64
"""Pixels of the boxes: the small lamp is smaller than a pixel of fewer, whose noise, the same in
all modes, is two thirds of the error then."""
REFERENCE_SPP, REFERENCES = 64, 32
REFERENCE_SEED = 2**20
BOUNCES = (1, 2, 3, 4, 8, 16, 32, 64, 128)
RANDOM_SCENES = 20
RESAMPLES = 2000
COVERED = (0.025, 0.975)
BOUND, BOX_BOUNDS = 1.1, {2: 0.5, 3: 0.5, 4: 0.5, 8: 0.5, 32: 0.6}
GREATEST_Z = 4.5
"""Largest |z| of a difference of means: chance exceeds it in one of 500 tables of 300 cells."""


class Ratio(NamedTuple):
    """RelMSE of ``guided`` over that of ``mis``, its interval, and z of the means' difference."""

    value: float
    low: float
    high: float
    z: float

    def __str__(self) -> str:
        same = self == SAME
        return "=" if same else f"{self.value:.2f} [{self.low:.2f}, {self.high:.2f}] {self.z:+.1f}"


SAME = Ratio(1, 1, 1, 0)


def main() -> int:
    """Print the table; return 1 if a bound is exceeded."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", help="names; all by default")
    parser.add_argument("--bounces", nargs="+", type=int, default=BOUNCES)
    args = parser.parse_args()
    scenes = make_scenes()
    print(f"| scene | {' | '.join(map(str, args.bounces))} |\n|---|{'---|' * len(args.bounces)}")
    failed = []
    for name in args.scenes or scenes:
        ratios = [measure(scenes[name](), bounces) for bounces in args.bounces]
        print(f"| {name} | {' | '.join(map(str, ratios))} |", flush=True)
        found = zip(args.bounces, ratios, strict=True)
        failed += [f"{name}, {k} bounces: {r}" for k, r in found if is_beyond(name, k, r)]
    print("", *(f"beyond a bound: {row}" for row in failed), sep="\n")
    return 1 if failed else 0


def is_beyond(name: str, bounces: int, ratio: Ratio) -> bool:
    """Whether a ratio is larger than it may be, or the means differ."""
    bound = BOX_BOUNDS.get(bounces, BOUND) if name in CORNELL_BOXES else BOUND
    return not (ratio.high <= bound and abs(ratio.z) <= GREATEST_Z)


def measure(scene: Scene, bounces: int) -> Ratio:
    """Compare both modes, with the same seeds."""
    both = [Rendering(scene, SPP, bounces, mode) for mode in (Mode.GUIDED, Mode.MIS)]
    if not both[0].launcher.tracer.features.guiding:
        first, second = (pictures(rendering, 1, 1) for rendering in both)
        return SAME if np.array_equal(first, second, equal_nan=True) else Ratio(*4 * [np.nan])
    guided, mis = (pictures(rendering, SPP, SEEDS) for rendering in both)
    exact = Rendering(scene, REFERENCE_SPP, bounces, Mode.MIS)
    truth = pictures(exact, REFERENCE_SPP, REFERENCES, REFERENCE_SEED).mean(axis=0)
    errors = [((x - truth) ** 2 / (truth**2 + DARK)).mean(axis=(1, 2)) for x in (guided, mis)]
    chosen = np.random.default_rng(0).integers(0, SEEDS, (RESAMPLES, SEEDS))
    resampled = [error[chosen].mean(axis=1) for error in errors]
    low, high = np.quantile(resampled[0] / resampled[1], COVERED)
    difference = (guided - mis).mean(axis=(1, 2))
    z = difference.mean() / (difference.std(ddof=1) / np.sqrt(SEEDS))
    return Ratio(errors[0].mean() / errors[1].mean(), low, high, z)


def pictures(rendering: Rendering, spp: int, count: int, seed: int = 1) -> Floats:
    """Independent pictures, (count, pixels, 3)."""
    pixels = range(rendering.settings.pixels)
    sums = rendering.launcher.launch_passes(pixels, range(spp), range(count), seed).radiance
    return np.asarray(sums / spp)


def make_scenes() -> dict[str, Callable[[], Scene]]:
    """Scenes to measure, by name: built-in scenes, rooms, open scenes, and random ones."""
    scenes: dict[str, Callable[[], Scene]] = {}
    for name in (*CORNELL_BOXES, *(n for n in builtin_names() if n not in CORNELL_BOXES)):
        side = BOX_SIDE if name in CORNELL_BOXES else SIDE
        scenes[name] = partial(_builtin, name, side)
    scenes |= {f"white room, {albedo:g}": partial(room, albedo, LAMP) for albedo in ALBEDOS}
    scenes |= {
        "white room, large lamp": lambda: room(1, Sphere((0.5, 0.6, 0.6), 0.35, radiance=1)),
        "white room, panel": lambda: room(0.9, PANEL),
        "room with a mirror": lambda: room(0.8, LAMP, Sphere((0.3, 0.2, 0.6), 0.2, SHINY)),
        "room with a ball": lambda: room(0.8, PANEL, Sphere((0.3, 0.2, 0.6), 0.2, Diffuse(0.8))),
        "floor and wall": lambda: outside(SUN, WALL),
        "two lamps": lambda: outside(SUN, WALL, Sphere((-3, 1, 2), 0.2, radiance=50)),
        "mirror before a wall": lambda: outside(SUN, WALL, Sphere((1.2, 1, 1), 1, SHINY)),
        "mirror on a floor": lambda: outside(SUN, Sphere((1.2, 1, 1), 1, SHINY)),
    }
    for number in range(RANDOM_SCENES):
        scenes[f"random {number}"] = partial(_random, number)
    return scenes


def _builtin(name: str, side: int) -> Scene:
    return load_scene(name).resized(side, side)


def _random(number: int) -> Scene:
    return tame_scene(Random(number), SIDE)


ALBEDOS = (0.5, 0.9, 1)
SHINY = Phong(0.85, 1000)
LAMP = Sphere((0.5, 0.8, 0.5), 0.1, radiance=10)
SUN = Sphere((0, 3, 0), 0.5, radiance=20)


def quads(corners: Sequence[Sequence[float]], *sides: Sequence[int], **surface: object) -> Mesh:
    """A mesh of quadrilaterals."""
    faces = [face for a, b, c, d in sides for face in ((a, b, c), (a, c, d))]
    return Mesh(corners, faces, **surface)  # type: ignore[arg-type]


PANEL = quads(
    [(0.35, 0.99, 0.35), (0.65, 0.99, 0.35), (0.65, 0.99, 0.65), (0.35, 0.99, 0.65)],
    (0, 1, 2, 3),
    radiance=10,
)
WALL = quads(
    [(-4, 0, -4), (4, 0, -4), (4, 4, -4), (-4, 4, -4)],
    (0, 1, 2, 3),
    material=Diffuse((0.7, 0.4, 0.3)),
)
FLOOR = quads([(-4, 0, -4), (-4, 0, 4), (4, 0, 4), (4, 0, -4)], (0, 1, 2, 3), material=Diffuse(0.7))
SIX = (0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (3, 2, 6, 7), (0, 3, 7, 4), (1, 5, 6, 2)


def room(albedo: float, *shapes: Shape) -> Scene:
    """A closed cube, seen from within."""
    corners = [(x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    camera = Camera((0.5, 0.5, 0.05), (0.5, 0.45, 1), (0, 1, 0), 70, SIDE, SIDE)
    return Scene(camera, [quads(corners, *SIX, material=Diffuse(albedo)), *shapes])


def outside(*shapes: Shape) -> Scene:
    """A floor with shapes on it, under a black sky."""
    camera = Camera((0, 3, 9), (0, 0.5, 0), (0, 1, 0), 40, SIDE, SIDE)
    return Scene(camera, [FLOOR, *shapes])


if __name__ == "__main__":
    sys.exit(main())
