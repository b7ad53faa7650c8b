"""What an object is: `Brief` of results, in a few lines; `Given` of what a user makes, in one."""

from __future__ import annotations

import dataclasses
from html import escape
from typing import Any

import numpy as np

from antiosc.base.errors import AntioscError

#: Most lines of numbers of an object.
LINES = 4
#: Most characters of one value.
WIDTH = 72


class Brief:
    """Gives an object a `repr` of at most five lines, and a table in notebooks.

    `_facts` lists (name, value as text); by default the fields of the dataclass, arrays by their
    shape and range.
    """

    def _facts(self) -> list[tuple[str, str]]:
        fields = [
            (f.name, getattr(self, f.name))
            for f in dataclasses.fields(self)  # type: ignore[arg-type]
            if f.repr and not f.name.startswith("_")
        ]
        told = [(name, text) for name, value in fields if (text := short(value))]
        if len(told) <= LINES:
            return told
        rest = ", ".join(name for name, _ in told[LINES - 1 :])
        return [*told[: LINES - 1], ("and", rest)]

    def _known(self) -> list[tuple[str, str]]:
        try:
            return [(name, _cut(text)) for name, text in self._facts()]
        except (AntioscError, AttributeError):  # an object of which not everything is known
            return []

    def __repr__(self) -> str:
        facts = self._known()[:LINES]
        width = max((len(name) for name, _ in facts), default=0)
        rows = [f"  {name:<{width}}  {value}" for name, value in facts]
        return "\n".join([type(self).__name__, *rows])

    def _repr_html_(self) -> str:
        return _table(self, self._known())


class Given:
    """Gives a dataclass a `repr` of one line and a table: what differs from the defaults."""

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        if "__repr__" not in cls.__dict__ and not issubclass(cls, Brief):
            cls.__repr__ = Given.__repr__  # type: ignore[method-assign]

    def _told(self) -> list[tuple[str, str]]:
        return [
            (f.name, _given(getattr(self, f.name, None)))
            for f in dataclasses.fields(self)  # type: ignore[arg-type]
            if f.repr and not f.name.startswith("_") and not _usual(f, getattr(self, f.name, None))
        ]

    def __repr__(self) -> str:
        told = (f"{name}={value}" for name, value in self._told())
        return f"{type(self).__name__}({', '.join(told)})"

    def _repr_html_(self) -> str:
        return _table(self, self._told())


def _table(one: object, facts: list[tuple[str, str]]) -> str:
    """HTML of an object: its kind, and a row for each fact."""
    rows = "".join(
        f"<tr><th style='text-align:left'>{escape(name)}</th>"
        f"<td style='text-align:left'>{escape(value)}</td></tr>"
        for name, value in facts
    )
    return f"<b>{escape(type(one).__name__)}</b><table>{rows}</table>"


def _usual(field: dataclasses.Field[Any], value: Any) -> bool:
    """Whether a field has its default."""
    if field.default is dataclasses.MISSING:
        return field.default_factory is not dataclasses.MISSING and not np.size(value)
    plain = isinstance(value, float | int | str | tuple)
    return value is field.default or (plain and bool(value == field.default))


def _given(value: object) -> str:
    """A value of a field in one short piece."""
    if isinstance(value, float) and float(f"{value:g}") == value:
        return f"{value:g}"
    if isinstance(value, np.ndarray):
        return f"[{ranged(value)}]"
    if isinstance(value, dict):
        return "{" + ", ".join(map(str, value)) + "}"
    if isinstance(value, list | tuple):
        text = ", ".join(map(_given, value))
        return f"({text})" if len(text) <= WIDTH else f"({len(value)} entries)"
    if isinstance(value, Brief) or callable(value):
        return getattr(value, "__name__", type(value).__name__)
    text = repr(value)
    return text if len(text) <= WIDTH and "\n" not in text else type(value).__name__


def _cut(text: str) -> str:
    """A text of at most `WIDTH` characters."""
    return text if len(text) <= WIDTH else text[: WIDTH - 1] + "…"


def short(value: object) -> str:
    """A value in one short line; "" for None and what is empty."""
    if value is None or (isinstance(value, np.ndarray) and not value.size):
        return ""
    if isinstance(value, dict | list | tuple) and not value:
        return ""
    if isinstance(value, bool | str):
        return str(value)
    if isinstance(value, float | int | np.number):
        return f"{value:.6g}"
    if isinstance(value, np.ndarray):
        return ranged(value)
    if isinstance(value, dict | list | tuple):
        names = ", ".join(map(str, value)) if isinstance(value, dict) else ""
        return names or f"{len(value)} entries"
    return type(value).__name__


def ranged(values: np.ndarray[Any, Any]) -> str:
    """An array by its shape and range, or its numbers if they are few."""
    if values.dtype.kind not in "fiub":
        return f"array {values.shape}"
    if values.size <= 3 and values.ndim == 1:
        return ", ".join(f"{v:.6g}" for v in values)
    return f"{values.shape}, {np.min(values):.4g} to {np.max(values):.4g}"
