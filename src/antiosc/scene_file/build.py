"""Tables of a scene file as calls; every mistake is noted, with what the key may hold."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

from antiosc import checks
from antiosc.errors import InputError, MissingDependencyError
from antiosc.scene_file.kinds import Kind, words
from antiosc.scene_file.locations import Place
from antiosc.scene_file.parameters import (
    WITHHELD,
    Parameter,
    parameters,
    takes,
)
from antiosc.scene_file.problems import label, listed, nearest, unknown
from antiosc.scene_file.program import Call, Name
from antiosc.scene_file.read import Document
from antiosc.scene_file.sections import constructors_of
from antiosc.scene_file.trial import light, values_tried

#: The key that chooses one of several classes or constructors.
KIND = "kind"
#: Numbers that are written as texts with a unit, as "70 GPa" or "5 mm".
_WITH_UNIT = re.compile(r"\s*[-+]?[\d.]+(e[-+]?\d+)?\s*[^\d\s.][\S]*\s*", re.IGNORECASE)
#: Largest list of a scene file.
LONGEST_LIST = 200_000


class Mistake(Exception):
    """A value that cannot be taken; its sentence is noted already."""


class Builder:
    """Makes calls of the tables of one document, and notes the mistakes in them."""

    def __init__(self, document: Document) -> None:
        self.document = document
        self.problems = document.problems

    def call(
        self,
        makes: Sequence[str],
        table: Any,
        place: Place,
        *,
        given: Mapping[str, Any] | None = None,
        withheld: Sequence[str] = (),
        on: Mapping[str, tuple[str, Name]] | None = None,
    ) -> Call | None:
        """The call that a table describes, or None if it is wrong.

        Parameters
        ----------
        makes : what `kind` chooses from.
        given : arguments from other sections, as expressions.
        withheld : parameters that other sections give, or nothing.
        on : "ball.hertz" -> (class and method, the variable): methods that `kind` may name.
        """
        if not makes:  # a package is missing, which is noted already
            return None
        if not isinstance(table, dict):
            self.problems.add(
                place, f"{label(place)} must be a table of keys; got {checks.shown(table)}."
            )
            return None
        try:
            function, target = self._function(makes, table, place, on or {})
            known = {n: p for n, p in parameters(function).items() if n not in withheld}
        except MissingDependencyError as error:
            self.problems.add(place, f"{label(place)} cannot be used here: {error}")
            return None
        except Mistake:
            return None
        arguments = dict(given or {})
        sound = self._values(known, table, place, arguments, function)
        lacking = self._lacking(known, table, place, arguments)
        made = Call(f"ao.{function}", arguments, place)
        if target is not None:
            made = replace(made, function=function.split(".")[-1], on=target)
        whole = sound and not lacking and all(v is not None for v in arguments.values())
        if target is None and light(function):
            whole &= values_tried(self.problems, made, known, table, whole)
        return made if whole else None

    def _lacking(
        self,
        known: Mapping[str, Parameter],
        table: Mapping[str, Any],
        place: Place,
        arguments: Mapping[str, Any],
    ) -> list[str]:
        """Needed keys that are missing; noted, unless a key that does not exist means them."""
        missing = [n for n, p in known.items() if p.needed and n not in arguments]
        meant = {nearest(key, known) for key in table if key not in known}
        for name in missing:
            if name not in table and name not in meant:
                one = known[name]
                about = f" ({one.about})" if one.about else ""
                self.problems.add(
                    place, f"{label(place)} lacks {name!r}, {words(one.kinds)}{about}."
                )
        return missing

    def _function(
        self,
        makes: Sequence[str],
        table: Mapping[str, Any],
        place: Place,
        on: Mapping[str, tuple[str, Name]],
    ) -> tuple[str, Name | None]:
        """(the callable, the variable whose method it is)."""
        kinds = [*makes, *on]
        chosen = table.get(KIND, kinds[0] if len(kinds) == 1 else None)
        if chosen is None and {name.split(".")[0] for name in kinds} == {kinds[0]}:
            chosen = kinds[0]  # the class itself, where the others are its constructors
        if chosen is None:
            self.problems.add(place, f"{label(place)} lacks {KIND!r}, one of {listed(kinds)}.")
            raise Mistake
        if not isinstance(chosen, str) or chosen not in kinds:
            close = nearest(str(chosen), kinds)
            hint = f"; did you mean {close!r}?" if close else "."
            self.problems.add(
                (*place, KIND),
                f"{label(place)} has no {KIND} {checks.shown(chosen)}{hint} It may be "
                f"{listed(kinds)}.",
            )
            raise Mistake
        return on.get(chosen, (chosen, None))

    def _values(
        self,
        known: Mapping[str, Parameter],
        table: Mapping[str, Any],
        place: Place,
        arguments: dict[str, Any],
        function: str = "",
    ) -> bool:
        """Put the values of a table into `arguments`; whether all are sound."""
        whole = True
        for key, value in table.items():
            if key == KIND and key not in known:
                continue
            if key not in known:
                self.no_key(place, key, known, function)
                whole = False
                continue
            try:
                arguments[key] = self.value(known[key], value, (*place, key))
            except Mistake:
                whole = False
        return whole

    def no_key(
        self, place: Place, key: str, known: Mapping[str, Parameter], function: str = ""
    ) -> None:
        """Note a key that does not exist, with the nearest that does and what that holds."""
        if function and key in WITHHELD and takes(function, key):
            self.problems.add(
                (*place, key), f"{label((*place, key))} has no place in a file: {WITHHELD[key]}."
            )
            return
        close = nearest(key, known)
        hint = "."
        if close:
            one = known[close]
            about = f": {one.about}" if one.about else ""
            hint = f"; did you mean {close!r} ({words(one.kinds)}{about})?"
        there = f"It takes {listed(known)}." if known else "It takes no keys."
        where = f"{label(place)} has no key" if place else "a scene has no key or section"
        self.problems.add((*place, key), f"{where} {checks.shown(key)}{hint} {there}")

    def value(self, parameter: Parameter, value: Any, place: Place) -> Any:
        """A value as an argument; raises Mistake after noting what is wrong."""
        converted = self._converted(parameter.kinds, value, place, parameter.about)
        if parameter.check is not None and not isinstance(converted, Call):
            try:
                parameter.check(parameter.name, converted)
            except InputError as error:
                self._wrong(place, f"{label(place)}: {error}")
        return converted

    def _converted(self, kinds: Sequence[Kind], value: Any, place: Place, about: str) -> Any:
        fitting = [kind for kind in kinds if kind.fits(value)]
        for kind in [kind for kind in fitting if kind.holds(value)] or fitting:
            return self._of_kind(kind, value, place, about)
        meaning = f" ({about})" if about else ""
        hint = ""
        if isinstance(value, str) and _WITH_UNIT.fullmatch(value) and _numeric(kinds):
            hint = "; write the number alone: all numbers are in SI units, lengths in m"
        sized = [kind for kind in kinds if kind.each]
        if isinstance(value, list) and sized and len(value) != len(sized[0].each):
            hint = f"; the list has {len(value)} entries"
        choices = [option for kind in kinds if kind.name == "choice" for option in kind.options]
        if isinstance(value, str) and choices and nearest(value, choices):
            hint = f"; did you mean {nearest(value, choices)!r}?"
        self._wrong(
            place,
            f"{label(place)} must be {words(kinds)}{meaning}; got {_shown(value)}{hint}"
            + ("" if hint.endswith("?") else "."),
        )

    def _of_kind(self, kind: Kind, value: Any, place: Place, about: str) -> Any:
        if kind.name == "path":
            return self.path(value, place)
        if kind.name == "list":
            if len(value) > LONGEST_LIST:
                self._wrong(place, f"{label(place)} has more than {LONGEST_LIST} entries.")
            each = kind.each or (kind.items,) * len(value)
            pairs = enumerate(zip(each, value, strict=True))
            return tuple(self._converted(k, v, (*place, i), about) for i, (k, v) in pairs)
        if kind.name == "table":
            whole = kind.options == (int,)
            return {
                self._number(key, place) if whole else key: self._converted(
                    kind.items, each, (*place, key), about
                )
                for key, each in value.items()
            }
        if kind.name == "object":
            made = self.call(constructors_of(kind.options[0]), value, place)
            if made is None:
                raise Mistake
            return made
        if kind.name == "data":
            return self._data(value, place)
        if kind.name == "number":
            try:
                return float(value)
            except OverflowError:
                self._wrong(place, f"{label(place)} is larger than any number that can be stored.")
        return value

    def _data(self, value: Any, place: Place) -> Any:
        """Numbers, texts and lists of them, where the signature does not tell more."""
        if isinstance(value, list):
            if len(value) > LONGEST_LIST:
                self._wrong(place, f"{label(place)} has more than {LONGEST_LIST} entries.")
            return tuple(self._data(each, (*place, i)) for i, each in enumerate(value))
        if isinstance(value, int | float | str) and not isinstance(value, bool):
            return value
        return self._wrong(
            place, f"{label(place)} must hold numbers or texts; got {_shown(value)}."
        )

    def _number(self, key: str, place: Place) -> int:
        if not re.fullmatch(r"\d{1,15}", key):
            self._wrong((*place, key), f"{label(place)} has node numbers as keys; got {key!r}.")
        return int(key)

    def path(self, value: str, place: Place) -> str:
        """A file that the scene names; it must be there."""
        try:
            checks.path(label(place), value)
        except InputError as error:
            self._wrong(place, str(error))
        path = self.document.file(value)
        try:
            there = Path(path).is_file()
            other = Path(path).exists() and not there
            near = None if there else _near(Path(path))
        except (OSError, ValueError):
            there, other, near = False, False, None
        if not there:
            what = "which is no regular file" if other else "which does not exist"
            hint = f" (there is {near!r} in that folder)" if near and not other else ""
            self._wrong(
                place,
                f"{label(place)} names the file {checks.shown(value)}, {what}{hint}; paths begin at"
                " the folder of the scene file.",
            )
        return path

    def names(self, what: str, name: str, known: Sequence[str], place: Place) -> bool:
        """Note a name that refers to nothing; whether it does exist."""
        if name in known:
            return True
        self.problems.add(place, unknown(f"{label(place)}: the {what}", name, known))
        return False

    def _wrong(self, place: Place, sentence: str) -> Any:
        self.problems.add(place, sentence)
        raise Mistake


def _near(path: Path) -> str | None:
    """A file of the same folder that is named nearly so."""
    if not path.parent.is_dir():
        return None
    return nearest(path.name, [each.name for each in islice(path.parent.iterdir(), 1000)], 0.7)


def _numeric(kinds: Sequence[Kind]) -> bool:
    return any(kind.name in ("number", "whole") for kind in kinds)


def _shown(value: Any) -> str:
    """A TOML value in a message."""
    if isinstance(value, bool):
        return "true" if value else "false"
    return "a table" if isinstance(value, dict) else checks.shown(value)
