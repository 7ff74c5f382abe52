"""Sphere lights of small radius / distance in drpt and in Mitsuba 3, against the closed form.

A light is overhead of a white diffuse plane, then 60° aside, at 16 distances up to 10 % apart for
each radius. The plane reflects π L sin²σ cos ω / π, sin σ = radius / distance. Prints a Markdown
table of relative errors; see ``docs/small-lights.md``.

    python -m benchmarks.small_lights [--plot docs/small-lights.png]
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from drpt import Camera, Diffuse, Mesh, Mode, Scene, Sphere, render
from drpt.crosscheck import to_mitsuba_dict
from drpt.crosscheck.domain import MIN_SINE, UNIT, VANISHING_SINE, emulated_error, light_error
from drpt.crosscheck.variant import load_mitsuba

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

SINES = (
    *(0.5, 0.3, 0.2, 0.1, 0.05, 0.03, 0.02, 0.01, 0.005, 0.003, 0.002, 0.001),
    *(5e-4, 3e-4, 2e-4, 1e-4, 1e-5),
)
"""Largest radius / distance of each row."""
ANGLES = (0, 60)
"""Of incidence, in degrees; the light is above the horizon at all of them."""
DISTANCES = 2 * (1 + 0.1 * np.arange(16) / 16)

SIDE = 64
"""Pixels, whose spread gives the standard error."""
SPP = 256
"""Samples per pixel; with many more, the float32 sums in Mitsuba's film lose digits."""
FOV = 1e-3
"""Of the camera, in degrees: all pixels see one point."""

POINT = np.array([0.31, -0.17, 0.43])
NORMAL, TANGENT, BITANGENT = np.array([[36, 48, 80], [80, -60, 0], [48, 64, -60]]) / 100
"""Receiver in a general position, and the orthonormal frame of its plane."""


@dataclass(frozen=True)
class Row:
    """Relative errors at each of `DISTANCES`, and their standard errors, by renderer."""

    sine: float
    angle: float
    errors: dict[str, Floats]
    standard_errors: dict[str, Floats]

    @property
    def sines(self) -> Floats:
        """Radius / distance at each distance."""
        return np.asarray(self.sine * DISTANCES[0] / DISTANCES)

    @property
    def predicted(self) -> Floats:
        """Mitsuba's error by its rounding alone."""
        return emulated_error(self.sine * DISTANCES[0], DISTANCES)


def main() -> None:
    """Measure, print the table, and draw the plot if asked for."""
    parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False)
    parser.add_argument("--plot", metavar="PATH", help="draw the errors, overhead, as a PNG")
    args = parser.parse_args()
    renderers = {
        "drpt explicit": in_drpt(Mode.EXPLICIT),
        "drpt mis": in_drpt(Mode.MIS),
        "Mitsuba": in_mitsuba(),
    }
    rows = [
        measure(sine, angle, renderers, seed=len(DISTANCES) * row)
        for row, (angle, sine) in enumerate(product(ANGLES, SINES))
    ]
    print_table(rows)
    if args.plot:
        plot([row for row in rows if row.angle == 0], args.plot)


def scene(sine: float, angle: float, distance: float) -> Scene:
    """Return the plane, a light of radiance 1, and a camera that sees the point below it."""
    omega = np.radians(angle)
    light = POINT + distance * (np.cos(omega) * NORMAL + np.sin(omega) * TANGENT)
    corners = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    plane = [POINT + x * TANGENT + y * BITANGENT for x, y in corners]
    camera = Camera(POINT + NORMAL + BITANGENT, POINT, NORMAL, FOV, SIDE, SIDE)
    return Scene(
        camera,
        [
            Mesh(plane, [(0, 1, 2), (0, 2, 3)], material=Diffuse(1)),
            Sphere(light, sine * distance, radiance=1),
        ],
    )


def in_drpt(mode: Mode) -> Callable[[Scene, int], Any]:
    """Return a renderer of direct light."""
    return lambda scene, seed: render(scene, SPP, bounces=1, mode=mode, seed=seed).image


