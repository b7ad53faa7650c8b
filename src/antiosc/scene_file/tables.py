"""The sections of a scene file as calls, each by its form: [x], [[x]], [x.NAME]."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from antiosc import checks
from antiosc.errors import MissingDependencyError
from antiosc.scene_file.build import Builder
from antiosc.scene_file.locations import Place
from antiosc.scene_file.problems import label, listed, nearest
from antiosc.scene_file.program import Call
from antiosc.scene_file.read import Document
from antiosc.scene_file.sections import SECTIONS, Section


class Tables:
    """The sections of one document; mistakes in them are noted."""

    def __init__(self, document: Document) -> None:
        self.document = document
        self.data = document.data
        self.problems = document.problems
        self.build = Builder(document)

    def known_sections(
        self, data: Mapping[str, Any], known: Mapping[str, Section], place: Place
    ) -> None:
        """Note sections that do not exist and sections of the wrong form."""
        forms = {"table": dict, "named": dict, "list": list, "text": str}
        written = {
            "table": "a table, [{0}]",
            "named": "a table of names, [{0}.NAME]",
            "list": "a list of tables, [[{0}]]",
            "text": 'a text in "quotes"',
        }
        for name, value in data.items():
            if name not in known:
                self.no_section(name, known, place)
            elif not isinstance(value, forms[known[name].form]):
                form = written[known[name].form].format(label((*place, name)))
                self.problems.add((*place, name), f"{label((*place, name))} must be {form}.")

    def no_section(self, name: str, known: Mapping[str, Section], place: Place) -> None:
        close = nearest(name, known)
        hint = f"; did you mean [{close}], {known[close].about}?" if close else "."
        where = f"[{label(place)}]" if place else "a scene"
        self.problems.add(
            (*place, name),
            f"{where} has no section {checks.shown(name)}{hint} There is {listed(known)}.",
        )

    def part(self, data: Mapping[str, Any], name: str, form: type) -> Any:
        """A section, or an empty one where it is missing or of the wrong form."""
        value = data.get(name)
        return value if isinstance(value, form) else form()

    def makes(self, name: str, place: Place) -> tuple[str, ...]:
        """What a section makes; () after noting that a package for it is missing."""
        try:
            return SECTIONS[name].makes()
        except MissingDependencyError as error:
            self.problems.add(place, f"{label(place)} cannot be used here: {error}")
            return ()

    def table(self, name: str, data: Any = None, place: Place = (), **options: Any) -> Call | None:
        """The call of a section [x]; None where it is missing."""
        data = self.data if data is None else data
        if not isinstance(data.get(name), dict):
            return None
        section, at = SECTIONS[name], (*place, name)
        return self.build.call(
            self.makes(name, at), data[name], at, withheld=section.given, **options
        )

    def listed(self, name: str, data: Any = None, place: Place = ()) -> list[Call]:
        """The calls of a section [[x]]."""
        data = self.data if data is None else data
        tables = self.part(data, name, list)
        makes = self.makes(name, (*place, name)) if tables else ()
        made = [self.build.call(makes, table, (*place, name, i)) for i, table in enumerate(tables)]
        return [call for call in made if call is not None]

    def named(self, name: str, **options: Any) -> dict[str, Call]:
        """The calls of a section [x.NAME]."""
        section, tables = SECTIONS[name], self.part(self.data, name, dict)
        makes = self.makes(name, (name,)) if tables else ()
        made = {
            key: self.build.call(makes, table, (name, key), withheld=section.given, **options)
            for key, table in tables.items()
        }
        return {key: call for key, call in made.items() if call is not None}
