"""Attributes of files: drpt's own come back, others are left out, damaged ones are refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from drpt.output.metadata import ATTRIBUTES, from_header, to_header
from tests.output.pictures import METADATA


def test_what_is_written_is_read() -> None:
    found = from_header({**to_header(METADATA), "owner": "somebody", "drp:spp": 3})
    assert found == METADATA
    assert [type(value) for value in found.values()] == [type(v) for v in METADATA.values()]


@pytest.mark.parametrize(
    ("attribute", "value"),
    [
        ("16", 16),
        (16, 16),
        ("[[[", "[[["),
        ("{}", "{}"),
        ("null", "null"),
        ("[" * 100000, "[" * 100000),
        ("1" * 5000, "1" * 5000),
        ("-", "-"),
        ('"', '"'),
        ("1 2", "1 2"),
        ("true", True),
    ],
)
def test_an_attribute_without_a_type_may_be_any_text(attribute: Any, value: Any) -> None:
    assert from_header({"drpt:comment": attribute}) == {"comment": value}


DAMAGED: list[tuple[str, Any]] = [
    ("spp", "{}"),
    ("spp", "null"),
    ("spp", "0"),
    ("spp", "-1"),
    ("spp", "1" + "0" * 400),
    ("spp", "16.0"),
    ("spp", "true"),
    ("spp", "[" * 100000),
    ("seed", np.ones(2)),
    ("seed", "1.5"),
    ("seed", ["a"]),
    ("seconds", '"x"'),
    ("seconds", "NaN"),
    ("seconds", "-1"),
    ("seconds", "1e999"),
    ("error", "Infinity"),
    ("bounces", "many"),
    ("jitter", "1"),
    ("scene", "3"),
    ("scene", 3),
    ("comment", np.ones(2)),
    ("\x1b[31m", None),
    ("k" * 5000, "v" * 5000),
    ("comment", ["v" * 5000]),
    ("é", "1"),
    ("", "1"),
]


@pytest.mark.parametrize(("name", "attribute"), DAMAGED, ids=range(len(DAMAGED)))
def test_what_drpt_does_not_write_is_refused_by_name(name: str, attribute: Any) -> None:
    with pytest.raises(ValueError, match=r"^its .*(; it must be|has a name)") as error:
        from_header({"drpt:spp": "1", f"drpt:{name}": attribute})
    assert str(error.value).isprintable()
    assert len(str(error.value)) < 300
    if name in ATTRIBUTES:
        assert f"its {name} is " in str(error.value)
