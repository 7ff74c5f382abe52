"""Results as Markdown tables."""

from __future__ import annotations

from math import isnan
from typing import TYPE_CHECKING, Any

from benchmarks.bench.renderers import DRPT, MITSUBAS, ORACLE
from benchmarks.bench.targets import best, targets

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    Columns = Mapping[str, Callable[[Any], object]]


def report(results: Mapping[str, Any]) -> str:
    """All tables of what was measured, the targets first."""
    parts = [summary(results)]
    for title, section, columns in SECTIONS:
        if results.get(section):
            parts.append(f"## {title}\n\n{table(columns, results[section])}")
    for found in results.get("error", []):
        rows = found["renderers"].items()
        parts.append(f"### {_configuration(found)}\n\n{table(ERROR, rows)}")
    if startup := results.get("startup"):
        parts.append(f"## Whole processes\n\n{table(PROCESSES, startup['processes'])}")
        parts.append(f"1920x1080 in drpt-render:\n\n{table(MEMORY, startup['memory'])}")
    if axes := results.get("scaling"):
        rows = [(axis["axis"], *curve) for axis in axes for curve in axis["curves"].items()]
        parts.append(f"## How cost grows\n\n{table(SCALING, rows)}")
    return "\n\n".join(parts) + "\n"


def summary(results: Mapping[str, Any]) -> str:
    """What was measured on, and each target with what was measured."""
    machine, versions = results["machine"], results["versions"]
    head = (
        f"{machine['cpu']}, {machine['cores']} cores, {machine['vector_width']} lanes, "
        f"LLVM {machine['llvm']}; {', '.join(f'{k} {v}' for k, v in versions.items())}."
    )
    if results["quick"]:
        head += " A quick run, of smaller scenes than the targets are for: no verdict counts."
    columns: Columns = {
        "what": lambda t: t.what,
        "target": lambda t: f"{'≥' if t.at_least else '≤'} {t.bound:g}",
        "measured": lambda t: t.measured,
        "verdict": lambda t: t.verdict,
    }
    return f"{head}\n\n{table(columns, targets(results))}"


def table(columns: Columns, rows: Iterable[Any]) -> str:
    """A Markdown table."""
    cells = [[figure(cell(row)) for cell in columns.values()] for row in rows]
    lines = [columns, ["---"] * len(columns), *cells]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def figure(value: object) -> str:
    """A number with three digits, "-" where there is none; all else as it is."""
    if value is None or (isinstance(value, float) and isnan(value)):
        return "-"
    if isinstance(value, float):
        return f"{value:.0f}" if abs(value) >= 1000 else f"{value:.3g}"
    return str(value)


def _configuration(row: Mapping[str, Any]) -> str:
    return f"{row['name']}, {row['bounces']} bounces"


def _best(found: Mapping[str, Any], names: Mapping[str, Any]) -> str:
    """The renderer that reaches the target first, and when."""
    name, _ = best(found["renderers"], names)
    return f"{name}: {_seconds(found['renderers'].get(name))}"


def _speedup(found: Mapping[str, Any]) -> float:
    return best(found["renderers"], MITSUBAS)[1] / best(found["renderers"], DRPT)[1]


def _seconds(measured: Mapping[str, Any] | None) -> str:
    """Seconds to the target, marked where they are extrapolated."""
    if measured is None:
        return "-"
    return ("~" if measured["extrapolated"] else "") + figure(measured["seconds_to_target"])


def _bias(point: Mapping[str, float]) -> str:
    return f"{100 * point['bias']:+.3f} ± {100 * point['bias_error']:.3f} %"


THROUGHPUT: Columns = {
    "scene": _configuration,
    "renderer": lambda row: row["renderer"],
    "spp": lambda row: row["spp"],
    "s": lambda row: row["seconds"],
    "Mpaths/s": lambda row: row["mpaths_per_s"],
    "Mrays/s": lambda row: row["mrays_per_s"],
    "times Mitsuba, in pairs": lambda row: row.get("times_mitsuba"),
}
BEST: Columns = {
    "scene": _configuration,
    "drpt's best": lambda found: _best(found, DRPT),
    "Mitsuba's best": lambda found: _best(found, MITSUBAS),
    "ratio": _speedup,
    "NumPy": lambda found: _seconds(found["renderers"].get(ORACLE)),
    "relMSE of the reference": lambda found: f"{found['reference']['rel_mse']:.1e}",
}
ERROR: Columns = {
    "renderer": lambda row: row[0],
    "spp": lambda row: row[1]["points"][-1]["spp"],
    "s": lambda row: row[1]["points"][-1]["seconds"],
    "relMSE": lambda row: f"{row[1]['points'][-1]['rel_mse']:.2e}",
    "slope": lambda row: row[1]["slope"],
    "bias of the mean": lambda row: _bias(row[1]["points"][-1]),
    "Mpaths/s": lambda row: row[1]["points"][-1]["mpaths_per_s"],
    "Mrays/s": lambda row: row[1]["points"][-1]["mrays_per_s"],
    "s to 1e-3": lambda row: _seconds(row[1]),
    "operations": lambda row: row[1]["operations"] or None,
    "compile, s": lambda row: row[1]["compile_seconds"],
    "first call, s": lambda row: row[1]["first_seconds"],
    "MiB": lambda row: row[1]["peak_mib"] or None,
}
PROCESSES: Columns = {
    "program": lambda row: row["program"],
    "kernel cache": lambda row: row["cache"],
    "s": lambda row: row["seconds"],
    "MiB": lambda row: row["peak_mib"],
}
MEMORY: Columns = {
    "spp": lambda row: row["spp"],
    "s": lambda row: row["seconds"],
    "MiB": lambda row: row["peak_mib"],
}
SCALING: Columns = {
    "axis": lambda row: row[0],
    "renderer": lambda row: row[1],
    "value: ns per path": lambda row: ", ".join(
        f"{point['value']}: {figure(point['ns_per_path'])}" for point in row[2]
    ),
}
SECTIONS = (
    ("Throughput", "throughput", THROUGHPUT),
    ("Seconds to relMSE 1e-3 (~ extrapolated)", "error", BEST),
)
