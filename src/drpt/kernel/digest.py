"""A digest of what kernels get: two machines that agree on it trace the same samples.

A scene is prepared on the host in float64, where libraries may round the last bit as the CPU has
it. Kernels get 32 bits of that, so numbers count as they are in float32.
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

    Of a `TriangleMesh` there are none: the corners that it was made from stand in `Primitives`.
    """
    sha = hashlib.sha256()
    for thing in things:
        for part in _parts(thing):
            sha.update(part)
    return sha.hexdigest()


def _parts(thing: Any) -> Iterator[bytes]:
    """Bytes that tell a thing from others, each part with its kind and size."""
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
    """What a container has; of a dataclass its fields alone, as it may keep other results."""
    if isinstance(thing, list | tuple):
        return list(thing)
    if is_dataclass(thing):
        return [getattr(thing, field.name) for field in fields(thing)]
    return list(vars(thing).values())
