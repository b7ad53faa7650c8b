"""The line of every key of a TOML text."""

from __future__ import annotations

import tomllib

import pytest

from antiosc.app.scene_file.document import Problems, SceneFileError, lines_of


def test_a_text_with_the_key_of_the_lines_has_no_lines():
    text = 'y = 1\n[a]\n"\\u0000line" = 1\n'
    assert tomllib.loads(text)
    assert lines_of(text, [("a",)]) == [1]


def test_mistakes_are_told_once_in_the_order_of_the_file():
    found = Problems("s", "\n\nb = 1\n\n\n\n[a]")
    found.raise_if_any()
    for place, sentence in ((("a", "x"), "first"), (("b",), "  second\n one"), (("a",), "first")):
        found.add(place, sentence)
    with pytest.raises(SceneFileError, match=r"^s:3: second one\ns:7: first$"):
        found.raise_if_any()