def in_mitsuba() -> Callable[[Scene, int], Any]:
    """Return Mitsuba's path integrator, with its sampler of least noise here."""
    mi = load_mitsuba()

    def rendered(scene: Scene, seed: int) -> Any:
        description = to_mitsuba_dict(scene, bounces=1)
        description["sensor"]["sampler"]["type"] = "ldsampler"
        return mi.render(mi.load_dict(description), spp=SPP, seed=mi.UInt32(seed)).numpy()

    return rendered


def measure(
    sine: float, angle: float, renderers: dict[str, Callable[[Scene, int], Any]], seed: int
) -> Row:
    """Render at each distance in each renderer, with a seed for each distance."""
    errors = {name: np.empty(len(DISTANCES)) for name in renderers}
    standard_errors = {name: np.empty(len(DISTANCES)) for name in renderers}
    for i, distance in enumerate(DISTANCES):
        s = sine * DISTANCES[0] / distance
        expected = s**2 * np.cos(np.radians(angle))
        for name, renderer in renderers.items():
            pixels = (
                renderer(scene(s, angle, distance), seed + i)[..., 0].astype(np.float64) / expected
            )
            errors[name][i] = pixels.mean() - 1
            standard_errors[name][i] = pixels.std(ddof=1) / SIDE
    return Row(sine, angle, errors, standard_errors)


def print_table(rows: list[Row]) -> None:
    """Print a line of Markdown for each row."""
    print(
        "| r/d | ω | drpt explicit, mean | worst | drpt mis, mean | worst "
        "| Mitsuba: least, median, greatest | ± | predicted from its rounding | bound |\n"
        "|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|"
    )
    for row in rows:
        noise = np.median(row.standard_errors["Mitsuba"])
        cells = [
            f"{row.sine:g}",
            f"{row.angle}°",
            *averaged(row, "drpt explicit"),
            *averaged(row, "drpt mis"),
            spread(row.errors["Mitsuba"]),
            f"{noise:.0e}",
            spread(row.predicted),
            f"{light_error(row.sines).max():.1e}",
        ]
        print(f"| {' | '.join(cells)} |")


def averaged(row: Row, name: str) -> tuple[str, str]:
    """Return a renderer's mean error over the distances, and the largest, as text."""
    errors = row.errors[name]
    noise = np.sqrt((row.standard_errors[name] ** 2).sum()) / len(errors)
    return f"{errors.mean():+.1e} ± {noise:.0e}", f"{np.abs(errors).max():.1e}"


def spread(errors: Floats) -> str:
    """Return least, median and greatest as text."""
    return ", ".join(f"{x:+.1e}" for x in np.quantile(errors, [0, 0.5, 1]))


def plot(rows: list[Row], path: str) -> None:
    """Draw |relative error| against radius / distance; hollow where it may be noise."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 5), dpi=100, layout="constrained")
    axes = figure.subplots()
    axes.axvspan(MIN_SINE, 1, color="0.93", label=f"compared unreservedly: r/d ≥ {MIN_SINE}")
    sines = np.geomspace(VANISHING_SINE * 1.001, 0.5, 1000)
    axes.plot(sines, light_error(sines), color="0.3", lw=1, label="bound of Mitsuba's error")
    axes.axvline(VANISHING_SINE, color="0.3", lw=1, ls=":", label="below: black in Mitsuba")
    axes.axhline(UNIT, color="0.6", lw=1, ls="--", label="one rounding of float32, 2⁻²⁴")
    x = np.concatenate([row.sines for row in rows])
    for name, colour in (("Mitsuba", "C1"), ("drpt mis", "C2"), ("drpt explicit", "C0")):
        y = np.abs(np.concatenate([row.errors[name] for row in rows]))
        noisy = y < 3 * np.concatenate([row.standard_errors[name] for row in rows])
        axes.plot(x[~noisy], y[~noisy], ".", color=colour, ms=5, label=name)
        axes.plot(x[noisy], y[noisy], "o", color=colour, ms=3, mfc="none", mew=0.6)
    axes.plot([], [], "o", color="0.3", ms=3, mfc="none", mew=0.6, label="within 3 standard errors")
    axes.set(xscale="log", yscale="log", xlim=(7e-6, 0.6), ylim=(2e-8, 5))
    axes.set(xlabel="radius / distance", ylabel="|relative error| of reflected light")
    figure.legend(fontsize="small", loc="outside lower center", ncols=3, frameon=False)
    figure.savefig(path)


if __name__ == "__main__":
    main()
