"""Mitsuba, for the tests of the cross-check."""

from typing import Any

import pytest

from drpt.crosscheck.variant import load_mitsuba


@pytest.fixture(scope="session")
def mi() -> Any:
    """Mitsuba's module, its variant set."""
    return load_mitsuba()
