"""What antiosc takes as a number, an array, a name: everything else is one InputError."""

import inspect
import re
import warnings
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

import antiosc as ao
from antiosc.base import checks

NO_NUMBER = [
    None,
    "1e9",
    True,
    np.bool_(False),
    1 + 2j,
    [1.0],
    np.ones(1),
    np.array("1"),
    np.ma.masked,
    np.datetime64(1, "s"),
    object(),
    float,
]
NOT_FINITE = [float("nan"), float("inf"), -np.inf, np.float32("nan"), 10**400, Fraction(10) ** 400]


@pytest.mark.parametrize("value", NO_NUMBER, ids=range(len(NO_NUMBER)))
def test_only_a_real_number_is_a_number(value):
    with pytest.raises(ao.InputError, match="mass"):
        checks.number("mass", value, "kg")
    with pytest.raises(ao.InputError, match=r"^n must be a whole number >= 1; got"):
        checks.whole("n", value)


@pytest.mark.parametrize("value", NOT_FINITE, ids=range(len(NOT_FINITE)))
def test_a_number_is_finite(value):
    with pytest.raises(ao.InputError, match="mass"):
        checks.number("mass", value)


@pytest.mark.parametrize("value", [1e61, -1e300, 1e-61, -5e-324, 10**61])
def test_a_number_has_the_magnitude_of_a_quantity(value):
    with pytest.raises(ao.InputError, match="0 or between 1e-60 and 1e\\+60 in magnitude"):
        checks.number("mass", value)


@pytest.mark.parametrize(
    "value",
    [2, 2.0, np.float32(2), np.int8(2), np.uint64(2), Fraction(2), np.array(2), np.array(2.0)],
)
def test_every_real_type_becomes_a_float(value):
    assert type(checks.number("x", value)) is float
    assert checks.number("x", value) == 2.0
    assert type(checks.whole("n", value)) is int
    assert checks.whole("n", value) == 2


@pytest.mark.parametrize("value", [1.5, 0, -3, 2**53 + 1, 1e300, float("nan"), float("inf")])
def test_a_whole_number_has_its_limits(value):
    with pytest.raises(ao.InputError, match=r"^n must be"):
        checks.whole("n", value)


@pytest.mark.parametrize(
    "value",
    [
        None,
        ["1", "2"],
        [1.0, None],
        [1.0, True],
        np.ones(2, dtype=bool),
        [1.0, 2j],
        np.array([1.0, 2.0], dtype=object),
        [1, 10**400],
        [[1.0], [1.0, 2.0]],
        np.ma.array([1.0, 2.0], mask=[False, True]),
        {"a": 1.0},
        (x for x in (1.0, 2.0)),
        object(),
    ],
    ids=range(13),
)
def test_an_array_holds_real_numbers(value):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(ao.InputError, match="array"):
            checks.array("m", value, (2,))


@pytest.mark.parametrize("value", [1.0, [[1.0, 2.0]], [1.0, 2.0, 3.0], np.ones((2, 1))])
def test_an_array_has_the_shape_asked(value):
    with pytest.raises(ao.InputError, match=r"^m must have shape \(2\); got"):
        checks.array("m", value, (2,))


def test_an_array_is_finite_and_of_the_magnitude_of_quantities():
    with pytest.raises(ao.InputError, match="m must be finite; 2 of its 3 entries are not"):
        checks.array("m", [1.0, np.nan, np.inf], (3,))
    with pytest.raises(ao.InputError, match="must not exceed 1e\\+60 in magnitude"):
        checks.array("m", [1.0, 1e61], (2,))
    with pytest.raises(ao.InputError, match="must be finite"):
        checks.array("m", np.array([1, np.finfo(np.longdouble).max]), (2,))


def test_names_paths_flags_choices_functions():
    for value in (None, 3, b"x", "", "a\0b", [], True):
        with pytest.raises(ao.InputError, match=r"^path must be"):
            checks.path("path", value)
    assert checks.path("path", Path("a")) == checks.path("path", "a")
    for value in (None, 1, "yes"):
        with pytest.raises(ao.InputError, match="snap"):
            checks.flag("snap", value)
    for value in ([], {}, 3, "c", np.ones(2)):
        with pytest.raises(ao.InputError, match="plane"):
            checks.choice("plane", value, (None, "a"))
    with pytest.raises(ao.InputError, match=r"^where must be a function of points; got 3"):
        checks.function("where", 3, "a function of points")
    with pytest.raises(ao.InputError, match="Structure"):
        checks.instance("part", "x", float, "a Structure")


class Rude:
    def __repr__(self):
        raise RuntimeError("no")


@pytest.mark.parametrize(
    "value",
    [Rude(), 10**5000, "x" * 10**6, list(range(10**5)), np.ones((500, 500)), "a\nb\n" * 9],
    ids=range(6),
)
def test_a_message_is_one_short_line_whatever_the_value(value):
    with pytest.raises(ao.InputError) as caught:
        checks.flag("x", value)
    assert len(str(caught.value)) < 150
    assert "\n" not in str(caught.value)


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


# -- warnings


def test_every_warning_is_an_antiosc_warning():
    assert issubclass(ao.AccuracyWarning, ao.AntioscWarning)
    source = Path(inspect.getfile(ao)).parent
    direct = [
        path.name
        for path in source.rglob("*.py")
        if path.name != "errors.py" and re.search(r"warnings\.warn\(|stacklevel", path.read_text())
    ]
    assert direct == []


def test_simulate_warns_at_the_line_that_called_it():
    model, ball = ao.AntiOscillators(m0=1.0, k0=1e4, m=[], omega=[]), ao.RigidMass(0.1, 1.0)
    with pytest.warns(ao.AccuracyWarning, match=r"force history|contacts") as caught:
        ao.simulate(model, ball, ao.Linear(1e6), 0.5, gravity=9.81, max_contacts=1)
    assert caught[0].filename == __file__
