"""Fuzzers find nothing in a short run, get past the parsers, and see faults."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from benchmarks.fuzz import harness
from benchmarks.fuzz.__main__ import TARGETS
from benchmarks.fuzz.harness import fuzz
from benchmarks.fuzz.worker import load

if TYPE_CHECKING:
    from pathlib import Path

INPUTS = 60
"""Inputs of each target: a second or two, start included."""
PAST_PARSER = 0.3
"""Share of the inputs that the parser of the format must let through."""


@pytest.mark.parametrize("name", TARGETS)
def test_a_short_run_finds_nothing(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(harness, "OUT", tmp_path)
    report = fuzz(name, 0, inputs=INPUTS)
    assert report.faults == {}
    assert report.inputs == INPUTS
    assert report.past_parser >= PAST_PARSER * INPUTS
    assert report.taken
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", TARGETS)
def test_an_input_is_known_by_its_seed_and_its_number(name: str) -> None:
    target = load(name)
    inputs = [target.input(seed, number) for seed in (0, 1) for number in range(5)]
    assert inputs == [target.input(seed, number) for seed in (0, 1) for number in range(5)]
    assert len(set(inputs)) > 5
