import numpy as np
import pytest

from drpt.crosscheck.colours import colour_end, signed_colours


def test_colours_pale_towards_0_and_end_where_they_are_full() -> None:
    values = np.array([[-3.0, -1.5, 0, 1.5, 3, 9, -np.inf]])
    assert signed_colours(values, 3.0)[0].tolist() == [
        [0, 0, 1],
        [0.5, 0.5, 1],
        [1, 1, 1],
        [1, 0.5, 0.5],
        [1, 0, 0],
        [1, 0, 0],
        [0, 0, 1],
    ]
    assert np.isnan(signed_colours(np.array([[np.nan]]), 3.0)).all()


def test_the_end_leaves_out_the_largest_and_what_is_no_size() -> None:
    values = np.concatenate([np.arange(1, 1001), [0, 0, np.nan, np.inf]])
    assert colour_end(values) == pytest.approx(995, abs=1)
    assert colour_end(-values) == colour_end(values)


@pytest.mark.parametrize("value", [0, np.nan, np.inf])
def test_without_a_size_the_end_is_1(value: float) -> None:
    assert colour_end(np.full((2, 2), value)) == 1
