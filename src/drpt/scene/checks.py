"""Checks of the values that make up a scene, and the error that they raise."""

from __future__ import annotations

from numbers import Real
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias, TypeGuard

import numpy as np

from drpt.immutable import immutable
from drpt.messages import one_line, shortened

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from numpy.typing import ArrayLike, NDArray

Colour: TypeAlias = "float | Sequence[float] | NDArray[Any]"
Vector: TypeAlias = "Sequence[float] | NDArray[Any]"
RGB = tuple[float, float, float]
Point = tuple[float, float, float]

MAX_LENGTH = 1e9
"""Largest coordinate and radius: the square of an area between two such points, about
(2e9)^4, still fits float32, in which the kernels compute."""
MIN_LENGTH = 1e-9
"""Smallest radius and smallest distance from eye to target: their squares and the squares of
their areas stay above the smallest normal float32, 1.2e-38."""
MAX_RADIANCE = 1e30
"""Largest radiance; its reciprocal is the smallest apart from 0. Both leave float32 a margin of
1e8 for the factors by which a path multiplies it."""
MAX_EXPONENT = 1e8
"""Largest Phong exponent: float32 directions resolve the lobe, 1e-4 wide, to 0.1 %."""
MAX_PIXELS = 65536
"""Largest width and height of a picture."""
MAX_SHOWN = 60
"""Characters of a wrong value that an error shows."""
MAX_FIELD = 200
"""Characters of a field that an error names: keys of a file may have any length."""
MAX_SOURCE = 400
"""Likewise of the path of a file."""
MAX_PROBLEM = 390
"""Likewise of the words about it, which may quote the file."""


def plain(value: float) -> str:
    """Return `value` as people write it: 1e9, not 1e+09."""
    return f"{value:g}".replace("e+0", "e").replace("e-0", "e-").replace("e+", "e")


class SceneError(ValueError):
    """What is wrong with a scene, in one line.

    Attributes
    ----------
    problem
        The value given and what is allowed.
    field
        Where it is wrong, such as ``shapes[3].radius``; empty if that goes without saying.
    source
        The file it comes from; empty if none.
    """

    def __init__(self, problem: str, field: str = "", source: str = "") -> None:
        self.problem = problem
        self.field = field
        self.source = source
        where = shortened(source, MAX_SOURCE), shortened(field, MAX_FIELD)
        words = shortened(one_line(problem), MAX_PROBLEM)
        super().__init__(one_line(": ".join(part for part in (*where, words) if part)))

    def within(self, parent: str) -> SceneError:
        """Return the same error, seen from the field `parent` that holds this one."""
        field = f"{parent}.{self.field}" if self.field else parent
        return SceneError(self.problem, field, self.source)

    def in_file(self, source: str) -> SceneError:
        """Return the same error, with the file that holds the field."""
        return SceneError(self.problem, self.field, source)


class Allowed(NamedTuple):
    """A set of numbers: a predicate, and the same in words."""

    test: Callable[[float], bool]
    words: str


def _span(least: float, most: float) -> str:
    return f"from {plain(least)} to {plain(most)}"


COORDINATE = Allowed(lambda x: abs(x) <= MAX_LENGTH, _span(-MAX_LENGTH, MAX_LENGTH))
RADIUS = Allowed(lambda x: MIN_LENGTH <= x <= MAX_LENGTH, f"> 0 ({_span(MIN_LENGTH, MAX_LENGTH)})")
FOV = Allowed(lambda x: 0 < x < 180, "of degrees > 0 and < 180")
ALBEDO = Allowed(lambda x: 0 <= x <= 1, _span(0, 1))
EXPONENT = Allowed(lambda x: 0 <= x <= MAX_EXPONENT, _span(0, MAX_EXPONENT))
RADIANCE = Allowed(
    lambda x: x == 0 or 1 / MAX_RADIANCE <= x <= MAX_RADIANCE,
    f">= 0 (0, or {_span(1 / MAX_RADIANCE, MAX_RADIANCE)})",
)


def refuse(field: str, value: object, allowed: str) -> SceneError:
    """Return the error that names a value which is not allowed, and what is."""
    return _refuse_text(field, show(value), allowed)


def items(value: object) -> list[Any]:
    """Return the items of a list, a tuple or an array; none of anything else."""
    if isinstance(value, list | tuple) or (isinstance(value, np.ndarray) and value.ndim):
        return list(value)
    return []


def show(value: object) -> str:
    """Return `value` as one short line."""
    item = value.item() if isinstance(value, np.generic) else value
    try:
        text = one_line(repr(item))
    except ValueError:  # Python refuses to print integers of thousands of digits
        text = f"this {type(item).__name__}"
    return text if len(text) <= MAX_SHOWN else f"{text[: MAX_SHOWN - 3]}..."


