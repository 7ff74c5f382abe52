"""What is kept for the next calls."""

from __future__ import annotations

from drpt.kernel.kept import KEPT, Kept


class Made:
    """Counts what it has made."""

    def __init__(self) -> None:
        self.calls: list[tuple[int, ...]] = []

    def __call__(self, shapes: tuple[int, ...], scale: int) -> tuple[int, ...]:
        self.calls.append(shapes)
        return tuple(scale * shape for shape in shapes)


def test_equal_arguments_have_the_same_result() -> None:
    made = Made()
    kept = Kept(made)
    first = kept((1, 2), 3)
    assert first == (3, 6)
    assert kept((*range(1, 3),), 3) is first
    assert kept((1, 2), 4) == (4, 8)
    assert len(made.calls) == 2


def test_the_results_of_the_last_calls_are_kept() -> None:
    made = Made()
    kept = Kept(made)
    for _ in range(3):
        for number in range(KEPT):
            assert kept((number,), 2) == (2 * number,)
    assert len(made.calls) == KEPT
    kept((0,), 2)
    kept((KEPT,), 2)  # makes the one go that was called for longest ago
    kept((0,), 2)
    assert len(made.calls) == KEPT + 1
    kept((1,), 2)
    assert len(made.calls) == KEPT + 2


def test_nothing_is_hashed() -> None:
    class Shape:
        __hash__ = None  # type: ignore[assignment]

    shape = Shape()
    made: list[Shape] = []
    kept = Kept(made.append)
    kept(shape)
    kept(shape)
    assert made == [shape]


def test_forgets() -> None:
    made = Made()
    kept = Kept(made)
    kept((1,), 1)
    kept.forget()
    kept((1,), 1)
    assert len(made.calls) == 2
