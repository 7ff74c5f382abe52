"""Messages are lines that every terminal prints as they are meant."""

from __future__ import annotations

import pytest

from drpt.messages import one_line, shortened, size_in_words


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("a\n\tb  c", "a b c"),
        ("\x1b[2J", "\\x1b[2J"),
        ("\u202eabc", "\\u202eabc"),
        ("k\udcfcche", "k\\udcfcche"),
        ("Küche λ", "Küche λ"),
        ("\x00\x7f", "\\x00\\x7f"),
    ],
)
def test_what_does_not_print_is_escaped(text: str, line: str) -> None:
    assert one_line(text) == line


def test_a_long_text_keeps_both_ends() -> None:
    assert shortened("abcdefghij", 10) == "abcdefghij"
    assert shortened("abcdefghijk", 10) == "abc...hijk"


@pytest.mark.parametrize(
    ("size", "words"),
    [(0, "0 bytes"), (999, "999 bytes"), (1000, "1 kB"), (2**30, "1.074 GB"), (10**22, "1e+04 EB")],
)
def test_sizes_are_told_in_units(size: int, words: str) -> None:
    assert size_in_words(size) == words
