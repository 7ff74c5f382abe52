"""A check must be able to fail: it finds each of these faults, and none where there is none."""

import pytest

from benchmarks.faults import checked
from tests.crosscheck.faults import FAULTS, Fault

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_the_check_finds(fault: Fault) -> None:
    assert not checked(fault, fault.size).passed


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_the_check_finds_nothing_in_place_of(fault: Fault) -> None:
    assert checked(fault, 0).passed
