"""Loads the backend before test modules import kernels; moves arrays to the device and back."""

from collections import Counter
from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import settings

from drpt.kernel import backend
from tests.oracle.arrays import Floats

TYPES = backend.load()
settings.register_profile("drpt", deadline=None)  # a busy machine makes no test fail
settings.load_profile("drpt")


@pytest.fixture(autouse=True)
def _forget_shapes() -> None:
    """Let no test see shapes that another one has prepared with other constants."""
    from drpt.kernel.launch import forget

    forget()


@pytest.fixture(autouse=True)
def _arithmetic_of_renders() -> Iterator[None]:
    """Let tests call parts of kernels as launches do; kernels of launches do not need that."""
    import drjit as dr

    with dr.scoped_set_flag(dr.JitFlag.FastMath, False):
        yield


def to_device(values: npt.ArrayLike) -> Any:
    """Return numbers (n,) as floats of the device, rows (n, 2) or (n, 3) as its vectors."""
    array = np.asarray(values, np.float32)
    if array.ndim == 1:
        return TYPES.Float32(array)
    vector = {2: TYPES.Array2f, 3: TYPES.Array3f}[array.shape[1]]
    return vector(*(TYPES.Float32(column) for column in np.ascontiguousarray(array.T)))


def to_host(array: Any) -> Floats:
    """Return numbers of the device as (n,), its vectors as rows (n, 2) or (n, 3)."""
    return np.ascontiguousarray(np.array(array, np.float64).T)


def unit_square(count: int, seed: int = 0) -> Any:
    """Return points of the unit square at random, of 24 bits each like those of a sampler."""
    rng = np.random.default_rng(seed)
    return to_device(rng.integers(0, 2**24, (count, 2)) * 2.0**-24)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Run the files with the most slow tests first: of two processes, none is left with the last.

    Without slow tests to run, the order stays.
    """
    slow: Counter[object] = Counter()
    for item in items:
        slow[item.path] += item.get_closest_marker("slow") is not None
    items.sort(key=lambda item: -slow[item.path])
