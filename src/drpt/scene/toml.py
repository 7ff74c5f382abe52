"""Parses untrusted TOML in time and memory that are linear in its size.

Python's parser needs quadratic time for the parts of a dotted key, and returns tables nested deeper
than Python's recursion limit. Both are limited before it is called.
"""

from __future__ import annotations

import re
import tomllib
from typing import Any

import numpy as np

from drpt.messages import shortened
from drpt.scene.checks import SceneError

MAX_PARTS = 8
"""Parts of a dotted key; three are enough for every field of a scene."""
MAX_NESTING = 16
"""Brackets that are open at the same time; inline shapes with meshes need five."""
MAX_WORD = 1000
"""Characters of a number or of a key without quotes; Python prints integers of 4300 digits."""
MAX_PROBLEM = 200
"""Characters of the parser's message that an error shows; it may quote the file."""

_TEXTS_AND_COMMENTS = re.compile(
    r"""
    \#[^\n]*
    | \"{3} (?: [^"\\]++ | \\. | \"{1,2}(?!") )*+ (?: \"{3,5} | .* )
    | '{3}  (?: [^']++ | '{1,2}(?!') )*+          (?: '{3,5} | .* )
    | \"    (?: [^"\\\n]++ | \\[^\n] )*+          (?: \" | .* )
    | '     [^'\n]*+                              (?: ' | .* )
    """,
    re.DOTALL | re.VERBOSE,
)
"""A string or a comment. A string without an end extends to the end of the file: it is an error."""
_LONG_KEY = re.compile(rf"(?:\.[^.=,\n\[\]{{}}]*+){{{MAX_PARTS}}}")
_LONG_WORD = re.compile(rf"[\w+-]{{{MAX_WORD + 1}}}", re.ASCII)


def parse_toml(content: bytes) -> dict[str, Any]:
    """Return the table that a TOML file holds; raises `SceneError` if it is none, or too deep."""
    try:
        text = content.decode("utf-8-sig")
        _check_depth(text)
        return tomllib.loads(text)
    except UnicodeDecodeError as error:
        raise SceneError(f"it is not TOML: byte {error.start} is not UTF-8") from None
    except tomllib.TOMLDecodeError as error:
        raise SceneError(f"it is not TOML: {shortened(str(error), MAX_PROBLEM)}") from None


def _check_depth(text: str) -> None:
    """Raise `SceneError` if a key, a number or the nesting exceeds its limit."""
    bare = _TEXTS_AND_COMMENTS.sub(lambda found: "\n" * found[0].count("\n"), text)
    if key := _LONG_KEY.search(bare):
        raise _too_long(bare, key.start(), f"a key must have no more than {MAX_PARTS} parts")
    if word := _LONG_WORD.search(bare):
        problem = f"a key or a number must have no more than {MAX_WORD} characters"
        raise _too_long(bare, word.start(), problem)
    codes = np.frombuffer(bare.encode("ascii", "replace"), np.uint8)
    brackets = np.flatnonzero(np.isin(codes, list(b"[]{}")))
    steps = np.where(np.isin(codes[brackets], list(b"[{")), 1, -1)
    deep = np.cumsum(steps) > MAX_NESTING
    if deep.any():
        problem = f"arrays and tables must be nested no more than {MAX_NESTING} deep"
        raise _too_long(bare, int(brackets[deep.argmax()]), problem)


def _too_long(text: str, place: int, problem: str) -> SceneError:
    line = 1 + text.count("\n", 0, place)
    return SceneError(f"it is not TOML that drpt reads: line {line}: {problem}")
