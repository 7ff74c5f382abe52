import numpy as np
import pytest

from drpt.crosscheck.flip import has_flip, mean_flip

pytestmark = pytest.mark.skipif(not has_flip(), reason="flip-evaluator is not installed")

IMAGE = np.random.default_rng(0).random((32, 40, 3))


@pytest.mark.parametrize("value", [0.0, 1.0, 1e20])
def test_the_same_picture_has_none(value: float) -> None:
    same = np.full((8, 8, 3), value)
    assert mean_flip(same, same) == 0
    assert mean_flip(IMAGE, IMAGE) == 0


def test_it_grows_with_the_difference() -> None:
    assert 0 < mean_flip(1.05 * IMAGE, IMAGE) < mean_flip(1.5 * IMAGE, IMAGE) < 1
    assert mean_flip(np.zeros((8, 8, 3)), np.ones((8, 8, 3))) > 0.9


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_what_is_not_finite_differs(value: float) -> None:
    wrong = IMAGE.copy()
    wrong[5, 6] = value
    assert 0 < mean_flip(wrong, IMAGE) < 0.1
