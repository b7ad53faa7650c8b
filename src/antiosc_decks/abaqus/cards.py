"""Keyword cards of Abaqus and CalculiX: `*KEYWORD, OPTION=VALUE` and the data lines below it."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from antiosc.base.errors import MeshError
from antiosc.io.deck import Place, Placed, real_number, whole_number
from antiosc_decks.sources import BULK, Sources

#: Cards whose data may be in a separate file (INPUT=).
WITH_INPUT = ("NODE", "ELEMENT", "NSET", "ELSET", "BOUNDARY", "EQUATION")
#: Cards of loads, whose data may be in a file that is not there.
LOADS = ("CLOAD", "DLOAD", "DSLOAD", "FILM", "SFILM", "RADIATE", "CFLUX", "DFLUX", "TEMPERATURE")
#: The comment over a surface that cgx of Debian writes without its keyword line.
SURFACE_OF_CGX = re.compile(r"\*\* Surfaces based on (\S+)$")


class Row(Placed):
    """The fields of a data line; a comma at the end adds none."""

    def __init__(self, line: str, place: Place) -> None:
        self.place = place
        self.fields = [part.strip() for part in line.split(",")]
        while self.fields and not self.fields[-1]:
            self.fields.pop()

    def word(self, k: int) -> str:
        """A field, "" where there is none."""
        return self.fields[k] if k < len(self.fields) else ""

    def real(self, k: int, default: float = 0.0) -> float:
        """A number, the default where the field is empty."""
        return real_number(self.fields[k], self.place) if self.word(k) else default

    def whole(self, k: int, default: int = 0) -> int:
        """An integer, the default where the field is empty."""
        return whole_number(self.fields[k], self.place) if self.word(k) else default

    def reals(self, count: int = 0) -> list[float]:
        """Its numbers, or so many; an empty field is 0."""
        return [self.real(k) for k in range(count or len(self.fields))]


@dataclass
class Card(Placed):
    """One keyword with its options and data lines."""

    #: without `*` and spaces, upper case
    keyword: str
    #: name in upper case -> value as written; "" for those without one
    options: dict[str, str]
    place: Place
    #: data lines that are neither empty nor comments
    lines: list[str] = field(default_factory=list)
    #: file and line of each data line
    places: list[Place] = field(default_factory=list)

    def rows(self) -> list[Row]:
        """The data lines that have fields."""
        rows = map(Row, self.lines, self.places)
        return [row for row in rows if row.fields]

    def numbers(self) -> list[float]:
        """Numbers of all data lines; an empty field is 0."""
        return [value for row in self.rows() for value in row.reals()]

    def first(self) -> Row:
        """The first data line, which may be without fields."""
        return Row(self.lines[0], self.places[0]) if self.lines else Row("", self.place)

    def option(self, name: str, default: str = "") -> str:
        """Value of an option, without quotes."""
        return self.options.get(name, default).strip().strip('"').strip()

    def needed(self, name: str) -> str:
        """Value of a required option."""
        value = self.option(name)
        self.needs(value, f"*{self.keyword} needs {name}=.")
        return value


def cards(sources: Sources) -> list[Card]:
    """All cards of a deck and of the files that it includes, in order."""
    found: list[Card] = []
    _collect(sources, sources.main(), sources.name, found)
    if not found:
        raise MeshError(f"{sources.name} contains no keyword (*NODE, …): it is not an Abaqus deck.")
    return found


def _collect(sources: Sources, lines: list[str], file: str, found: list[Card]) -> None:
    number, surface = 0, None
    while number < len(lines):
        line = lines[number].strip()
        number += 1
        if not line or line.startswith("**"):
            surface = SURFACE_OF_CGX.match(line) or surface
            continue
        place = Place(file, number)
        if surface and not line.startswith("*"):
            found.append(_card(f"*SURFACE, NAME=S{surface[1]}", place))
        surface = None
        if not line.startswith("*"):
            if not found and "**" in line:  # a comment behind what an editor or a mail put there
                continue
            if not found:
                bulk = any(map(BULK.match, lines))
                what = "Nastran bulk data, name it .bdf" if bulk else "not an Abaqus deck"
                raise place.error(f"data before the first keyword: {what}.")
            found[-1].lines.append(line)
            found[-1].places.append(place)
            continue
        while line.endswith(",") and number < len(lines):
            following = lines[number].strip()
            if following[:1] in "*+-.0123456789":  # numbers are data
                break
            line += following
            number += 1
        card = _card(line, place)
        if card.keyword == "INCLUDE" and not _of_loads(sources, card, found):
            _included(sources, card.needed("INPUT"), place, found)
            continue
        found.append(card)
        if card.keyword in WITH_INPUT and card.option("INPUT"):
            _included(sources, card.option("INPUT"), place, found)


def _of_loads(sources: Sources, card: Card, found: list[Card]) -> bool:
    """Whether a file that is not there would be of loads, which are not read either."""
    return bool(found) and found[-1].keyword in LOADS and not sources.holds(card.needed("INPUT"))


def _included(sources: Sources, named: str, place: Place, found: list[Card]) -> None:
    lines = sources.enter(named, place)
    _collect(sources, lines, named.strip().strip('"'), found)
    sources.leave()


def _card(line: str, place: Place) -> Card:
    head, *rest = _outside_quotes(line[1:])
    keyword = "".join(head.split()).upper()
    options = {}
    for part in rest:
        name, _, value = part.partition("=")
        name = "".join(name.split()).upper()
        if name:
            options[name] = value.strip()
    return Card(keyword, options, place)


def _outside_quotes(text: str) -> list[str]:
    """Fields between the commas outside quotes."""
    if '"' not in text:
        return text.split(",")
    fields, quoted = [""], False
    for letter in text:
        quoted ^= letter == '"'
        if letter == "," and not quoted:
            fields.append("")
        else:
            fields[-1] += letter
    return fields
