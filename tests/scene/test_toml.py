"""TOML is parsed as Python does it, but in bounded depth."""

from __future__ import annotations

import tomllib
from typing import TYPE_CHECKING, Any

import pytest
import tomli_w
from hypothesis import given
from hypothesis import strategies as st

from drpt.scene import SceneError
from drpt.scene.files import load_scene
from drpt.scene.toml import MAX_NESTING, MAX_PARTS, MAX_WORD, parse_toml

if TYPE_CHECKING:
    from pathlib import Path

CHARACTERS = st.sampled_from([*"ab.[]{}=,#'\\\" \n\t01\u00e9\x1b"])
TEXTS = st.text(CHARACTERS, max_size=12)
VALUES = st.recursive(
    TEXTS | st.integers() | st.floats(allow_nan=False) | st.booleans(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(TEXTS, inner, max_size=3),
    max_leaves=6,
)


@given(st.dictionaries(TEXTS, VALUES, max_size=3), st.booleans())
def test_what_is_not_deep_is_parsed_as_by_python(table: dict[str, Any], lines: bool) -> None:
    text = tomli_w.dumps(table, multiline_strings=lines)
    assert parse_toml(text.encode()) == tomllib.loads(text)


@pytest.mark.parametrize(
    "text",
    [
        'a = "' + "." * 100 + '"',
        "a = '" + "[{" * 100 + "'",
        'a = """' + "[.\n" * 100 + '"""',
        "a = '''" + "[.\n" * 100 + "'''",
        "a = 1 # " + "[." * 100,
        'a = """x""""" # ' + "[." * 100,
        'a = """""" # ' + "[." * 100,
        'a = """\\"""" # "' + '[.""" # ' + "[." * 100,
        "a = [" + "1.5, " * 100 + "]",
        "\n".join(f"k{n}.a.b = [{{c.d = [1.5]}}]" for n in range(100)),
        ".".join("a" * MAX_PARTS) + " = 1",
        "a = " + "[" * MAX_NESTING + "]" * MAX_NESTING,
        "a" * MAX_WORD + " = 1",
        'a = "' + "x" * 5000 + '"',
    ],
)
def test_what_a_scene_may_hold_is_parsed(text: str) -> None:
    assert parse_toml(text.encode()) == tomllib.loads(text)


DEEP_KEY = ".".join("a" * (MAX_PARTS + 1))
LONG = [
    (f"{DEEP_KEY} = 1", "line 1: a key must have no more than 8 parts"),
    (f"# [\n\n[{DEEP_KEY}]", "line 3: a key"),
    (f"a = '''\n\n'''\nb = {{{DEEP_KEY} = 1}}", "line 4: a key"),
    (".".join(['"a.b"'] * (MAX_PARTS + 1)) + " = 1", "line 1: a key"),
    ("a = " + "[" * 17 + "]" * 17, "line 1: arrays and tables must be nested no more than 16 deep"),
    ("a = " + "[{b=" * 9 + "1" + "}]" * 9, "line 1: arrays"),
    ("a = [\n" * 20000, "line 17: arrays"),
    ("a = " + "9" * 5000, "line 1: a key or a number must have no more than 1000 characters"),
    ("a = 0x" + "f" * 5000, "line 1: a key or a number"),
    ("description" + ".a" * 20000 + " = 1", "line 1: a key"),
]


@pytest.mark.parametrize(("text", "problem"), LONG, ids=range(len(LONG)))
def test_what_is_deeper_is_refused_with_its_line(text: str, problem: str) -> None:
    with pytest.raises(SceneError, match=rf"^it is not TOML that drpt reads: {problem}"):
        parse_toml(text.encode())


@pytest.mark.parametrize("start", ['"""', "'''", '"', "'"])
def test_a_text_without_end_is_refused_by_the_parser(start: str) -> None:
    with pytest.raises(SceneError, match=r"it is not TOML: .*\(at "):
        parse_toml((f"a = {start}" + '\\"x' * 1000 + "[" * 100).encode())


def test_what_a_terminal_obeys_is_escaped(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_text('"\\u001b[31m\\u202e" = 1')
    with pytest.raises(SceneError) as error:
        load_scene(path)
    assert str(error.value).startswith(f"{path}: \\x1b[31m\\u202e: there is no key ")
    assert str(error.value).isprintable()


@pytest.mark.parametrize(
    "text",
    [
        f'"{"k" * 100000}" = 1',
        f"[camera]\n{'type' * 200} = 1\n[[shapes]]",
        "shapes = [{type = 'sphere', material = 'x'}]\n[camera]\neye = [0, 0, 1]\n"
        "target = [0, 0, 0]\nup = [0, 1, 0]\nfov = 1\nwidth = 1\nheight = 1\n"
        + "".join(f"[materials.m{n}]\ntype = 'diffuse'\nalbedo = 1\n" for n in range(5000)),
        f'"{"k" * 100000}" = 1\n"{"k" * 100000}" = 1',
    ],
    ids=["key", "field", "names", "parser"],
)
def test_a_message_stays_short(text: str, tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_text(text)
    with pytest.raises(SceneError) as error:
        load_scene(path)
    assert len(str(error.value)) < 1000
