"""Runs a target for a time, counts the outcomes, and keeps inputs that show a fault."""

from __future__ import annotations

import multiprocessing
from dataclasses import dataclass, field
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any

from benchmarks.fuzz.worker import SECONDS, Outcome, load, work

if TYPE_CHECKING:
    from collections.abc import Iterator
    from multiprocessing.connection import Connection

    from benchmarks.fuzz.branches import Branch
    from benchmarks.fuzz.target import Target

OUT = Path("out/fuzz")
"""Folder for inputs that show a fault."""
PATIENCE = 10 * SECONDS + 20
"""Seconds without an outcome, start included, after which a process is ended."""


@dataclass
class Report:
    """The findings of a run."""

    target: str
    seed: int
    inputs: int = 0
    past_parser: int = 0
    accepted: int = 0
    slowest: float = 0.0
    branches: int = 0
    taken: set[Branch] = field(default_factory=set)
    faults: dict[int, str] = field(default_factory=dict)

    def add(self, outcome: Outcome) -> None:
        """Count an outcome."""
        self.inputs += 1
        self.past_parser += outcome.past_parser
        self.accepted += outcome.accepted
        self.slowest = max(self.slowest, outcome.seconds)
        self.taken |= outcome.taken
        if outcome.fault:
            self.faults[outcome.number] = outcome.fault

    def __str__(self) -> str:
        count = max(self.inputs, 1)
        return (
            f"{self.target}, seed {self.seed}: {self.inputs} inputs, "
            f"{self.past_parser / count:.0%} past the parser, "
            f"{self.accepted / count:.0%} accepted, "
            f"{len(self.taken)} of {self.branches} branches, slowest {self.slowest:.2f} s, "
            f"{len(self.faults)} faults"
        )


def fuzz(
    name: str, seed: int, *, seconds: float = float("inf"), inputs: int | None = None
) -> Report:
    """Run a target until the time is over or all inputs were tried; faults go to `OUT`."""
    target = load(name)
    report = Report(name, seed)
    end = monotonic() + seconds
    while monotonic() < end and (inputs is None or report.inputs < inputs):
        for outcome in _outcomes(report, end):
            report.add(outcome)
            if outcome.fault:
                _keep(target, seed, outcome)
            if report.inputs == inputs:
                break
    return report


def _outcomes(report: Report, end: float) -> Iterator[Outcome]:
    """Outcomes of one process, until the time is over or it ends."""
    start = report.inputs
    context = multiprocessing.get_context("spawn")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(
        target=work, args=(sender, report.target, report.seed, start), daemon=True
    )
    process.start()
    sender.close()
    try:
        report.branches = _receive(receiver)
        while monotonic() < end:
            yield _receive(receiver)
    except (EOFError, TimeoutError) as error:
        process.join(0 if isinstance(error, TimeoutError) else None)
        fault = f"its process ends with status {process.exitcode}"
        if isinstance(error, TimeoutError):
            fault = f"there is no outcome after {PATIENCE:g} s"
        yield Outcome(report.inputs, False, False, fault, PATIENCE, set())
    finally:
        process.kill()
        process.join()


def _receive(receiver: Connection) -> Any:
    if not receiver.poll(PATIENCE):
        raise TimeoutError
    return receiver.recv()


def _keep(target: Target, seed: int, outcome: Outcome) -> None:
    OUT.mkdir(parents=True, exist_ok=True)
    path = OUT / f"{target.name}-{seed}-{outcome.number}{target.suffix}"
    path.write_bytes(target.input(seed, outcome.number))
    Path(f"{path}.txt").write_text(f"{outcome.fault}\n")
