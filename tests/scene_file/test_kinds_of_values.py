"""What annotations hold, in words, which values fit, and what docstrings tell of parameters."""

from __future__ import annotations

import inspect
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Literal

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

pytest.importorskip("dolfinx")

import antiosc as ao
from antiosc.app.scene_file.schema import FAMILIES, IMPACTORS, JOINTS, LAWS, kinds_of, words

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
    kinds = kinds_of(annotation)
    assert words(kinds) == text
    for value in fitting:
        assert any(kind.fits(value) for kind in kinds), value
    for value in others:
        assert not any(kind.fits(value) for kind in kinds), value


def test_a_name_for_a_type_holds_what_the_type_holds():
    """From NumPy 2.4 ArrayLike is such a name, of which nothing but its value tells the type."""
    for annotation in (float, list[int], ArrayLike):
        assert kinds_of(SimpleNamespace(__value__=annotation)) == kinds_of(annotation) != ()


#: Bodies that are no impactors.
BODIES = (ao.AntiOscillators, ao.LinearBody, ao.SoilCone)


def test_every_public_class_of_a_section_is_in_its_list():
    """A new material, law, impactor or joint, and each constructor of a law or an impactor."""
    public = [getattr(ao, name) for name in ao.__all__ if inspect.isclass(getattr(ao, name))]
    public = [kind for kind in public if not inspect.isabstract(kind)]
    laws = [kind for kind in public if issubclass(kind, ao.ContactLaw)]
    impactors = [kind for kind in public if callable(getattr(kind, "modal", None))]
    impactors = [kind for kind in impactors if kind not in BODIES]

    def constructors(kind: type) -> list[str]:
        names = inspect.getmembers(kind, inspect.ismethod)
        own = [n for n, method in names if method.__annotations__["return"] == kind.__name__]
        return [kind.__name__, *(f"{kind.__name__}.{n}" for n in own)]

    found = {
        FAMILIES: [kind.__name__ for kind in public if hasattr(kind, "weak_form")],
        JOINTS: [kind.__name__ for kind in public if hasattr(kind, "constraints")],
        LAWS: [name for kind in laws for name in constructors(kind)],
        IMPACTORS: [name for kind in impactors for name in constructors(kind)],
    }
    for names, kinds in found.items():
        assert set(kinds) == set(names.split()) - {"named_impactor"}
