"""A scene as a program: calls to antiosc as data, and their evaluation."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from antiosc.scene_file.locations import Place


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
    """`variable = expression`."""

    variable: str
    expression: Any


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


def _item(name: str) -> str:
    """The variable of one entry of a list: "impactor" of "impactors"."""
    return name.removesuffix("s")


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
