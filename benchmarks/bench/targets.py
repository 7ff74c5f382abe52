"""What drpt sets itself, against what was measured."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from math import isnan, nan
from statistics import geometric_mean
from typing import TYPE_CHECKING, Any

from benchmarks.bench.renderers import DRPT, MITSUBAS, ORACLE, label
from benchmarks.bench.scenes import CORNELL_BOUNCES, CORNELL_BOXES
from drpt import Mode

if TYPE_CHECKING:
    from collections.abc import Mapping

    Results = Mapping[str, Any]

INDEPENDENT = label(Mode.EXPLICIT, "independent")


@dataclass(frozen=True)
class Target:
    """A figure with its bound; ``measured`` is not a number where nothing was measured."""

    what: str
    bound: float
    at_least: bool
    measured: float

    @property
    def verdict(self) -> str:
        """``ok``, ``short`` or ``not measured``."""
        if isnan(self.measured):
            return "not measured"
        reached = self.measured >= self.bound if self.at_least else self.measured <= self.bound
        return "ok" if reached else "short"


def targets(results: Results) -> list[Target]:
    """All targets, from what there is of the results."""
    speedups = cornell_speedups(results.get("error", []))
    complete = len(speedups) == len(CORNELL_BOXES) * len(CORNELL_BOUNCES)
    box, hills = (_throughput(results, of) for of in ("cornell-box", "triangles"))
    startup = {cache: _startup(results, cache) for cache in ("cold", "warm")}
    growth = results.get("growth", {})
    choice = growth.get("choice_rel_mse", nan) / growth.get("uniform_rel_mse", nan)
    return [
        Target(
            "time to relMSE 1e-3, best of Mitsuba / best of drpt, geometric mean of eight boxes",
            15,
            True,
            geometric_mean(speedups.values()) if complete else nan,
        ),
        Target(
            "the same, least of the eight", 8, True, min(speedups.values()) if complete else nan
        ),
        Target(
            "paths per second / Mitsuba's, independent samples", 12, True, _over(box, *MITSUBAS)
        ),
        Target("paths per second / the NumPy oracle's", 1000, True, _over(box, ORACLE)),
        Target("whole process / Mitsuba's, cold kernel cache", 1, False, startup["cold"]),
        Target("whole process / Mitsuba's, warm kernel cache", 1, False, startup["warm"]),
        Target(
            "paths per second / Mitsuba's, mesh of 500 k triangles",
            1,
            True,
            _over(hills, *MITSUBAS),
        ),
        Target(
            f"time per path, {growth.get('lights', '10 000')} lights / 10 lights",
            3,
            False,
            growth.get("lights_time", nan),
        ),
        Target("relMSE there / that of uniform choice", 1, False, choice),
        Target(
            "`spheres`, time with 8 bounces / 2 bounces", 2, False, growth.get("bounces_time", nan)
        ),
        Target("MiB at 1920x1080, many passes", 1024, False, _memory(results)),
    ]


def cornell_speedups(error: list[dict[str, Any]]) -> dict[tuple[str, int], float]:
    """Mitsuba's best time to the target over drpt's, of each Cornell box that was measured."""
    boxes = set(product(CORNELL_BOXES, CORNELL_BOUNCES))
    return {
        key: best(found["renderers"], MITSUBAS)[1] / best(found["renderers"], DRPT)[1]
        for found in error
        if (key := (found["name"], found["bounces"])) in boxes
    }


def best(measured: Mapping[str, Any], names: Mapping[str, Any]) -> tuple[str, float]:
    """Which of the named renderers reaches the target first, and its seconds."""
    times = {name: measured[name]["seconds_to_target"] for name in names if name in measured}
    winner = min(times, key=lambda name: times[name])
    return winner, times[winner]


def _throughput(results: Results, scene: str) -> dict[str, float]:
    rows = results.get("throughput", [])
    return {row["renderer"]: row["mpaths_per_s"] for row in rows if row["name"].endswith(scene)}


def _over(rates: Mapping[str, float], *others: str) -> float:
    """Independent paths per second of drpt over the other renderer's."""
    other = next((rates[name] for name in others if name in rates), nan)
    return rates.get(INDEPENDENT, nan) / other


def _startup(results: Results, cache: str) -> float:
    rows = results.get("startup", {}).get("processes", [])
    seconds: dict[str, float] = {
        row["program"]: row["seconds"] for row in rows if row["cache"] == cache
    }
    return seconds.get("drpt-render", nan) / seconds.get("mitsuba", nan)


def _memory(results: Results) -> float:
    rows = results.get("startup", {}).get("memory", [])
    return max((float(row["peak_mib"]) for row in rows), default=nan)
