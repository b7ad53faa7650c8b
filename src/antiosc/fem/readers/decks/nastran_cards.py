"""Entries of Nastran's bulk data, in small, large and free fields."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

from antiosc.errors import MeshError
from antiosc.fem.readers.decks.deck import Place, real_number, whole_number
from antiosc.fem.readers.decks.sources import Sources

#: Names of properties in comments of pre-processors: HyperMesh, ANSA, Femap.
PROPERTY_NAMES = (
    re.compile(r'\$HMNAME\s+PROP\s+(\d+)\s*"([^"]+)"'),
    re.compile(r"\$ANSA_NAME(?:_COMMENT)?;(\d+);P\w+;([^;]+);"),
    re.compile(r"\$ Femap(?: with NX Nastran)? Property (\d+) : (.+)"),
)
#: Most copies of one entry.
MOST_COPIES = 1_000_000
#: A number; "+1" may mark a continuation.
_NUMBER = re.compile(r"-?\.?\d")
_SELECTED = re.compile(r"\s*(SPC|MPC)\s*=\s*(\d+)\s*$", re.IGNORECASE)
_INCLUDE = re.compile(r"\s*INCLUDE\b\s*(.*)", re.IGNORECASE)


@dataclass
class Entry:
    """One entry: its name, and its fields without the name, eight per line."""

    name: str
    place: Place
    fields: list[str] = field(default_factory=list)

    def text(self, k: int) -> str:
        """Field k (from 0), "" where it is blank."""
        return self.fields[k].strip() if k < len(self.fields) else ""

    def whole(self, k: int, default: int | None = None) -> int:
        """An integer; MeshError if it is none, or missing without a default."""
        if not self.text(k):
            if default is None:
                raise MeshError(f"{self.place}: field {k + 2} of {self.name} is empty.")
            return default
        return whole_number(self.text(k), self.place)

    def real(self, k: int, default: float | None = 0.0) -> float:
        """A number; MeshError if it is none, or missing without a default."""
        if not self.text(k):
            if default is None:
                raise MeshError(f"{self.place}: field {k + 2} of {self.name} is empty.")
            return default
        return real_number(self.text(k), self.place)


@dataclass
class Bulk:
    """The content of a deck's files."""

    entries: list[Entry] = field(default_factory=list)
    #: numbers of the SPC sets that the case control selects
    selected: list[int] = field(default_factory=list)
    #: those of the MPC sets
    selected_mpcs: list[int] = field(default_factory=list)
    #: whether the deck has a case control
    with_control: bool = False
    #: number of a property -> its name in a comment
    names: dict[int, str] = field(default_factory=dict)


def bulk_data(sources: Sources) -> Bulk:
    """All entries of a deck and of the files that it includes."""
    bulk = Bulk()
    lines = sources.main()
    begins = [line.split("$")[0].upper().split()[:2] == ["BEGIN", "BULK"] for line in lines]
    # a file without case control contains only bulk data
    started = not any(begins)
    _Collector(sources, bulk, started).read(lines, sources.name)
    if not bulk.entries:
        raise MeshError(f"{sources.name} contains no bulk data (GRID, CHEXA, …).")
    return bulk


