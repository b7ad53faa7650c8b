"""A scene as a program: calls to antiosc, which are evaluated, or printed as Python.

Both read the same expressions, so that the program that is printed is the one that runs.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from antiosc.scene_file.locations import Place

#: Columns of a line of the program.
LINE_WIDTH = 88


@dataclass(frozen=True)
class Name:
    """A variable of the program, or an entry of one that is a dict."""

    name: str
    key: str | None = None


@dataclass(frozen=True)
class Call:
    """A call of a public function or constructor, or of a method of a variable.

    Attributes
    ----------
    function : "ao.Solid", "ao.Hertz.from_radii", or "hertz" of `on`.
    arguments : name -> value or expression; a name that begins with "*" is positional.
    place : of the table in the scene file.
    on : the object whose method it is.
    """

    function: str
    arguments: Mapping[str, Any]
    place: Place = ()
    on: Name | None = None


@dataclass(frozen=True)
class ForEach:
    """A list: a method called on every entry of a variable."""

    call: Call
    source: str


@dataclass(frozen=True)
class Statement:
    """`variable = expression`; `shown` is what a progress line calls it."""

    variable: str
    expression: Any


@dataclass(frozen=True)
class Program:
    """Statements in their order, and the lines that print results."""

    statements: list[Statement] = field(default_factory=list)
    #: method of a variable whose text is printed at the end, as "history.summary()"
    printed: list[str] = field(default_factory=list)

    def text(self, heading: str = "") -> str:
        """The program as Python source."""
        lines = [f"# {line}".rstrip() for line in heading.splitlines()]
        lines += ["import antiosc as ao", ""]
        for each in self.statements:
            lines.append(f"{each.variable} = {source(each.expression, len(each.variable) + 3)}")
        lines += [f"print({one})" for one in self.printed]
        return "\n".join(lines) + "\n"

    def calls(self) -> Iterator[Call]:
        """Every call of the program, inner ones first."""
        for each in self.statements:
            yield from calls_in(each.expression)


def calls_in(expression: Any) -> Iterator[Call]:
    """The calls within an expression, inner ones first."""
    if isinstance(expression, ForEach):
        yield from calls_in(expression.call)
    elif isinstance(expression, Call):
        for value in expression.arguments.values():
            yield from calls_in(value)
        yield expression
    elif isinstance(expression, Mapping):
        for value in expression.values():
            yield from calls_in(value)
    elif isinstance(expression, list | tuple):
        for value in expression:
            yield from calls_in(value)


# -- as Python source


def source(value: Any, column: int = 0, indent: int = 0) -> str:
    """Python source of a value or expression that begins at a column."""
    line = _line(value)
    if column + indent + len(line) <= LINE_WIDTH:
        return line
    inner = indent + 4
    pad, end = " " * inner, " " * indent
    if isinstance(value, ForEach):
        return line
    if isinstance(value, Call):
        opened, closed = f"{_function(value)}(", ")"
        heads = [("" if n[0] == "*" else f"{n}=", v) for n, v in value.arguments.items()]
    elif isinstance(value, Mapping):
        opened, closed = "{", "}"
        heads = [(f"{_line(k)}: ", v) for k, v in value.items()]
    elif isinstance(value, list | tuple):
        opened, closed = ("[", "]") if isinstance(value, list) else ("(", ")")
        if all(isinstance(v, int | float) for v in value):
            return opened + _wrapped([_line(v) for v in value], pad) + f"\n{end}{closed}"
        heads = [("", v) for v in value]
    else:
        return line
    if not heads:
        return line
    rows = [f"{pad}{head}{source(v, len(head) + 1, inner)}," for head, v in heads]
    return "\n".join([opened, *rows, end + closed])


def _wrapped(words: list[str], pad: str) -> str:
    """Numbers in lines as long as fit."""
    lines = [pad.rstrip("\n")]
    for word in words:
        if len(lines[-1]) + len(word) + 2 > LINE_WIDTH:
            lines.append(pad)
        lines[-1] += ("" if lines[-1] == pad else " ") + word + ","
    return "\n" + "\n".join(lines)


def _line(value: Any) -> str:
    """Source in one line."""
    if isinstance(value, Name):
        return value.name if value.key is None else f"{value.name}[{value.key!r}]"
    if isinstance(value, ForEach):
        return f"[{_line(value.call)} for {_item(value.source)} in {value.source}]"
    if isinstance(value, Call):
        given = [("" if n[0] == "*" else f"{n}=") + _line(v) for n, v in value.arguments.items()]
        return f"{_function(value)}({', '.join(given)})"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_line(k)}: {_line(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return f"[{', '.join(map(_line, value))}]"
    if isinstance(value, tuple):
        return f"({', '.join(map(_line, value))}{',' if len(value) == 1 else ''})"
    if isinstance(value, float):
        return _number(value)
    if isinstance(value, str) and '"' not in value and "\\" not in repr(value):
        return f'"{value}"'
    return repr(value)


def _number(value: float) -> str:
    """The shortest source of a float: 7e10 for 70000000000.0."""
    if not math.isfinite(value):
        return f'float("{value}")'
    mantissa, _, exponent = f"{value:.16e}".partition("e")
    short = f"{float(mantissa):g}e{int(exponent)}"
    return short if float(short) == value and len(short) < len(repr(value)) else repr(value)


def _function(call: Call) -> str:
    return call.function if call.on is None else f"{_line(call.on)}.{call.function}"


def _item(name: str) -> str:
    """The variable of one entry of a list: "impactor" of "impactors"."""
    return name.removesuffix("s")


# -- evaluated


class Evaluation:
    """Evaluates expressions; `failed` says what becomes of an exception of a call."""

    def __init__(self, failed: Any) -> None:
        import antiosc

        self.variables: dict[str, Any] = {"ao": antiosc}
        self._failed = failed

    def run(self, statement: Statement) -> Any:
        """Evaluate one statement, keep its variable and return its value."""
        value = self.variables[statement.variable] = self.value(statement.expression)
        return value

    def value(self, expression: Any) -> Any:
        """The value of an expression."""
        if isinstance(expression, Name):
            first, *rest = expression.name.split(".")
            value = self.variables[first]
            for name in rest:
                value = getattr(value, name)
            return value if expression.key is None else value[expression.key]
        if isinstance(expression, ForEach):
            return self._each(expression)
        if isinstance(expression, Call):
            return self._called(expression)
        if isinstance(expression, Mapping):
            return {key: self.value(each) for key, each in expression.items()}
        if isinstance(expression, list):
            return [self.value(each) for each in expression]
        if isinstance(expression, tuple):
            return tuple(self.value(each) for each in expression)
        return expression

    def _each(self, expression: ForEach) -> list[Any]:
        found = []
        for each in self.variables[expression.source]:
            self.variables[_item(expression.source)] = each
            found.append(self._called(expression.call))
        return found

    def _called(self, call: Call) -> Any:
        positional = [self.value(v) for n, v in call.arguments.items() if n[0] == "*"]
        named = {n: self.value(v) for n, v in call.arguments.items() if n[0] != "*"}
        target = self.value(call.on) if call.on is not None else None
        for name in call.function.split("."):
            target = self.variables[name] if target is None else getattr(target, name)
        assert callable(target)
        try:
            return target(*positional, **named)
        except Exception as error:
            raise self._failed(call, error) from error
