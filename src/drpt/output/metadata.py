"""Metadata of picture files: names, types and ranges of the attributes, read and written.

Attributes are texts. Numbers and truth values are JSON. Other texts are stored verbatim, or as JSON
if they look like one of those.
"""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any, NamedTuple

from drpt.messages import one_line, shortened

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    Metadata = Mapping[str, str | int | float]

MOST = 2**63 - 1
"""Largest count."""
MAX_SHOWN = 60
"""Characters of a name or a value that an error shows."""

_PREFIX = "drpt:"
_NAME = re.compile("[ -~]{1,64}")
"""Names that every format can store, PNG included."""
_SCALAR = re.compile(r'-?[0-9].*|true|false|NaN|-?Infinity|".*', re.DOTALL)


class Allowed(NamedTuple):
    """The allowed values of an attribute, as a predicate and in words."""

    test: Callable[[Any], bool]
    words: str


def _whole(least: int) -> Allowed:
    return Allowed(
        lambda value: _is_whole(value) and least <= value <= MOST,
        f"a whole number from {least} to 2^63 - 1",
    )


def _is_whole(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


_AMOUNT = Allowed(
    lambda value: (_is_whole(value) or isinstance(value, float)) and 0 <= value < float("inf"),
    "a number >= 0",
)
_TEXT = Allowed(lambda value: isinstance(value, str), "a text")
_SWITCH = Allowed(lambda value: isinstance(value, bool), "true or false")
_ANYTHING = Allowed(lambda value: isinstance(value, str | int | float), "a text or a number")

ATTRIBUTES = {
    **dict.fromkeys(("spp", "passes"), _whole(1)),
    **dict.fromkeys(("bounces", "rays", "non_finite"), _whole(0)),
    **dict.fromkeys(("seconds", "error"), _AMOUNT),
    **dict.fromkeys(("scene", "mode", "sampler", "renderer", "first_non_finite"), _TEXT),
    **dict.fromkeys(("jitter", "partial", "denoised"), _SWITCH),
    "seed": Allowed(
        lambda value: isinstance(value, str) or _is_whole(value),
        "a whole number, or several of a merged picture",
    ),
}
"""Allowed values of the attributes that drpt reads; others may be any text or number."""


def to_header(metadata: Metadata) -> dict[str, str]:
    """Return metadata as attributes of a file."""
    return {_PREFIX + name: _to_text(value) for name, value in metadata.items()}


def from_header(header: Mapping[str, Any]) -> dict[str, str | int | float]:
    """Return the metadata among the attributes of a file, as `to_header` got it.

    Attributes of other programs are left out. Raises `ValueError` if a value is not allowed.
    """
    return {
        name.removeprefix(_PREFIX): _value(name, attribute)
        for name, attribute in header.items()
        if name.startswith(_PREFIX)
    }


def _value(name: str, attribute: object) -> Any:
    value = _from_text(attribute) if isinstance(attribute, str) else attribute
    name = name.removeprefix(_PREFIX)
    if not _NAME.fullmatch(name):
        shown = shortened(repr(name), MAX_SHOWN)
        raise ValueError(f"its attribute {shown} has a name that drpt does not give")
    allowed = ATTRIBUTES.get(name, _ANYTHING)
    if not allowed.test(value):
        shown = shortened(repr(value), MAX_SHOWN)
        words = f"its {shortened(name, MAX_SHOWN)} is {shown}; it must be {allowed.words}"
        raise ValueError(one_line(words))
    return value


def _to_text(value: str | int | float) -> str:
    """Return a text from which `_from_text` makes an equal value of the same type."""
    plain = isinstance(value, str) and value.isascii() and _from_text(value) == value
    return str(value) if plain else json.dumps(value)


def _from_text(text: str) -> Any:
    """Return a number, a truth value or a text; lists and tables in JSON are texts as any other."""
    if not _SCALAR.fullmatch(text):
        return text
    try:
        return json.loads(text)
    except ValueError:
        return text