class _Collector:
    def __init__(self, sources: Sources, bulk: Bulk, started: bool) -> None:
        self.sources = sources
        self.bulk = bulk
        self.started = started
        self.ended = False
        #: whether the next line continues a list of free fields
        self.continued = False
        #: changes of the fields of the last copied entry
        self.changes: list[str] = []

    def read(self, lines: list[str], file: str) -> None:
        """One file."""
        number = 0
        while number < len(lines) and not self.ended:
            number += 1
            line, place = lines[number - 1], Place(file, number)
            if "$" in line:
                self._note(line[line.index("$") :])
                line = line[: line.index("$")]
            line = line.rstrip()
            if not line.strip():
                continue
            if match := _INCLUDE.match(line):
                named = match[1].strip()
                while named[:1] in "'\"" and named and named.count(named[0]) < 2:
                    if number >= len(lines):  # the name ends at its quote
                        break
                    named += lines[number].strip()
                    number += 1
                included = self.sources.enter(named, place)
                self.read(included, named.strip("'\" "))
                self.sources.leave()
            elif not self.started:
                self._control(line)
            else:
                self._bulk(line.expandtabs(8), place)

    def _note(self, comment: str) -> None:
        for pattern in PROPERTY_NAMES:
            if match := pattern.match(comment):
                self.bulk.names[int(match[1][:18])] = match[2].strip()

    def _control(self, line: str) -> None:
        if line.upper().split()[:2] == ["BEGIN", "BULK"]:
            self.started = True
            return
        self.bulk.with_control = True
        if match := _SELECTED.match(line):
            sets = self.bulk.selected if match[1].upper() == "SPC" else self.bulk.selected_mpcs
            sets.append(int(match[2][:18]))

    def _bulk(self, line: str, place: Place) -> None:
        words = line.upper().split()
        if words[0] == "ENDDATA":
            self.ended = True
            return
        if words[:2] == ["BEGIN", "BULK"]:
            return
        continued, self.continued = self.continued, "," in line and line.rstrip().endswith(",")
        if continued and words[0][0].isdigit() and "," in line:
            line = "," + line
        name, fields, large = _fields(line, place)
        if name and name[0] == "=":
            self._copy(words[0].split(",")[0], fields, place)
            return
        if not name or name[0] in "+*":
            if not self.bulk.entries:
                raise MeshError(f"{place}: a continuation without an entry before it.")
            entry = self.bulk.entries[-1]
            filled = -len(entry.fields) % 8
            if filled and not (large and filled == 4):
                entry.fields += [""] * filled
            entry.fields += fields
            return
        if not name[0].isalpha():
            raise MeshError(f"{place}: {name[:20]!r} is not an entry of Nastran's bulk data.")
        self.bulk.entries.append(Entry(name.rstrip("*").strip().upper(), place, fields))

    def _copy(self, name: str, fields: list[str], place: Place) -> None:
        """Copies of the entry before: = the same field, == all of the rest, *(2) more by 2."""
        if not self.bulk.entries:
            raise MeshError(f"{place}: a copy (=) without an entry before it.")
        times = 1
        if name != "=":
            times = whole_number(name[1:].strip("()"), place)
            if not 0 < times <= MOST_COPIES or not self.changes:
                raise MeshError(f"{place}: {name[:20]!r} repeats no copy, or one too often.")
        else:
            self.changes = fields
        for _ in range(times):
            last = self.bulk.entries[-1]
            own = Entry(last.name, place, [])
            rest = False
            for k, old in enumerate(last.fields):
                change = "=" if rest or k >= len(self.changes) else self.changes[k].strip()
                rest = rest or change == "=="
                own.fields.append(_changed(old, change, place))
            self.bulk.entries.append(own)


def _changed(old: str, change: str, place: Place) -> str:
    """A field of a copy."""
    if change in ("=", "=="):
        return old
    if not change.startswith("*"):
        return change
    step = change[1:].strip("() ")
    if "." in step:
        return repr(real_number(old or "0", place) + real_number(step, place))
    return str(whole_number(old or "0", place) + whole_number(step, place))


def _fields(line: str, place: Place) -> tuple[str, list[str], bool]:
    """(name, four or eight fields, whether they are large)."""
    if "," in line:
        first, *rest = (part.strip() for part in line.split(","))
        large = first.endswith("*") or first.startswith("*")
        count = 4 if large else 8
        # the one after them names the continuation
        if any(rest[count + 1 :]) or _NUMBER.match("".join(rest[count : count + 1])):
            raise MeshError(
                f"{place}: a line of free fields has up to {count} after its name, and the mark of "
                f"the next line; got {len(rest)}: write the further ones in a line of their own."
            )
        return first, (rest + [""] * count)[:count], large
    name = line[:8].strip()
    large = "*" in name
    width, count = (16, 4) if large else (8, 8)
    body = line[8 : 8 + width * count].ljust(width * count)
    return name, [body[k * width : (k + 1) * width].strip() for k in range(count)], large


def through(words: list[str], place: Place) -> Iterator[tuple[int, int]]:
    """(first, last) of the ranges in a list with THRU; a single number is a range of one."""
    words = [word for word in words if word]
    k = 0
    while k < len(words):
        first = whole_number(words[k], place)
        last = first
        if k + 2 < len(words) and words[k + 1].upper() == "THRU":
            last = whole_number(words[k + 2], place)
            k += 2
        k += 1
        yield first, last
