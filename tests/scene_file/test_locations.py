"""The line of every key of a TOML text."""

from __future__ import annotations

import tomllib

import pytest

from antiosc.app.scene_file.document import Problems, SceneFileError, lines_of

TEXT = '''\
# a comment with [brackets] and = signs
title = "a # in a text, an escaped \\" quote ]"   # comment

[a.b]
x = 1
"quoted key" = [ 1,   # first
  [2, 3],
  { y = "}", z.w = \'\'\'
several
lines\'\'\'\' },
]
long = """
[not.a.table]
k = 1 \\"""
"""
after = 3
[[t]]
p = 1
[[t]]
p.q = 2
[t.inner]
r = 2020-01-01T10:00:00Z
[a]
c = {}
'''

LINES = {
    ("title",): 2,
    ("a", "b"): 4,
    ("a", "b", "x"): 5,
    ("a", "b", "quoted key"): 6,
    ("a", "b", "quoted key", 0): 6,
    ("a", "b", "quoted key", 1): 7,
    ("a", "b", "quoted key", 1, 1): 7,
    ("a", "b", "quoted key", 2): 8,
    ("a", "b", "quoted key", 2, "y"): 8,
    ("a", "b", "quoted key", 2, "z", "w"): 8,
    ("a", "b", "long"): 12,
    ("a", "b", "after"): 16,
    ("t", 0): 17,
    ("t", 0, "p"): 18,
    ("t", 1): 19,
    ("t", 1, "p", "q"): 20,
    ("t", 1, "inner", "r"): 22,
    ("a", "c"): 24,
}


def test_every_key_has_its_line():
    assert dict(zip(LINES, lines_of(TEXT, LINES), strict=True)) == LINES


def test_a_place_that_is_not_written_is_that_of_the_table_around_it():
    assert lines_of(TEXT, [("a", "b", "missing", 3), ("nothing",), ("t", 7)]) == [4, 1, 17]


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
