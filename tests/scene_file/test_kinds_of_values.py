"""What annotations hold, in words, which values fit, and what docstrings tell of parameters."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

pytest.importorskip("dolfinx")

import antiosc as ao
from antiosc.scene_file.kinds import Kind, _alternatives, kinds_of, words
from antiosc.scene_file.parameters import descriptions, parameters, takes


def nothing() -> None:
    """A function whose module has the names of the annotations."""


TEXT = 'a text in "quotes"'
ANNOTATIONS = {
    "float": (float, "a number", [1, 2.5], [True, "1", [1]]),
    "int": (int, "a whole number", [1], [1.0, True]),
    "str": (str, TEXT, ["a"], [1]),
    "bool": (bool, "true or false", [True], [1]),
    "path": (Path, 'a file name in "quotes"', ["a"], [1]),
    "either": (str | os.PathLike[str], f'{TEXT} or a file name in "quotes"', ["a"], [1]),
    "optional": (float | None, "a number", [1.0], [None]),
    "choice": (Literal["x", "y"], '"x" or "y"', ["x"], ["z", 1]),
    "list": (Sequence[float], "a list of numbers", [[1, 2]], [1, "ab"]),
    "lists": (list[list[int]], "a list of lists of whole numbers", [[[1]]], [1]),
    "pair": (tuple[float, str], f"a list [number, {TEXT.removeprefix('a ')}]", [[1, "a"]], [[1]]),
    "many": (tuple[float, ...], "a list of numbers", [[1, 2, 3]], [1]),
    "table": (Mapping[str, float], "a table of numbers", [{"a": 1}], [1]),
    "array": (NDArray[np.float64], "a list of numbers or lists of numbers", [[1], [[1]]], [1]),
    "anything": (Any, "a number, a list of numbers or a text", [1, "a", [1]], [True, {}]),
    "arrays": (ArrayLike, "a number, a list of numbers or a text", [1, [1]], [True]),
    "object": (ao.Hertz, "a table { … }", [{}], [1]),
    "objects": (Sequence[ao.Support | str], "a list of tables { … } or texts", [[{}], ["a"]], [1]),
}


@pytest.mark.parametrize("case", ANNOTATIONS)
def test_annotations_in_words_and_what_fits_them(case):
    annotation, text, fitting, others = ANNOTATIONS[case]
    kinds = kinds_of(annotation, nothing)
    assert words(kinds) == text
    for value in fitting:
        assert any(kind.fits(value) for kind in kinds), value
    for value in others:
        assert not any(kind.fits(value) for kind in kinds), value


def test_what_no_file_can_hold():
    for annotation in (None, Callable[[], int], np.random.Generator):
        assert kinds_of(annotation, nothing) == ()
    assert words(kinds_of("float | Unknown | None", nothing)) == "a number"
    assert words(kinds_of("Unknown", nothing)) == "a number, a list of numbers or a text"
    assert _alternatives("A | B[C | D] | tuple[(E | F)]") == ["A", "B[C | D]", "tuple[(E | F)]"]
    assert words((Kind("number"), Kind("text"), Kind("flag"), Kind("text"))) == (
        f"a number, {TEXT} or true or false"
    )


def test_a_list_holds_its_first_entry():
    numbers, texts = Kind("list", items=(Kind("number"),)), Kind("list", items=(Kind("text"),))
    assert numbers.holds([1, "a"])
    assert not texts.holds([1, "a"])
    assert texts.holds([])
    pair = Kind("list", each=((Kind("number"),), (Kind("text"),)))
    assert pair.holds([1, 2])
    assert not pair.holds(["a", "a"])
    assert Kind("number").holds(3)


def described(first: float, second: float = 1.0, third: int = 2) -> None:
    """Does nothing.

    Text before, with a : colon.

    Parameters
    ----------
    first, other : float
        The first one of 3.5 m. A second sentence.
    second : the second, told on the line of its name in many words here
    third : int, optional
        The third
        over two lines; more

    Returns
    -------
    fourth : float
        Not a parameter.
    """


def test_the_first_sentence_of_each_parameter():
    assert descriptions(described) == {
        "first": "The first one of 3.5 m", "other": "The first one of 3.5 m",
        "second": "the second, told on the line of its name in many words here",
        "third": "The third over two lines",
    }  # fmt: skip
    assert descriptions(nothing) == {}


def test_parameters_of_public_callables():
    found = parameters("RigidMass")
    assert list(found)[:2] == ["mass", "velocity"]
    assert (found["mass"].needed, found["mass"].default) == (True, None)
    extract = parameters("extract")
    assert "shapes" not in extract
    assert takes("extract", "shapes")
    assert not takes("extract", "nothing")
    assert parameters("Structure.from_files")["map"].kinds[0].name == "path"
