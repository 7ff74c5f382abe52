"""How often ``target_error`` stops too early where one rarely lit pixel holds half of the error.

A Markdown table: ``python -m benchmarks.stopping``; ``--seeds 40`` takes a fifth of the time. *Too
early* are renders that stop with a true relMSE above twice the target, with an interval of 95 %
(Wilson 1927, "Probable Inference, the Law of Succession, and Statistical Inference"). *Uncertain*
renders are marked so. Where the whole interval is above `ALLOWED`, the exit status is 1.
"""

from __future__ import annotations

import argparse
import sys
from itertools import product
from operator import itemgetter
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.bench.report import table
from drpt import Camera, Diffuse, Mesh, Phong, Scene, Sphere, render
from drpt.error import DARK
from drpt.render import SAMPLERS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from drpt.scene import Material, Shape

SIDE, FOV, DISTANCE = 16, 20, 10
PIXEL = 2 * np.tan(np.radians(FOV / 2)) / SIDE * DISTANCE
"""Width of a pixel at the distance of the lights that are seen."""
BOUNCES = 2
TARGETS = (1e-3, 3e-4)
SEEDS = 200
MOST_SPP = 2**15
TRUTH_SPP, TRUTH_SEED = 2**16, 10**6
ALLOWED = 0.02
"""Share of renders that may stop too early."""
NORMAL_95 = 1.96


def quad(*corners: tuple[float, float, float], material: Material) -> Mesh:
    """A plane quadrilateral."""
    return Mesh(corners, [[0, 1, 2], [0, 2, 3]], material=material)


def room(*shapes: Shape) -> Scene:
    """Shapes in a room that a lamp out of view lights; the middle of the picture is (0, 1, 0)."""
    grey = Diffuse(0.6)
    floor = quad((-4, 0, 4), (4, 0, 4), (4, 0, -4), (-4, 0, -4), material=grey)
    wall = quad((-4, 0, -4), (4, 0, -4), (4, 4, -4), (-4, 4, -4), material=grey)
    lamp = Sphere((1.5, 6, 1.5), 1, radiance=6)
    camera = Camera((0, 1, DISTANCE), (0, 1, 0), (0, 1, 0), FOV, SIDE, SIDE)
    return Scene(camera, [wall, floor, lamp, *shapes])


def edge() -> Scene:
    """A lamp, 100 of its widths away, whose edge reaches into a pixel by 0.0035 of its width."""
    return room(Sphere((0.0035 * PIXEL - 0.05, 1 + PIXEL / 2, 0), 0.05, radiance=100))


def slit() -> Scene:
    """A lamp behind two plates, with a slit of 0.0025 pixels between them."""
    x, y = PIXEL / 2, 1 + PIXEL / 2
    low, high = y - 0.45 * PIXEL, y + 0.45 * PIXEL
    plates = [
        quad((a, low, 0.3), (b, low, 0.3), (b, high, 0.3), (a, high, 0.3), material=Diffuse(0.5))
        for a, b in x + PIXEL * np.array([(-0.45, -0.00125), (0.00125, 0.45)])
    ]
    return room(*plates, Sphere((x, y, 0), 0.15 * PIXEL, radiance=200))


def far() -> Scene:
    """A lamp that covers 0.0008 of a pixel."""
    return room(Sphere((PIXEL / 2, 1 + PIXEL / 2, 0), 0.016 * PIXEL, radiance=400))


def corner() -> Scene:
    """A triangle whose corner reaches into a pixel."""
    y, x, half = 1 + PIXEL / 2, -0.8 * PIXEL, PIXEL / 2
    corners = [[0.06 * PIXEL, y, 0], [x, y + half, 0], [x, y - half, 0]]
    return room(Mesh(corners, [[0, 1, 2]], radiance=80))


def caustic() -> Scene:
    """A glossy ball that throws the light of a small lamp onto few pixels."""
    ball = Sphere((0.6, 0.35, -1), 0.35, material=Phong(0.9, 2000))
    return room(ball, Sphere((0.9, 0.12, -0.45), 0.03, radiance=300))


SCENES = {make.__name__: make for make in (edge, slit, far, corner, caustic)}


def main() -> int:
    """Print the table; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False)
    parser.add_argument("--seeds", type=int, default=SEEDS, help="default: %(default)s")
    parser.add_argument("scenes", metavar="SCENE", nargs="*", help=", ".join(SCENES))
    args = parser.parse_args()
    rows, bad = [], False
    for name in args.scenes or SCENES:
        scene = SCENES[name]()
        truth = render(scene, TRUTH_SPP, BOUNCES, seed=TRUTH_SEED).image.astype(np.float64)
        for target, sampler in product(TARGETS, SAMPLERS):
            row, early = stopped(scene, truth, target, sampler, args.seeds)
            rows.append({"scene": name, **row})
            print(rows[-1], file=sys.stderr, flush=True)
            bad |= interval(early, args.seeds)[0] > ALLOWED
    print(table({name: itemgetter(name) for name in rows[0]}, rows))
    return int(bad)


def stopped(
    scene: Scene, truth: NDArray[np.float64], target: float, sampler: str, seeds: int
) -> tuple[dict[str, Any], int]:
    """Return the table's row of a scene, and how many of its renders stopped too early."""
    results = [
        render(scene, MOST_SPP, BOUNCES, sampler=sampler, seed=seed, target_error=target)
        for seed in range(seeds)
    ]
    spp = np.array([result.spp for result in results])
    true = np.array([np.mean((r.image - truth) ** 2 / (truth**2 + DARK)) for r in results])
    early = int(((true > 2 * target) & (spp < MOST_SPP)).sum())
    low, high = interval(early, seeds)
    row = {
        "target": target,
        "sampler": sampler,
        "too early": f"{early} of {seeds}",
        "interval": f"{100 * low:.1f} to {100 * high:.1f} %",
        "spp: median, mean": f"{np.median(spp):.0f}, {spp.mean():.0f}",
        "never": int((spp == MOST_SPP).sum()),
        "true / target": f"{np.median(true) / target:.2f}",
        "uncertain": int(sum(r.error_uncertain for r in results)),
        "true > 2 error": int(sum(true > 2 * np.array([r.error for r in results]))),
    }
    return row, early


def interval(count: int, of: int) -> tuple[float, float]:
    """The shares that a count is compatible with."""
    z2, share = NORMAL_95**2, count / of
    middle = (share + z2 / (2 * of)) / (1 + z2 / of)
    half = NORMAL_95 / (1 + z2 / of) * (share * (1 - share) / of + z2 / (4 * of**2)) ** 0.5
    return max(0.0, middle - half), min(1.0, middle + half)


if __name__ == "__main__":
    sys.exit(main())
