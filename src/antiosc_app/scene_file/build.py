"""Turns tables of a scene file into calls, notes every mistake, and evaluates calls."""

from __future__ import annotations

import inspect
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any, NoReturn

from antiosc.base import checks, plausible, progress
from antiosc.base.errors import AntioscError, InputError, MissingDependencyError, warnings_to
from antiosc_app.scene_file import schema
from antiosc_app.scene_file.document import (
    Document,
    Place,
    Table,
    closest_name,
    names_text,
    place_text,
    spelling_suggestion,
)
from antiosc_app.scene_file.schema import (
    KIND_KEY,
    SceneParameter,
    SceneSection,
    ValueForm,
    callable_of,
    parameters_of,
)

#: Section -> what its call computes, in words for who waits.
PROGRESS_TEXTS = {
    "geometry": "reading the mesh",
    "deck": "reading the deck",
    "material": "assembling the part",
    "structure": "assembling the part",
    "extract": "extracting the model of the part",
    "simulate": "computing the impact",
    "strike": "computing the impact",
    "drop": "computing the fall",
}
#: Largest list of a scene file.
MAX_LIST_LENGTH = 200_000


class InvalidValue(Exception):
    """Raised for an invalid value after its sentence has been noted."""


@dataclass(frozen=True, eq=False)
class Call:
    """A call that a table of the scene file describes; its arguments may contain further calls."""

    function: Callable[..., Any]
    arguments: Table
    place: Place = ()  # of the table in the scene file
    result: Any = None  # the result, if it could be made at once; else the run makes it

    @property
    def name(self) -> str:
        """Name of the callable: "simulate", "Structure.from_files"."""
        return str(getattr(self.function, "__qualname__", ""))

    @property
    def progress_text(self) -> str:
        """Text on the computation of the call, for a display of progress."""
        if not self.place:
            return "evaluating the result"
        return PROGRESS_TEXTS.get(str(self.place[0]), f"computing [{place_text(self.place)}]")

    def mistake_of(self, error: Exception) -> tuple[Place, str]:
        """(place, sentence) of an error that this call raised; the place of the argument whose name
        begins the error, if there is one.
        """
        known = isinstance(error, AntioscError)
        fault = str(error) if known else f"{type(error).__name__}: {error}"
        name = fault.removeprefix("every ").partition(" ")[0]
        place = (*self.place, name) if name in self.arguments else self.place
        return place, f"{place_text(self.place)}: {fault.rstrip('.')}."


def calls_in(value: object) -> Iterator[Call]:
    """The calls within a value, inner ones first."""
    if isinstance(value, Call):
        yield from calls_in(value.arguments)
        yield value
    elif isinstance(value, Mapping | list | tuple):
        for entry in value.values() if isinstance(value, Mapping) else value:
            yield from calls_in(entry)


def with_results(value: Any, result_of: Callable[[Call], Any] = lambda call: call.result) -> Any:
    """The value with each call in it replaced by the result of `result_of`."""
    if isinstance(value, Call):
        return result_of(value)
    if isinstance(value, dict):
        return {key: with_results(entry, result_of) for key, entry in value.items()}
    if type(value) in (list, tuple):
        return type(value)(with_results(entry, result_of) for entry in value)
    return value


class Evaluation:
    """Evaluates calls, each once; an InputError becomes a SceneFileError with a line."""

    def __init__(self, document: Document) -> None:
        self.document = document
        self._made: dict[Call, object] = {}

    def register(self, call: Call, result: object) -> None:
        """Set the result of a call that was computed elsewhere."""
        self._made[call] = result

    def __call__(self, value: Any) -> Any:
        """The value with each call in it replaced by its result."""
        return with_results(value, self._result_of)

    def _result_of(self, call: Call) -> object:
        """The result of a call, computed if it is not known."""
        if call.result is None and call not in self._made:
            arguments = {name: self(value) for name, value in call.arguments.items()}
            with progress.doing(call.progress_text):
                try:
                    self._made[call] = call.function(**arguments)
                except InputError as error:
                    if not call.place:
                        raise
                    raise self.document.mistakes.error(*call.mistake_of(error)) from error
        return self._made.get(call, call.result)


