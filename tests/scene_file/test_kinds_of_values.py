"""What annotations hold, in words, which values fit, and what docstrings tell of parameters."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

pytest.importorskip("dolfinx")

import antiosc as ao
from antiosc.scene_file.kinds import kinds_of, words


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
