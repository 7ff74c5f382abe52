"""Error against time and cost against size, log–log, as PNG files."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from benchmarks.bench.error_against_time import TARGET
from benchmarks.bench.renderers import DRPT, MITSUBAS, ORACLE
from benchmarks.bench.report import figure
from benchmarks.bench.targets import best
from drpt import Mode

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from matplotlib.axes import Axes

COLUMNS = 4
PANEL = 3.1
"""Inches."""
COLOURS = dict(
    zip(Mode, ("0.75", "#8d6bb8", "#5fb3a1", "#2166ac", "#08a045", "#d95f02"), strict=True)
)
MITSUBA_COLOUR, ORACLE_COLOUR = "#d6604d", "0.2"


def style(name: str) -> dict[str, Any]:
    """Colour by renderer and mode; independent samples are dashed."""
    dashes = {"ls": "--" if name.endswith("independent") else "-", "marker": ".", "lw": 1.3}
    if name == ORACLE:
        return {"color": ORACLE_COLOUR, **dashes, "marker": "x"}
    if name in MITSUBAS:
        return {"color": MITSUBA_COLOUR, **dashes}
    mode = Mode(name.removeprefix("drpt ").partition(",")[0])
    return {"color": COLOURS[mode], **dashes}


def plot_error(error: list[dict[str, Any]], path: Path) -> None:
    """Draw relMSE against seconds, a panel for each configuration; slopes of the best."""
    from matplotlib.ticker import NullFormatter

    panels = Panels(len(error))
    for axes, found in zip(panels.axes, error, strict=True):
        for name, measured in found["renderers"].items():
            points = measured["points"]
            x, y = ([point[key] for point in points] for key in ("seconds", "rel_mse"))
            panels.draw(axes, x, y, name)
        axes.axhline(TARGET, color="0.6", lw=0.8, ls=":")
        axes.set_title(f"{found['name']}, {found['bounces']} bounces", fontsize=9)
        axes.set(xlabel="seconds", ylabel="relMSE")
        axes.xaxis.set_minor_formatter(NullFormatter())
        _tell_slopes(axes, found["renderers"])
    panels.save(path)


def plot_scaling(axes_measured: list[dict[str, Any]], path: Path) -> None:
    """Draw seconds against what grows, a panel for each axis."""
    panels = Panels(len(axes_measured))
    for axes, found in zip(panels.axes, axes_measured, strict=True):
        for name, curve in found["curves"].items():
            x, y = ([point[key] for point in curve] for key in ("value", "seconds"))
            panels.draw(axes, x, y, name)
        axes.set(xlabel=found["axis"], ylabel="seconds")
        _tick(
            axes, max(([p["value"] for p in curve] for curve in found["curves"].values()), key=len)
        )
    panels.save(path)


class Panels:
    """A sheet of log–log panels with one legend."""

    def __init__(self, count: int) -> None:
        from matplotlib.figure import Figure

        columns = min(count, COLUMNS)
        rows = -(-count // columns)
        size = PANEL * max(columns, 2), PANEL * rows + 0.8
        self.legend_columns = max(columns, 2)
        self.figure = Figure(figsize=size, dpi=110, layout="constrained")
        grid = self.figure.subplots(rows, columns, squeeze=False).ravel()
        self.axes: list[Axes] = list(grid[:count])
        for unused in grid[count:]:
            unused.set_axis_off()
        self.lines: dict[str, Any] = {}

    def draw(self, axes: Axes, x: list[float], y: list[float], name: str) -> None:
        """Draw a renderer's curve, and enter it into the legend once."""
        (self.lines[name],) = axes.loglog(x, y, **style(name))
        axes.grid(color="0.92", lw=0.6)

    def save(self, path: Path) -> None:
        """Write the sheet."""
        names = [name for name in (*DRPT, *MITSUBAS, ORACLE) if name in self.lines]
        self.figure.legend(
            [self.lines[name] for name in names],
            names,
            loc="outside lower center",
            ncols=self.legend_columns,
            fontsize=8,
            frameon=False,
        )
        self.figure.savefig(path)


def _tick(axes: Axes, values: list[int]) -> None:
    """Label up to six of the values, as 16, 4k, 1M."""
    from matplotlib.ticker import EngFormatter, NullFormatter

    axes.set_xticks(values[:: -(-len(values) // 6)])
    axes.xaxis.set_major_formatter(EngFormatter(places=0, sep=""))
    axes.xaxis.set_minor_formatter(NullFormatter())


def _tell_slopes(axes: Axes, measured: Mapping[str, Any]) -> None:
    lines = []
    for names in (DRPT, MITSUBAS):
        name, _ = best(measured, names)
        lines.append(f"{name}: slope {figure(measured[name]['slope'])}")
    place: dict[str, Any] = {"transform": axes.transAxes, "ha": "right", "va": "top"}
    axes.text(0.97, 0.97, "\n".join(lines), fontsize=6.5, color="0.3", **place)
