from __future__ import annotations

import pytest

from benchmarks.fuzz.harness import fuzz

PAST_PARSER = 0.3  # least share of inputs


@pytest.mark.parametrize("name", ["meshes", pytest.param("mitsuba", marks=pytest.mark.slow)])
def test_a_short_run_finds_no_fault(name: str) -> None:
    report = fuzz(name, seed=7, inputs=60)
    assert report.faults == {}
    assert report.inputs == 60
    assert report.past_parser >= PAST_PARSER * report.inputs
    assert len(report.taken) > report.branches / 4
