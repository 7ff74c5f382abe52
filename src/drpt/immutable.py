"""Arrays that cannot be written to, and dataclasses whose arrays are always such.

NumPy's flag ``writeable`` is no protection: it can be set again on an array that owns its memory,
and it is set on copies and on unpickled arrays. So the memory here is that of a `bytes` object. The
object has a class of its own, as NumPy unpickles arrays into plain `bytes` and allows writing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

_Array = TypeVar("_Array", bound=np.ndarray[Any, Any])
_Class = TypeVar("_Class")


def immutable(array: _Array) -> _Array:
    """Return an array whose values cannot change: `array` itself if it is such, else a copy."""
    if _is_immutable(array):
        return array
    return np.ndarray(array.shape, array.dtype, _Memory(array.tobytes()))  # type: ignore[return-value]


def with_own_arrays(value: Any) -> Any:
    """Return an equal object whose arrays nothing else refers to; they share the memory.

    The values of an immutable array cannot change, but its object can: NumPy allows setting its
    shape and calling ``__setstate__``. Tuples and objects of `Immutable` are copied, others not.
    """
    if isinstance(value, tuple):
        return tuple(map(with_own_arrays, value))
    if not isinstance(value, Immutable):
        return value
    twin = object.__new__(type(value))
    arrays = {n: v.view() for n, v in vars(value).items() if isinstance(v, np.ndarray)}
    set_fields(twin, **{**vars(value), **arrays})
    return twin


def same_values(one: np.ndarray[Any, Any], other: np.ndarray[Any, Any]) -> bool:
    """Whether two arrays without NaN are equal; at once if they have the same memory."""
    at_once = one.__array_interface__ == other.__array_interface__
    return at_once or np.array_equal(one, other)


class _Memory(bytes):
    """The memory of an immutable array."""


class Immutable:
    """Base of frozen dataclasses whose arrays and dictionaries are immutable.

    Copies and unpickled objects are made by calling the class with the values of the fields.
    """

    def __post_init__(self) -> None:
        for name, value in _values(self).items():
            object.__setattr__(self, name, _frozen(value))

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[type, dict[str, Any]]]:
        values = _values(self).items()
        plain = {name: dict(v) if isinstance(v, Mapping) else v for name, v in values}
        return make, (type(self), plain)


def make(kind: type[_Class], values: dict[str, Any]) -> _Class:
    """Make a dataclass from its fields; `pickle` and `copy` call this."""
    return kind(**values)


def _values(instance: Any) -> dict[str, Any]:
    return {field.name: getattr(instance, field.name) for field in fields(instance)}


def _frozen(value: Any) -> Any:
    if isinstance(value, Mapping):
        return MappingProxyType({key: _frozen(item) for key, item in value.items()})
    return immutable(value) if isinstance(value, np.ndarray) else value


def _is_immutable(array: object) -> bool:
    while isinstance(array, np.ndarray):
        array = array.base
    return isinstance(array, _Memory)


def set_fields(instance: object, **values: object) -> None:
    """Fill the fields of a frozen dataclass while it is made."""
    for name, value in values.items():
        object.__setattr__(instance, name, value)