def number(field: str, value: object, allowed: Allowed) -> float:
    """Return `value` as a float, if it is a number in `allowed`."""
    value = _scalar(value)
    if not _is_real(value) or not allowed.test(value):
        raise refuse(field, value, f"a number {allowed.words}")
    return float(value)


def colour(field: str, value: object, allowed: Allowed) -> RGB:
    """Return `value` as red, green and blue in `allowed`; one number stands for grey."""
    value = _scalar(value)
    channels = (value, value, value) if _is_real(value) else _three(value)
    if channels is None or not all(map(allowed.test, channels)):
        raise refuse(field, value, f"a number {allowed.words}, or three such (red, green, blue)")
    return _floats(channels)


def point(field: str, value: object) -> Point:
    """Return `value` as three coordinates."""
    coordinates = _three(value)
    if coordinates is None or not all(map(COORDINATE.test, coordinates)):
        raise refuse(field, value, f"three numbers {COORDINATE.words}")
    return _floats(coordinates)


def pixels(field: str, value: object) -> int:
    """Return `value` as the width or height of a picture."""
    if (
        not isinstance(value, int | np.integer)
        or isinstance(value, bool)
        or not 1 <= value <= MAX_PIXELS
    ):
        raise refuse(field, value, f"a whole number from 1 to {MAX_PIXELS}")
    return int(value)


def vectors(field: str, value: ArrayLike) -> NDArray[np.float64]:
    """Return `value` as an immutable float64 array of shape (n, 3), n > 0, all finite."""
    rows = _rows(field, value, "fiu", "numbers")
    array = immutable(rows.astype(np.float64, order="C", copy=False))
    _refuse_first_bad_row(field, array, np.abs(array) <= MAX_LENGTH, f"numbers {COORDINATE.words}")
    return array


def indices(field: str, value: ArrayLike, count: int) -> NDArray[np.int32]:
    """Return `value` as an immutable int32 array of shape (m, 3), m > 0, in [0, count)."""
    array = _rows(field, value, "iu", "whole numbers")
    inside = (array >= 0) & (array < count)
    _refuse_first_bad_row(field, array, inside, f"vertex indices from 0 to {count - 1}")
    return immutable(array.astype(np.int32, order="C", copy=False))


def _scalar(value: object) -> object:
    """Return the item of an array without dimensions, and anything else as it is."""
    return value.item() if isinstance(value, np.ndarray) and value.ndim == 0 else value


def _is_real(value: object) -> TypeGuard[float]:
    return isinstance(value, Real) and not isinstance(value, bool)


def _three(value: object) -> list[float] | None:
    """Return the items of `value` if they are three numbers."""
    channels = items(value)
    return channels if len(channels) == 3 and all(map(_is_real, channels)) else None


def _floats(items: Iterable[float]) -> tuple[float, float, float]:
    x, y, z = map(float, items)
    return x, y, z


def _rows(field: str, value: ArrayLike, kinds: str, words: str) -> NDArray[Any]:
    """Return `value` as an array of shape (n, 3), n > 0, with one of the dtype `kinds`."""
    allowed = f"rows of three {words}"
    try:
        array = np.asarray(value)
    except (ValueError, TypeError):
        raise _refuse_text(field, "a ragged array", allowed) from None
    if array.size == 0:
        raise _refuse_text(field, "an empty array", f"one row of three {words} at least")
    if array.ndim != 2 or array.shape[1] != 3:
        raise _refuse_text(field, f"an array of shape {array.shape}", f"{allowed}, shape (n, 3)")
    if array.dtype.kind not in kinds:
        raise _refuse_text(field, f"an array of type {array.dtype}", allowed)
    if array is not value and _has_bool(value):
        raise _refuse_text(field, "an array with truth values", allowed)
    return array


def _has_bool(value: ArrayLike) -> bool:
    """Whether there is a truth value among numbers, of which NumPy makes a number."""
    return any(isinstance(item, bool | np.bool_) for item in np.asarray(value, object).flat)


def _refuse_first_bad_row(
    field: str, array: NDArray[Any], good: NDArray[np.bool_], allowed: str
) -> None:
    bad_rows = np.flatnonzero(~good.all(axis=1))
    if bad_rows.size:
        row = int(bad_rows[0])
        raise refuse(f"{field}[{row}]", tuple(array[row].tolist()), f"three {allowed}")


def _refuse_text(field: str, text: str, allowed: str) -> SceneError:
    return SceneError(f"{text} is not allowed; it must be {allowed}", field)
