"""A digest of the input of kernels: two machines with the same digest trace the same samples.

The host prepares a scene in float64, where the last bit may depend on the CPU. Kernels get float32,
so numbers are digested as float32.
"""

from __future__ import annotations

import hashlib
from dataclasses import fields, is_dataclass
from typing import TYPE_CHECKING, Any

import drjit as dr
import numpy as np

from drpt.kernel.mesh import TriangleMesh

if TYPE_CHECKING:
    from collections.abc import Iterator


def digest(*things: Any) -> str:
    """SHA-256, in hexadecimal, of all numbers and names in objects of the kernel package.

    A `TriangleMesh` is skipped: `Primitives` holds the corners from which it was made.
    """
    sha = hashlib.sha256()
    for thing in things:
        for part in _parts(thing):
            sha.update(part)
    return sha.hexdigest()


def _parts(thing: Any) -> Iterator[bytes]:
    """Bytes that identify an object, each part with its type and size."""
    if isinstance(thing, TriangleMesh):
        return
    if isinstance(thing, np.ndarray) or dr.is_array_v(thing):
        yield from _numbers(np.asarray(thing))
    elif isinstance(thing, float | np.floating):
        yield from _numbers(np.array(thing, np.float32))
    elif thing is None or isinstance(thing, str | int | np.integer):
        yield f"{thing!r};".encode()
    elif hasattr(thing, "__name__"):  # a class, or the module of the array types
        yield f"{thing.__name__};".encode()
    else:
        members = _members(thing)
        yield f"{type(thing).__name__} of {len(members)};".encode()
        for member in members:
            yield from _parts(member)


def _numbers(array: np.ndarray[Any, Any]) -> Iterator[bytes]:
    narrow = array.astype(np.float32) if array.dtype.kind == "f" else array
    yield f"{narrow.dtype}{narrow.shape};".encode()
    yield np.ascontiguousarray(narrow).tobytes()


def _members(thing: Any) -> list[Any]:
    """Items of a container, or fields of a dataclass, which may cache other attributes."""
    if isinstance(thing, list | tuple):
        return list(thing)
    if is_dataclass(thing):
        return [getattr(thing, field.name) for field in fields(thing)]
    return list(vars(thing).values())
