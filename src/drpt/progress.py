"""A bar while a render runs, on a terminal or in a notebook."""

from __future__ import annotations

from time import perf_counter
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Generator

    from rich.console import Console as _Console

    from drpt.render import Rendering

GROWTH = 1.5
"""By how much samples grow until the error is estimated anew, which takes as long as some do."""


def with_bar(
    rendering: Rendering, passes: Generator[int], console: _Console | None = None
) -> Generator[int]:
    """Draw a bar while the passes run, which vanishes after the last: spp, error, speed, time.

    On stderr, if that is a terminal, or in a notebook; else there is none.
    """
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (
        BarColumn(),
        TextColumn("{task.completed:.0f}/{task.total:.0f} spp"),
        TextColumn("{task.fields[error]}"),
        TextColumn("{task.fields[speed]:.1f} Mpaths/s"),
        TimeRemainingColumn(),
    )
    settings = rendering.settings
    start, before, looked = perf_counter(), rendering.spp, 0
    console = console or Console(stderr=True)
    hidden = not (console.is_terminal or console.is_jupyter)
    with Progress(*columns, console=console, transient=True, disable=hidden) as bar:
        task = bar.add_task("", total=settings.spp, completed=before, speed=0.0, error="")
        for spp in passes:
            seconds = perf_counter() - start
            speed = settings.pixels * (spp - before) / seconds / 1e6
            bar.update(task, completed=spp, speed=speed)
            if not hidden and spp >= GROWTH * looked:
                looked, result = spp, rendering.result()
                error = result.error
                total = rendering.expected_spp(seconds / (spp - before), result.error_bound)
                bar.update(task, error=f"relMSE {error:.1e}", total=total)
            yield spp
