"""Tables of a scene file as calls; every mistake is noted, with what the key may hold."""

from __future__ import annotations

import inspect
import re
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

from antiosc.app.scene_file.kinds import NUMBER, Kind, words
from antiosc.app.scene_file.locations import Place
from antiosc.app.scene_file.parameters import (
    WITHHELD,
    Parameter,
    light,
    parameters,
    resolved,
    takes,
)
from antiosc.app.scene_file.problems import label, listed, nearest, unknown
from antiosc.app.scene_file.read import Document
from antiosc.app.scene_file.sections import KIND, SECTIONS, Section, constructors_of
from antiosc.base import checks
from antiosc.base.errors import (
    AntioscError,
    InputError,
    MissingDependencyError,
    warnings_to,
    without_warnings,
)

#: Numbers that are written as texts with a unit, as "70 GPa" or "5 mm".
_WITH_UNIT = re.compile(r"\s*[-+]?[\d.]+(e[-+]?\d+)?\s*[^\d\s.][\S]*\s*", re.IGNORECASE)
#: Largest list of a scene file.
LONGEST_LIST = 200_000
#: A sound modulus, density, length and Poisson's ratio, in place of one that is not.
STAND_IN = 0.3


class Mistake(Exception):
    """A value that cannot be taken; its sentence is noted already."""


@dataclass(frozen=True, eq=False)
class Call:
    """A call that a table of the scene file describes.

    Attributes
    ----------
    make : the public function or constructor, or a method of an object.
    arguments : name -> value, calls among them.
    place : of the table in the scene file.
    made : the object; None while it waits for the run.
    """

    make: Callable[..., Any]
    arguments: Mapping[str, Any]
    place: Place = ()
    made: Any = None

    @property
    def name(self) -> str:
        """Of what is called: "simulate", "Structure.from_files"."""
        return str(getattr(self.make, "__qualname__", ""))


def calls_in(value: Any) -> Iterator[Call]:
    """The calls within a value, inner ones first."""
    if isinstance(value, Call):
        yield from calls_in(value.arguments)
        yield value
    elif isinstance(value, Mapping | list | tuple):
        for each in value.values() if isinstance(value, Mapping) else value:
            yield from calls_in(each)


def replaced(value: Any, made: Callable[[Call], Any]) -> Any:
    """A value with what `made` returns in place of each call in it."""
    if isinstance(value, Call):
        return made(value)
    if isinstance(value, dict):
        return {key: replaced(each, made) for key, each in value.items()}
    if type(value) in (list, tuple):
        return type(value)(replaced(each, made) for each in value)
    return value


def refused(call: Call, error: Exception) -> tuple[Place, str]:
    """Where and what is wrong, of an exception of a call."""
    if not isinstance(error, AntioscError):
        error = InputError(f"{type(error).__name__}: {error}")
    name = _refused_argument(error, call.arguments)
    return (*call.place, *name), f"{label(call.place)}: {in_keys(error, call).rstrip('.')}."


def in_keys(error: Exception, call: Call) -> str:
    """An error of a call with its arguments as keys: `density=` as the key density, `piece = 1`."""
    known = "|".join(inspect.signature(call.make).parameters)
    text = re.sub(rf"\b({known})=(?=\w)", r"\1 = ", str(error))
    return re.sub(rf"\b({known})=(?!\w)", r"the key \1", text)


def _refused_argument(error: Exception, arguments: Mapping[str, Any]) -> tuple[str, ...]:
    """The argument whose check has failed; () where the error is of no check of an argument.

    Every check of `antiosc.base.checks` takes the argument's name as `name`.
    """
    for frame, _ in traceback.walk_tb(error.__traceback__):
        if frame.f_globals.get("__name__") == checks.__name__:
            name = str(frame.f_locals.get("name"))
            if name in arguments:
                return (name,)
    return ()