def with_material_tables(data: Table) -> Table:
    """The scene with each material's name, also in parts and groups, replaced by a table."""
    filled_data = dict(data)
    if "material" in data:
        filled_data["material"] = _material_tables(data["material"])
    if isinstance(data.get("parts"), dict):
        filled_data["parts"] = {
            name: with_material_tables(part) if isinstance(part, dict) else part
            for name, part in data["parts"].items()
        }
    return filled_data


def _material_tables(value: object) -> object:
    """A [material] section in which each material is a table."""
    if isinstance(value, str):
        return {KIND_KEY: "material", "name": value}
    if not isinstance(value, dict) or KIND_KEY in value:
        return value
    if "name" in value:
        return {KIND_KEY: "material", **value}
    return {group: _material_tables(entry) for group, entry in value.items()}


class Builder:
    """Turns the tables of one document into calls, and notes the mistakes in them."""

    def __init__(self, document: Document) -> None:
        self.document = document
        self.data: Table = with_material_tables(document.data)
        #: (place, sentence): notes a mistake
        self.note = document.mistakes.add_mistake
        #: warnings of the objects that were made
        self.warnings: list[str] = []

    # -- sections, each by its form: [x], [[x]], [x.NAME]

    def check_sections(
        self, data: Table, known: Mapping[str, SceneSection], place: Place = ()
    ) -> None:
        """Note sections that do not exist and sections of the wrong form."""
        for name, value in data.items():
            entry_place = (*place, name)
            if name not in known:
                similar = closest_name(name, known)
                hint = f"; did you mean [{similar}], {known[similar].about}?" if similar else "."
                fault = f"{f'[{place_text(place)}]' if place else 'a scene'} has no section"
                known_names = f"There is {names_text(known)}."
                self.note(entry_place, f"{fault} {checks.shown(name)}{hint} {known_names}")
                continue
            form, fault, heading = schema.SECTION_FORMS[known[name].form]
            if not isinstance(value, form):
                self.note(
                    entry_place,
                    f"{place_text(entry_place)} must be {fault}"
                    f"{heading.format(place_text(entry_place))}.",
                )

    def section(self, name: str, form: type = dict, data: Table | None = None) -> Any:
        """The section `name` of `data` (default: the scene); empty if missing or no `form`."""
        value = (self.data if data is None else data).get(name)
        if isinstance(value, form):
            return value
        return form()

    def call_of_section(
        self,
        name: str,
        data: Table | None = None,
        place: Place = (),
        even_if_missing: bool = False,
        **options: Any,
    ) -> Call | None:
        """The call of a section [x] of `data` at `place`; None if it is missing.

        `even_if_missing`: treat a missing section as empty; `options`: arguments of `call`.
        """
        data = self.data if data is None else data
        if not even_if_missing and not isinstance(data.get(name), dict):
            return None
        return self.call(
            schema.SECTIONS[name], self.section(name, dict, data), (*place, name), **options
        )

    def calls_of_list(self, name: str, data: Table | None = None, place: Place = ()) -> list[Call]:
        """The valid calls of a section [[x]] of `data` (default: the scene) at `place`."""
        tables = enumerate(self.section(name, list, data))
        calls = [self.call(schema.SECTIONS[name], table, (*place, name, i)) for i, table in tables]
        return [call for call in calls if call is not None]

    def calls_by_name(self, name: str, given_arguments: Table | None = None) -> dict[str, Call]:
        """Calls of the sections [x.NAME], by NAME.

        `given_arguments`: arguments from other sections.
        """
        tables = self.section(name).items()
        calls = {
            key: self.call(schema.SECTIONS[name], table, (name, key), given_arguments)
            for key, table in tables
        }
        return {key: call for key, call in calls.items() if call is not None}

    # -- calls

    def call(
        self,
        section: SceneSection | Sequence[str],
        table: object,
        place: Place,
        given_arguments: Table | None = None,
    ) -> Call | None:
        """The call that a table describes, or None if it is wrong.

        `section` may be the names from which `kind` chooses; `given_arguments` are arguments from
        other sections, None for one with a mistake.
        """
        callables = section.callables if isinstance(section, SceneSection) else section
        given_arguments = dict(given_arguments or {})
        withheld = {
            *given_arguments,
            *(section.given.split() if isinstance(section, SceneSection) else ()),
        }
        try:
            if not isinstance(table, dict):
                shown_table = checks.shown(table)
                self._note_mistake(
                    place, f"{place_text(place)} must be a table of keys; got {shown_table}."
                )
            function = self._function_name(callables, table, place)
            allowed = {n: p for n, p in parameters_of(function).items() if n not in withheld}
        except MissingDependencyError as error:
            self.note(place, f"{place_text(place)} cannot be used here: {error}")
            return None
        except InvalidValue:
            return None
        arguments, complete = self._valid_values(allowed, table, place, function)
        arguments = {**given_arguments, **arguments}
        if not complete or None in arguments.values():
            return None
        call = Call(callable_of(function), arguments, place)
        if schema.is_checking_only(function):
            return self._call_with_result(call)
        return call

    def _function_name(self, kinds: Sequence[str], table: Table, place: Place) -> str:
        """Name of the callable among `kinds` that the key `kind` of a table chooses."""
        kind = table.get(KIND_KEY, kinds[0] if len(kinds) == 1 else None)
        if kind is None and {name.split(".")[0] for name in kinds} == {kinds[0]}:
            kind = kinds[0]  # the class itself, where the others are its constructors
        if kind is None:
            self._note_mistake(
                place, f"{place_text(place)} lacks {KIND_KEY!r}, one of {names_text(kinds)}."
            )
        if not isinstance(kind, str) or kind not in kinds:
            hint = spelling_suggestion(kind, kinds)
            fault = f"{place_text(place)} has no {KIND_KEY} {checks.shown(kind)}{hint}"
            self._note_mistake((*place, KIND_KEY), f"{fault} It may be {names_text(kinds)}.")
        return kind

    def _valid_values(
        self, known: Mapping[str, SceneParameter], table: Table, place: Place, function: str
    ) -> tuple[dict[str, object], bool]:
        """(valid values of a table by key, whether all are valid and none is missing).

        `known`: the parameters of `function`.
        """
        values = {}
        complete = True
        for key, value in table.items():
            if key == KIND_KEY and key not in known:
                continue
            try:
                if key not in known:
                    self._refuse_key(place, key, known, function)
                values[key] = self.value(known[key], value, (*place, key))
            except InvalidValue:
                complete = False
        missing_keys = [
            parameter
            for parameter in known.values()
            if parameter.is_required and parameter.name not in table
        ]
        meant_keys = {
            closest_name(key, known) for key in table if missing_keys and key not in known
        }
        for parameter in missing_keys:
            if parameter.name not in meant_keys:  # a key that does not exist means it
                self.note(place, f"{place_text(place)} lacks {parameter.name!r}.")
        return values, complete and not missing_keys

    def _refuse_key(
        self, place: Place, key: str, known: Mapping[str, SceneParameter], function: str
    ) -> NoReturn:
        """Note an unknown key with the most similar known key, and raise InvalidValue."""
        key_place = (*place, key)
        if (
            key in schema.WITHHELD_PARAMETERS
            and key in inspect.signature(callable_of(function)).parameters
        ):
            self._note_mistake(
                key_place,
                f"{place_text(key_place)} has no place in a file: "
                f"{schema.WITHHELD_PARAMETERS[key]}.",
            )
        hint = spelling_suggestion(key, known)
        keys = f"It takes {names_text(known)}." if known else "It takes no keys."
        self._note_mistake(
            key_place, f"{place_text(place)} has no key {checks.shown(key)}{hint} {keys}"
        )

    def _call_with_result(self, call: Call) -> Call | None:
        """The call, with its result if no argument depends on the run; None after an error, which
        is noted.
        """
        if any(inner.result is None for inner in calls_in(call.arguments)):
            return call  # it waits for a file that the run reads
        messages: list[str] = []
        try:
            with warnings_to(messages.append):
                result = call.function(**with_results(dict(call.arguments)))
                if isinstance(result, plausible.ExaminedMaterial):
                    plausible.warn_each([plausible.material_doubt(result)])
        except Exception as error:
            self.note(*call.mistake_of(error))
            return None
        self.warnings += [message for message in messages if message not in self.warnings]
        return replace(call, result=result)

    # -- values

    def value(self, parameter: SceneParameter, value: object, place: Place) -> object:
        """The value of a key as an argument; an invalid one is noted, and raises InvalidValue."""
        converted = self._converted_value(parameter.form, value, place)
        if parameter.check is not None and not any(calls_in(converted)):
            try:
                parameter.check(parameter.name, converted)
            except InputError as error:
                self._note_mistake(place, f"{place_text(place)}: {error}")
        return converted

    def _converted_value(self, form: ValueForm, value: Any, place: Place) -> object:
        """The value converted by its form, also within lists and tables."""
        if isinstance(value, str):
            return self._existing_path(value, place) if form.is_path else value
        if isinstance(value, list):
            if len(value) > MAX_LIST_LENGTH:
                self._note_mistake(
                    place, f"{place_text(place)} has more than {MAX_LIST_LENGTH} entries."
                )
            entries = enumerate(value)
            return tuple(
                self._converted_value(form.item_form or form, x, (*place, i)) for i, x in entries
            )
        if isinstance(value, dict):
            return self._converted_table(form, value, place)
        if form.to_float and not form.allows_integer and type(value) is int:
            try:
                return float(value)
            except OverflowError:
                self._note_mistake(
                    place, f"{place_text(place)} is larger than any number that can be stored."
                )
        return value

    def _converted_table(self, form: ValueForm, table: dict[str, Any], place: Place) -> object:
        """The call that a table of this form describes, or the table with converted values."""
        if form.object_classes:
            names = [name for kind in form.object_classes for name in schema.constructors_of(kind)]
            call = self.call(names, table, place)
            if call is None:
                raise InvalidValue
            return call
        for key in table if form.keys_are_nodes else ():
            if not re.fullmatch(r"\d{1,15}", key):
                sentence = f"{place_text(place)} has node numbers as keys; got {key!r}."
                self._note_mistake((*place, key), sentence)
        return {
            int(key) if form.keys_are_nodes else key: self._converted_value(
                form.entry_form or schema.PLAIN_FORM, entry, (*place, key)
            )
            for key, entry in table.items()
        }

    def _existing_path(self, value: str, place: Place) -> str:
        """The path of an existing file that the scene names, from the scene's folder."""
        fault = "which does not exist"
        try:
            path = Path(os.path.normpath(self.document.path.parent / checks.path("it", value)))
            if path.is_file():
                return str(path)
            if path.exists():
                fault = "which is no regular file"
            elif path.parent.is_dir():
                siblings = [sibling.name for sibling in islice(path.parent.iterdir(), 1000)]
                similar = closest_name(path.name, siblings, 0.7)
                fault += f" (there is {similar!r} in that folder)" if similar else ""
        except (OSError, ValueError):  # a name that no system takes
            pass
        sentence = f"{place_text(place)} names the file {checks.shown(value)}, {fault}"
        self._note_mistake(place, f"{sentence}; paths begin at the folder of the scene file.")

    def _note_mistake(self, place: Place, sentence: str) -> NoReturn:
        """Note a mistake and raise `InvalidValue`."""
        self.note(place, sentence)
        raise InvalidValue
