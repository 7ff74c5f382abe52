"""The quick part of the stress suite: the values that each case names for it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from benchmarks.stress import AREAS
from benchmarks.stress.harness import Case, row, run

CASES = [case for cases in AREAS.values() for case in cases]


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_a_case_stays_within_its_bound(case: Case) -> None:
    for point in run(case, quick=True, with_mitsuba=False):
        assert point.passed, row(point)


def test_names_are_unique() -> None:
    assert len({case.name for case in CASES}) == len(CASES)


@pytest.mark.parametrize("error", [2e-3, float("nan"), float("inf")])
def test_the_gate_sees_what_exceeds_a_bound(error: float) -> None:
    case = replace(CASES[0], error=lambda value, samples: error, bound=1e-3)
    assert not any(point.passed for point in run(case, quick=True, with_mitsuba=False))
