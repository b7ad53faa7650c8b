"""What a parameter may hold, from its annotation: numbers, texts, lists, tables, objects."""

from __future__ import annotations

import collections.abc
import dataclasses
import inspect
import os
import types
import typing
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Kind:
    """One kind of value.

    Attributes
    ----------
    name : "number", "whole", "text", "path", "flag", "choice", "list", "table", "object", "data".
    options : texts of a choice; of an object the class or function that makes it.
    items : kinds of the entries of a list or table.
    each : kinds of every entry of a list of fixed length, in order.
    """

    name: str
    options: tuple[Any, ...] = ()
    items: tuple[Kind, ...] = ()
    each: tuple[tuple[Kind, ...], ...] = ()

    def fits(self, value: Any) -> bool:
        """Whether a TOML value is of this kind; its entries are looked at later."""
        if self.name in ("number", "whole"):
            numbers = (int,) if self.name == "whole" else (int, float)
            return isinstance(value, numbers) and not isinstance(value, bool)
        if self.name == "list":
            return isinstance(value, list) and (not self.each or len(value) == len(self.each))
        if self.name == "choice":
            return isinstance(value, str) and value in self.options
        return isinstance(value, _TYPES[self.name]) and not (
            self.name == "data" and isinstance(value, bool)
        )

    def holds(self, value: Any) -> bool:
        """Whether a value of this kind is a list whose first entry is of its kinds, or no list."""
        if self.name != "list" or not value:
            return True
        items = self.each[0] if self.each else self.items
        return any(kind.fits(value[0]) for kind in items)

    @property
    def text(self) -> str:
        """In words."""
        if self.name == "choice":
            return " or ".join(f'"{option}"' for option in self.options)
        if self.name == "list" and self.each:
            return f"a list [{', '.join(_short(kinds) for kinds in self.each)}]"
        if self.name == "list":
            return f"a list of {_plural(self.items)}"
        if self.name == "table":
            return f"a table of {_plural(self.items)}"
        return _WORDS[self.name]


_TYPES: dict[str, Any] = {
    "text": str,
    "path": str,
    "flag": bool,
    "table": dict,
    "object": dict,
    "data": (int, float, str, list),
}
_WORDS = {
    "number": "a number",
    "whole": "a whole number",
    "text": 'a text in "quotes"',
    "path": 'a file name in "quotes"',
    "flag": "true or false",
    "object": "a table { … }",
    "data": "a number, a list of numbers or a text",
}
_MANY = {
    "number": "numbers",
    "whole": "whole numbers",
    "text": "texts",
    "path": "file names",
    "object": "tables { … }",
    "data": "numbers or texts",
}
NUMBER, WHOLE, TEXT, FLAG = (Kind(name) for name in ("number", "whole", "text", "flag"))
DATA, PATH = Kind("data"), Kind("path")


def words(kinds: Sequence[Kind]) -> str:
    """What a parameter may hold, in words."""
    texts = list(dict.fromkeys(kind.text for kind in kinds))
    return texts[0] if len(texts) == 1 else f"{', '.join(texts[:-1])} or {texts[-1]}"


def _short(kinds: Sequence[Kind]) -> str:
    return words(kinds).removeprefix("a ")


def _plural(kinds: Sequence[Kind]) -> str:
    return " or ".join(dict.fromkeys(_many(kind) for kind in kinds))


def _many(kind: Kind) -> str:
    if kind.name == "list":
        return f"lists of {_plural(kind.items or kind.each[0])}"
    return _MANY.get(kind.name, kind.text)


#: What is looked up where a module imports a name for type checkers only.
_TYPING_NAMES = {
    "Any": Any,
    "Literal": typing.Literal,
    "Path": Path,
    "os": os,
    **{name: getattr(collections.abc, name) for name in ("Sequence", "Mapping", "Iterable")},
    "Callable": collections.abc.Callable,
}


def kinds_of(annotation: Any, function: Callable[..., Any]) -> tuple[Kind, ...]:
    """The kinds of an annotation of a parameter of `function`; () if no file can hold it."""
    if isinstance(annotation, str):
        annotation = _evaluated(annotation, function)
    return tuple(dict.fromkeys(_kinds(annotation)))


def _evaluated(annotation: str, function: Callable[..., Any]) -> Any:
    """An annotation of antiosc's own source, evaluated in its module; Any where that fails."""
    inner = inspect.unwrap(function)
    names = dict(_TYPING_NAMES)
    names |= vars(inspect.getmodule(inner) or object)
    alternatives = []
    for part in _alternatives(annotation):
        try:
            alternatives.append(eval(part, names))  # the text of a signature, never of a file
        except (NameError, AttributeError):  # imported for type checkers only
            alternatives.append(_Unknown)
    if alternatives == [_Unknown]:
        return Any
    return [each for each in alternatives if each is not _Unknown]


class _Unknown:
    """An alternative that no file can hold."""


def _alternatives(annotation: str) -> list[str]:
    """The parts of "A | B[C | D]" between the bars outside brackets."""
    parts, depth = [""], 0
    for sign in annotation:
        depth += (sign in "[(") - (sign in "])")
        if sign == "|" and depth == 0:
            parts.append("")
        else:
            parts[-1] += sign
    return [part.strip() for part in parts]


def _kinds(annotation: Any) -> list[Kind]:
    if isinstance(annotation, list):
        return [kind for part in annotation for kind in _kinds(part)]
    if isinstance(annotation, dataclasses.InitVar):
        return _kinds(annotation.type)
    if hasattr(annotation, "__value__"):  # a name for a type, as ArrayLike is from NumPy 2.4
        return _kinds(annotation.__value__)
    origin, arguments = typing.get_origin(annotation), typing.get_args(annotation)
    if origin in (typing.Union, types.UnionType):
        if complex in arguments:  # NumPy's ArrayLike
            return [DATA]
        return [kind for part in arguments for kind in _kinds(part)]
    if origin is typing.Literal:
        return [Kind("choice", tuple(arguments))]
    if origin is np.ndarray:
        return [Kind("list", items=(NUMBER, Kind("list", items=(NUMBER,))))]
    if origin is tuple and arguments and arguments[-1] is not ...:
        return [Kind("list", each=tuple(tuple(_kinds(part)) for part in arguments))]
    if origin in _LISTS:
        return [Kind("list", items=tuple(_kinds(arguments[0])) or (DATA,))]
    if origin in (collections.abc.Mapping, dict):
        return [Kind("table", options=(arguments[0],), items=tuple(_kinds(arguments[1])))]
    return _plain(annotation)


_LISTS = (collections.abc.Sequence, collections.abc.Iterable, list, tuple, set)
_PLAIN: dict[Any, Kind] = {
    float: NUMBER,
    int: WHOLE,
    str: TEXT,
    bool: FLAG,
    Path: PATH,
    os.PathLike: PATH,
    Any: DATA,
}


def _plain(annotation: Any) -> list[Kind]:
    known = _PLAIN.get(typing.get_origin(annotation) or annotation)
    if known is not None:
        return [known]
    if isinstance(annotation, type) and annotation.__module__.startswith("antiosc."):
        return [Kind("object", (annotation,))]
    return []  # None, functions, communicators