class Builder:
    """Makes calls of the tables of one document, and notes the mistakes in them."""

    def __init__(self, document: Document) -> None:
        self.document = document
        self.data = document.data
        self.problems = document.problems
        #: (place, sentence): notes a mistake
        self.note = document.problems.add
        #: warnings of the objects that were made
        self.told: list[str] = []

    # -- sections, each by its form: [x], [[x]], [x.NAME]

    def known_sections(
        self, data: Mapping[str, Any], known: Mapping[str, Section], place: Place = ()
    ) -> None:
        """Note sections that do not exist and sections of the wrong form."""
        forms: dict[str, tuple[type, str]] = {
            "table": (dict, "a table, [{0}]"),
            "named": (dict, "a table of names, [{0}.NAME]"),
            "list": (list, "a list of tables, [[{0}]]"),
            "text": (str, 'a text in "quotes"'),
        }
        for name, value in data.items():
            at = (*place, name)
            if name not in known:
                close = nearest(name, known)
                hint = f"; did you mean [{close}], {known[close].about}?" if close else "."
                where = f"[{label(place)}]" if place else "a scene"
                self.note(
                    at,
                    f"{where} has no section {checks.shown(name)}{hint} There is {listed(known)}.",
                )
            elif not isinstance(value, forms[known[name].form][0]):
                form = forms[known[name].form][1].format(label(at))
                self.note(at, f"{label(at)} must be {form}.")

    def part(self, name: str, form: type = dict, data: Any = None) -> Any:
        """A section, or an empty one where it is missing or of the wrong form."""
        value = (self.data if data is None else data).get(name)
        return value if isinstance(value, form) else form()

    def section(
        self, name: str, given: Mapping[str, Any] | None = None, table: Any = None
    ) -> Call | None:
        """The call of a section that other sections give arguments, also where it is missing."""
        table = self.part(name) if table is None else table
        return self.call(SECTIONS[name], table, (name,), given)

    def table(self, name: str, data: Any = None, place: Place = (), **options: Any) -> Call | None:
        """The call of a section [x]; None where it is missing."""
        data = self.data if data is None else data
        if not isinstance(data.get(name), dict):
            return None
        return self.call(SECTIONS[name], data[name], (*place, name), **options)

    def listed(self, name: str, data: Any = None, place: Place = ()) -> list[Call]:
        """The calls of a section [[x]]."""
        tables = enumerate(self.part(name, list, data))
        made = [self.call(SECTIONS[name], table, (*place, name, i)) for i, table in tables]
        return [call for call in made if call is not None]

    def named(self, name: str, given: Mapping[str, Any] | None = None) -> dict[str, Call]:
        """The calls of a section [x.NAME]."""
        tables = self.part(name).items()
        made = {key: self.call(SECTIONS[name], table, (name, key), given) for key, table in tables}
        return {key: call for key, call in made.items() if call is not None}

    # -- calls

    def call(
        self,
        section: Section | Sequence[str],
        table: Any,
        place: Place,
        given: Mapping[str, Any] | None = None,
        methods: Mapping[str, tuple[str, Any]] | None = None,
    ) -> Call | None:
        """The call that a table describes, or None if it is wrong.

        Parameters
        ----------
        section : a section, or the names from which `kind` chooses.
        given : arguments from other sections; None where one of them is wrong.
        methods : "ball.hertz" -> (its class and method, the ball): what `kind` may name too.
        """
        makes = section.makes if isinstance(section, Section) else section
        withheld = {*(given or ())}
        if isinstance(section, Section):
            withheld |= set(section.given.split())
        try:
            if not isinstance(table, dict):
                got = checks.shown(table)
                self._wrong(place, f"{label(place)} must be a table of keys; got {got}.")
            function, own = self._function(makes, table, place, methods or {})
            known = {n: p for n, p in parameters(function).items() if n not in withheld}
        except MissingDependencyError as error:
            self.note(place, f"{label(place)} cannot be used here: {error}")
            return None
        except Mistake:
            return None
        arguments, whole = self._values(known, table, place, function)
        whole &= not self._lacking(known, table, place)
        arguments = {**(given or {}), **arguments}
        whole &= all(value is not None for value in arguments.values())
        method = function.rpartition(".")[2]
        made = Call(getattr(own, method, None) or resolved(function), arguments, place)
        if own is None and (function, None) in (methods or {}).values():
            return None  # a method of a body that is wrong
        if light(function):
            return self._tried(made, known, table, whole)
        return made if whole else None

    def _function(
        self,
        makes: Sequence[str],
        table: Mapping[str, Any],
        place: Place,
        methods: Mapping[str, tuple[str, Any]],
    ) -> tuple[str, Any]:
        """(the callable, the object whose method it is)."""
        kinds = [*makes, *methods]
        chosen = table.get(KIND, kinds[0] if len(kinds) == 1 else None)
        if chosen is None and {name.split(".")[0] for name in kinds} == {kinds[0]}:
            chosen = kinds[0]  # the class itself, where the others are its constructors
        if chosen is None:
            self._wrong(place, f"{label(place)} lacks {KIND!r}, one of {listed(kinds)}.")
        if not isinstance(chosen, str) or chosen not in kinds:
            close = nearest(str(chosen), kinds)
            hint = f"; did you mean {close!r}?" if close else "."
            self._wrong(
                (*place, KIND),
                f"{label(place)} has no {KIND} {checks.shown(chosen)}{hint} It may be "
                f"{listed(kinds)}.",
            )
        return methods.get(chosen, (chosen, None))

    def _lacking(
        self, known: Mapping[str, Parameter], table: Mapping[str, Any], place: Place
    ) -> bool:
        """Whether needed keys are missing; noted, unless a key that does not exist means them."""
        missing = [one for n, one in known.items() if one.needed and n not in table]
        meant = {nearest(key, known) for key in table if key not in known}
        for one in missing:
            if one.name not in meant:
                about = f" ({one.about})" if one.about else ""
                self.note(place, f"{label(place)} lacks {one.name!r}, {words(one.kinds)}{about}.")
        return bool(missing)

    def _values(
        self, known: Mapping[str, Parameter], table: Mapping[str, Any], place: Place, function: str
    ) -> tuple[dict[str, Any], bool]:
        """The sound values of a table, and whether all are sound."""
        found, whole = {}, True
        for key, value in table.items():
            if key == KIND and key not in known:
                continue
            try:
                if key not in known:
                    self.no_key(place, key, known, function)
                found[key] = self.value(known[key], value, (*place, key))
            except Mistake:
                whole = False
        return found, whole

    def no_key(
        self, place: Place, key: str, known: Mapping[str, Parameter], function: str = ""
    ) -> None:
        """Note a key that does not exist, with the nearest that does and what that holds."""
        if function and key in WITHHELD and takes(function, key):
            why = f"{label((*place, key))} has no place in a file: {WITHHELD[key]}."
            self._wrong((*place, key), why)
        close = nearest(key, known)
        hint = "."
        if close:
            one = known[close]
            about = f": {one.about}" if one.about else ""
            hint = f"; did you mean {close!r} ({words(one.kinds)}{about})?"
        there = f"It takes {listed(known)}." if known else "It takes no keys."
        self._wrong((*place, key), f"{label(place)} has no key {checks.shown(key)}{hint} {there}")

    def _tried(
        self, call: Call, known: Mapping[str, Parameter], table: Mapping[str, Any], whole: bool
    ) -> Call | None:
        """The call with its object; numbers that its constructor refuses are noted.

        Another number stands in for each of them, so that the next mistake is found too; also for
        those that are missing or wrong otherwise (not `whole`).
        """
        arguments = replaced(dict(call.arguments), lambda inner: inner.made)
        if whole and any(each.made is None for each in calls_in(call.arguments)):
            return call  # it waits for a file that the run reads
        lost = {n for n, p in known.items() if n not in arguments and (p.needed or n in table)}
        if None in arguments.values() or any(NUMBER not in known[n].kinds for n in lost):
            return None
        arguments |= dict.fromkeys(lost, STAND_IN)
        while True:
            told: list[str] = []
            try:
                with warnings_to(told.append) if whole else without_warnings():
                    made = call.make(**arguments)
                self.told += [one for one in told if one not in self.told]
                return replace(call, made=made) if whole else None
            except Exception as error:
                place, sentence = refused(replace(call, arguments=arguments), error)
                key = str(place[-1]) if len(place) > len(call.place) else ""
            if key not in lost and (whole or key):
                self.note(place, sentence)
            if key in lost or not isinstance(arguments.get(key), float):
                return None
            arguments[key] = STAND_IN
            lost.add(key)
            whole = False

    # -- values

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
        hint = "."
        numeric = any(kind.name in ("number", "whole") for kind in kinds)
        if isinstance(value, str) and numeric and _WITH_UNIT.fullmatch(value):
            hint = "; write the number alone: all numbers are in SI units, lengths in m."
        sized = [kind for kind in kinds if kind.each]
        if isinstance(value, list) and sized and len(value) != len(sized[0].each):
            hint = f"; the list has {len(value)} entries."
        choices = [option for kind in kinds if kind.name == "choice" for option in kind.options]
        if isinstance(value, str) and choices and nearest(value, choices):
            hint = f"; did you mean {nearest(value, choices)!r}?"
        got = str(value).lower() if isinstance(value, bool) else checks.shown(value)
        got = "a table" if isinstance(value, dict) else got
        self._wrong(place, f"{label(place)} must be {words(kinds)}{meaning}; got {got}{hint}")

    def _of_kind(self, kind: Kind, value: Any, place: Place, about: str) -> Any:
        if isinstance(value, list) and len(value) > LONGEST_LIST:
            self._wrong(place, f"{label(place)} has more than {LONGEST_LIST} entries.")
        if kind.name == "path":
            return self.path(value, place)
        if kind.name == "list":
            each = kind.each or (kind.items,) * len(value)
            pairs = enumerate(zip(each, value, strict=True))
            return tuple(self._converted(k, v, (*place, i), about) for i, (k, v) in pairs)
        if kind.name == "table":
            key_of = self._node if kind.options == (int,) else lambda key, _: key
            return {
                key_of(key, place): self._converted(kind.items, each, (*place, key), about)
                for key, each in value.items()
            }
        if kind.name == "object":
            made = self.call(constructors_of(kind.options[0]), value, place)
            if made is None:
                raise Mistake
            return made
        if kind.name == "data" and isinstance(value, list):
            return tuple(
                self._converted((kind,), each, (*place, i), about) for i, each in enumerate(value)
            )
        if kind.name == "number":
            try:
                return float(value)
            except OverflowError:
                self._wrong(place, f"{label(place)} is larger than any number that can be stored.")
        return value

    def _node(self, key: str, place: Place) -> int:
        if not re.fullmatch(r"\d{1,15}", key):
            self._wrong((*place, key), f"{label(place)} has node numbers as keys; got {key!r}.")
        return int(key)

    def path(self, value: str, place: Place) -> str:
        """A file that the scene names; it must be there."""
        try:
            checks.path(label(place), value)
        except InputError as error:
            self._wrong(place, str(error))
        path = Path(self.document.file(value))
        what = "which does not exist"
        try:
            if path.is_file():
                return str(path)
            if path.exists():
                what = "which is no regular file"
            elif path.parent.is_dir():
                beside = [each.name for each in islice(path.parent.iterdir(), 1000)]
                close = nearest(path.name, beside, 0.7)
                what += f" (there is {close!r} in that folder)" if close else ""
        except (OSError, ValueError):  # a name that no system takes
            pass
        return self._wrong(  # type: ignore[no-any-return]
            place,
            f"{label(place)} names the file {checks.shown(value)}, {what}; paths begin at the "
            "folder of the scene file.",
        )

    def names(self, what: str, name: str, known: Sequence[str], place: Place) -> bool:
        """Note a name that refers to nothing; whether it does exist."""
        if name not in known:
            self.note(place, unknown(f"{label(place)}: the {what}", name, known))
        return name in known

    def _wrong(self, place: Place, sentence: str) -> Any:
        self.note(place, sentence)
        raise Mistake
