"""What a parameter may hold, from its annotation: numbers, texts, lists, tables, objects."""

from __future__ import annotations

import collections.abc
import dataclasses
import os
import types
import typing
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

#: Name of a kind -> types of its values, in words, several of them in words, JSON schema.
_KINDS: dict[str, tuple[Any, str, str, dict[str, Any]]] = {
    "number": ((int, float), "a number", "numbers", {"type": "number"}),
    "whole": (int, "a whole number", "whole numbers", {"type": "integer"}),
    "text": (str, 'a text in "quotes"', "texts", {"type": "string"}),
    "path": (str, 'a file name in "quotes"', "file names", {"type": "string"}),
    "flag": (bool, "true or false", "true or false", {"type": "boolean"}),
    "object": (dict, "a table { … }", "tables { … }", {"type": "object"}),
    "data": (
        (int, float, str, list),
        "a number, a list of numbers or a text",
        "numbers or texts",
        {"type": ["number", "string", "array"]},
    ),
}


@dataclass(frozen=True)
class Kind:
    """One kind of value.

    Attributes
    ----------
    name : one of those above, or "choice", "list", "table".
    options : texts of a choice; of an object its class; of a table the type of its keys.
    items : kinds of the entries of a list or table.
    each : kinds of every entry of a list of fixed length, in order.
    """

    name: str
    options: tuple[Any, ...] = ()
    items: tuple[Kind, ...] = ()
    each: tuple[tuple[Kind, ...], ...] = ()

    def fits(self, value: Any) -> bool:
        """Whether a TOML value is of this kind; its entries are looked at later."""
        if self.name == "list":
            return isinstance(value, list) and (not self.each or len(value) == len(self.each))
        if self.name == "table":
            return isinstance(value, dict)
        if self.name == "choice":
            return isinstance(value, str) and value in self.options
        return isinstance(value, _KINDS[self.name][0]) and (
            self.name == "flag" or not isinstance(value, bool)
        )

    def holds(self, value: Any) -> bool:
        """Whether a value of this kind is a list whose first entry is of its kinds, or no list."""
        if self.name != "list" or not value:
            return True
        return any(kind.fits(value[0]) for kind in (self.each or (self.items,))[0])

    @property
    def text(self) -> str:
        """In words."""
        if self.name == "choice":
            return " or ".join(f'"{option}"' for option in self.options)
        if self.name == "list" and self.each:
            return f"a list [{', '.join(words(each).removeprefix('a ') for each in self.each)}]"
        if self.name in ("list", "table"):
            return f"a {self.name} of {plural(self.items)}"
        return _KINDS[self.name][1]

    @property
    def many(self) -> str:
        """Several of them, in words."""
        if self.name == "list":
            return f"lists of {plural(self.items or self.each[0])}"
        return _KINDS[self.name][2] if self.name in _KINDS else self.text

    @property
    def schema(self) -> dict[str, Any]:
        """Its JSON schema; that of an object is a table of any keys."""
        if self.name == "choice":
            return {"enum": list(self.options)}
        return dict(_KINDS[self.name][3])


NUMBER, WHOLE, TEXT, FLAG, PATH, DATA = map(
    Kind, ("number", "whole", "text", "flag", "path", "data")
)


def words(kinds: Sequence[Kind]) -> str:
    """What a parameter may hold, in words."""
    *texts, last = dict.fromkeys(kind.text for kind in kinds)
    return f"{', '.join(texts)} or {last}" if texts else last


def plural(kinds: Sequence[Kind]) -> str:
    """Several of such values, in words."""
    return " or ".join(dict.fromkeys(kind.many for kind in kinds))


class _Unknown(type):
    """The class of what stands for a name that is imported for type checkers only."""

    def __getattr__(cls, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return cls

    def __getitem__(cls, _: Any) -> Any:
        return cls


class Unknown(metaclass=_Unknown):
    """A type that no file can hold."""


class Names(dict[str, Any]):
    """Names of a module for its annotations; one that it imports for type checkers is Unknown."""

    def __missing__(self, name: str) -> Any:
        return self.get("__builtins__", {}).get(name, _TYPING.get(name, Unknown))

    def __contains__(self, name: object) -> bool:
        return True


_ABC = ("Sequence", "Mapping", "Iterable", "Callable")
_TYPING = {"Any": Any, "Literal": typing.Literal, "Path": Path, "os": os} | {
    name: getattr(collections.abc, name) for name in _ABC
}
_PLAIN: dict[Any, Kind] = {
    **{float: NUMBER, int: WHOLE, str: TEXT, bool: FLAG, Any: DATA},
    **{Path: PATH, os.PathLike: PATH, Unknown: DATA},
}
_LISTS = (collections.abc.Sequence, collections.abc.Iterable, list, tuple, set)


def kinds_of(annotation: Any) -> tuple[Kind, ...]:
    """The kinds of an annotation; () if no file can hold it."""
    return tuple(dict.fromkeys(_kinds(annotation)))


def _kinds(annotation: Any) -> list[Kind]:
    if isinstance(annotation, dataclasses.InitVar):
        return _kinds(annotation.type)
    if hasattr(annotation, "__value__"):  # a name for a type, as ArrayLike is from NumPy 2.4
        return _kinds(annotation.__value__)
    origin, arguments = typing.get_origin(annotation), typing.get_args(annotation)
    if origin in (typing.Union, types.UnionType):
        if complex in arguments:  # NumPy's ArrayLike
            return [DATA]
        return [kind for part in arguments if part is not Unknown for kind in _kinds(part)]
    if origin is typing.Literal:
        return [Kind("choice", tuple(arguments))]
    if origin is np.ndarray:
        return [Kind("list", items=(NUMBER, Kind("list", items=(NUMBER,))))]
    if origin is tuple and arguments and arguments[-1] is not ...:
        return [Kind("list", each=tuple(kinds_of(part) for part in arguments))]
    if origin in _LISTS:
        return [Kind("list", items=tuple(_kinds(arguments[0])) or (DATA,))]
    if origin in (collections.abc.Mapping, dict):
        return [Kind("table", options=(arguments[0],), items=tuple(_kinds(arguments[1])))]
    known = _PLAIN.get(origin or annotation)
    if known is None and isinstance(annotation, type) and annotation.__module__[:8] == "antiosc.":
        known = Kind("object", (annotation,))
    return [] if known is None else [known]  # None, functions, communicators
