"""Values as Python source, and as entries of files: none changes on the way."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from antiosc.scene_file.output import write_numbers, write_table
from antiosc.scene_file.program import Call, Evaluation, ForEach, Name, Program, Statement, source


def test_numbers_are_exact():
    rng = np.random.default_rng(7)
    drawn = rng.normal(size=300) * 10.0 ** rng.integers(-30, 30, size=300)
    for value in [*drawn.tolist(), 0.0, -0.0, 1 / 3, 7e10, 1e-3, 123456789.125, 5e-324]:
        again = eval(source(value))
        assert again == value
        assert math.copysign(1, again) == math.copysign(1, value)
    assert source(7e10) == "7e10"
    assert source(0.25) == "0.25"
    assert eval(source(math.inf)) == math.inf
    assert math.isnan(eval(source(math.nan)))


VALUES = [
    *("a", 'a "quoted" one', "it's", "back\\slash", "new\nline", "\u202e", "", True, None),
    *((1,), (), [1, "a"], tuple(range(200)), [tuple("ab")] * 30),
    {"a": (1.0, 2.0), 3: {"b": "c" * 90}},
]


@pytest.mark.parametrize("value", VALUES)
def test_values_are_the_same_again(value):
    assert eval(source(value)) == value
    assert eval(source(value, 60, 20)) == value


@pytest.mark.parametrize("count", [1, 2, 9])
@pytest.mark.parametrize("column", [0, 20])
def test_lines_have_88_columns_at_most(count, column):
    """What fits stands in one line, what is longer by one character in several."""
    room = 88 - column - 2 - 2 * (count - 1) - 2 * count
    for short in (0, 1):
        lengths = [room // count] * (count - 1)
        value = ["a" * k for k in (*lengths, room - sum(lengths) + short)]
        text = source(value, column)
        assert ("\n" in text) == bool(short)
        assert eval(text) == value
        rows = text.split("\n")
        assert rows[:1] + rows[-1:] == (["[", "]"] if short else [text, text])
        assert all(row[:5] == '    "' and row[-1] == "," for row in rows[1:-1])


def test_numbers_fill_their_lines(rng):
    value = [int(10**k) for k in rng.integers(1, 12, 200)]
    first, *rows, last = source(value, 3, 4).split("\n")
    assert (first, last) == ("[", "    ]")
    for row, after in zip(rows, [*rows[1:], None], strict=True):
        assert row[:8] == " " * 8 != row[:9]
        assert row.endswith(",")
        assert len(row) <= 88
        assert after is None or len(row) + 1 + len(after.split()[0]) > 88
    assert eval(source(value, 3, 4)) == value


def test_the_text_and_the_evaluation_of_a_program_agree():
    """Calls, methods of variables, entries, attributes, and a list made of another."""
    sphere = {"radius": 0.01, "E": 2.1e11, "nu": 0.3, "rho": 7850.0, "velocity": (1.0, 2.0)}
    law = Call("hertz", {"E": 7e10, "nu": 0.3}, (), Name("ball"))
    statements = [
        Statement("balls", Call("ao.sweep", {"*make": Name("ao.Sphere"), **sphere})),
        Statement("laws", ForEach(law, "balls")),
        Statement("named", {"first": Call("ao.Linear", {"stiffness": 1e6})}),
        Statement("k", Name("named", "first")),
    ]
    own = Evaluation(lambda call, error: error)
    for each in statements:
        own.run(each)
    found: dict = {}
    exec(Program(statements).text("two\nlines"), found)
    assert [law.stiffness for law in found["laws"]] == [
        law.stiffness for law in own.variables["laws"]
    ]
    assert len(found["laws"]) == 2
    assert found["k"].stiffness == own.variables["k"].stiffness == 1e6


def test_files_have_no_nan(tmp_path):
    content = {"a": math.nan, "b": np.array([1.0, math.inf]), "c": np.float64(math.nan), 5: (1,)}
    write_numbers(tmp_path / "n.json", content)
    read = json.loads((tmp_path / "n.json").read_text())
    assert [read[key] for key in "abc5"] == [None, [1.0, None], None, [1]]
    write_table(tmp_path / "t.csv", {"x, y": [0.1, math.nan], "n": np.array([1, 2])})
    assert (tmp_path / "t.csv").read_text() == '"x, y",n\n0.1,1\n,2\n'
