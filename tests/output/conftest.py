"""A picture of every kind of number."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

if TYPE_CHECKING:
    from numpy.typing import NDArray


@pytest.fixture
def image() -> NDArray[np.float32]:
    """Values over the whole range of float32, and those that are not finite; h != w."""
    rng = np.random.default_rng(1)
    values = rng.standard_normal((5, 7, 3)) * 10.0 ** rng.uniform(-44, 38, (5, 7, 3))
    values[1, 2] = (np.nan, np.inf, -np.inf)
    return values.astype(np.float32)
