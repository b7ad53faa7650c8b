"""What antiosc takes as a number, an array, a name, an argument: all else is one InputError."""

from __future__ import annotations

from fractions import Fraction
from functools import partial

import numpy as np
import pytest

import antiosc as ao
from antiosc.base import checks

NO_NUMBER = [
    *(None, "1e9", True, np.bool_(False), 1 + 2j, [1.0], np.ones(1), np.array("1")),
    *(np.ma.masked, np.datetime64(1, "s"), object(), float),
]
NOT_FINITE = [float("nan"), float("inf"), -np.inf, np.float32("nan"), 10**400, Fraction(10) ** 400]
NO_ARRAY = [
    *(None, ["1", "2"], [1.0, None], np.ones(2, dtype=bool), [1.0, 2j]),
    *(np.array([1.0, 2.0], dtype=object), [1, 10**400], [[1.0], [1.0, 2.0]], {"a": 1.0}),
    *(np.ma.array([1.0, 2.0], mask=[False, True]), (x for x in (1.0, 2.0)), object()),
]
#: (check of a value, what it refuses, a word of the sentence)
REFUSED = [
    (partial(checks.number, "mass"), [*NO_NUMBER, *NOT_FINITE], "^mass"),
    (partial(checks.number, "mass"), [1e61, -1e300, 1e-61, -5e-324, 10**61], "magnitude"),
    (partial(checks.whole, "n"), [*NO_NUMBER, 1.5, 0, 2**53 + 1, 1e300, *NOT_FINITE], "^n must be"),
    (lambda m: checks.floats("m", m, (2,)), NO_ARRAY, "array"),
    (lambda m: checks.floats("m", m, (2,)), [1.0, [[1.0, 2.0]], np.ones((2, 1))], r"shape \(2\)"),
    (lambda m: checks.floats("m", m, (2,)), [[1.0, 1e61]], "exceed"),
    (lambda m: checks.floats("m", m, (2,)), [[np.nan, np.inf]], "2 of its 2"),
    (lambda m: checks.floats("m", m, (2,)), [np.array([1, np.finfo(np.longdouble).max])], "finite"),
    (partial(checks.path, "path"), [None, 3, b"x", "", "a\0b", [], True], "^path must be"),
    (partial(checks.flag, "snap"), [None, 1, "yes"], "snap"),
    (lambda p: checks.choice("plane", p, (None, "a")), [[], {}, 3, "c", np.ones(2)], "plane"),
    (lambda f: checks.function("where", f, "a function of points"), [3], "function of points"),
    (lambda p: checks.instance("part", p, float, "a Structure"), ["x"], "Structure"),
]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("check", "values", "word"), REFUSED, ids=range(len(REFUSED)))
def test_what_is_no_value_is_refused(check, values, word):
    for value in values:
        with pytest.raises(ao.InputError, match=word):
            check(value)


@pytest.mark.parametrize(
    "value",
    [2, 2.0, np.float32(2), np.int8(2), np.uint64(2), Fraction(2), np.array(2), np.array(2.0)],
)
def test_every_real_type_becomes_a_float(value):
    assert type(checks.number("x", value)) is float
    assert checks.number("x", value) == 2.0
    assert type(checks.whole("n", value)) is int
    assert checks.whole("n", value) == 2


def test_what_leaves_double_precision_is_an_error_in_words():
    @checks.within_range
    def ratio(a, b):
        return np.float64(a) / np.float64(b)

    @checks.within_range
    def power(a):
        return a**10

    assert ratio(1, 2) == 0.5
    for bad in (lambda: ratio(1, 0), lambda: ratio(0, 0), lambda: power(1e60)):
        with pytest.raises(ao.AccuracyError, match=r"ratio|power.*differ too much for double"):
            bad()


def test_simulate_warns_at_the_line_that_called_it():
    model, ball = ao.AntiOscillators(m0=1.0, k0=1e4, m=[], omega=[]), ao.RigidMass(0.1, 1.0)
    with pytest.warns(ao.AccuracyWarning, match=r"force history|contacts") as caught:
        ao.simulate(model, ball, ao.Linear(1e6), 0.5, gravity=9.81, max_contacts=1)
    assert caught[0].filename == __file__


@pytest.mark.parametrize(
    ("text", "depth"),
    [
        ("", 0),
        ('{"a": [1, {"b": []}]}', 4),
        ('{"a": "[[[[", "b": "\\"[[["}', 1),
        ("a = 'it[[' # [[[ [\nb = [[1], [2]]", 2),
        ("]]]" + "[" * 100_000, 99_997),
    ],
    ids=["none", "nested", "quoted", "comment", "many"],
)
def test_brackets_are_counted_before_a_parser_recurses(text, depth):
    assert not checks.nests_deeper(text, depth)
    assert checks.nests_deeper(text, depth - 1)
