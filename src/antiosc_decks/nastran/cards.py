"""Entries of Nastran's bulk data, in small, large and free fields."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

from antiosc.base.errors import MeshError
from antiosc.io.deck import Place, real_number, whole_number
from antiosc_decks.sources import Sources

#: Names of properties in comments of pre-processors: HyperMesh, ANSA, Femap.
PROPERTY_NAMES = (
    re.compile(r'\$HMNAME\s+PROP\s+(\d+)\s*"([^"]+)"'),
    re.compile(r"\$ANSA_NAME(?:_COMMENT)?;(\d+);P\w+;([^;]+);"),
    re.compile(r"\$ Femap(?: with NX Nastran)? Property (\d+) : (.+)"),
)
#: Entries of a text, whose lines have no fields.
TEXTS = ("DEQATN",)
#: Most copies of one entry.
MOST_COPIES = 1_000_000
#: A number; "+1" may mark a continuation.
_NUMBER = re.compile(r"-?\.?\d")
_MARK = re.compile(r"[+*][A-Za-z]")
_INCLUDE = re.compile(r"\s*INCLUDE\b\s*(.*)", re.IGNORECASE)

_SUPER = re.compile(r"SUPER\s*=?\s*(\d+)", re.IGNORECASE)
_SUBCASE = re.compile(r"\s*(SUBCASE|SUBCOM|SYM|SYMCOM|REPCASE)\b", re.IGNORECASE)
_SELECTED = re.compile(r"\s*(SPC|MPC|NSM)\s*=\s*(\d+)\s*$", re.IGNORECASE)


@dataclass
class Entry:
    """One entry: its name, and its fields without the name, eight per line."""

    name: str
    place: Place
    fields: list[str] = field(default_factory=list)
    #: what is wrong with its lines; an error where the entry is read
    fault: MeshError | None = None

    def text(self, k: int) -> str:
        """Field k (from 0), "" where it is blank."""
        return self.fields[k].strip() if k < len(self.fields) else ""

    def whole(self, k: int, default: int | None = None) -> int:
        """An integer; MeshError if it is none, or missing without a default."""
        if not self.text(k):
            if default is None:
                raise self.place.error(f"field {k + 2} of {self.name} is empty.")
            return default
        return whole_number(self.text(k), self.place)

    def number(self, k: int) -> int:
        """The number of a node, a property, … in field k, as no other part of the deck has it."""
        return self.whole(k) + self.place.scope

    def real(self, k: int, default: float | None = 0.0) -> float:
        """A number; MeshError if it is none, or missing without a default."""
        if not self.text(k):
            if default is None:
                raise self.place.error(f"field {k + 2} of {self.name} is empty.")
            return default
        return real_number("".join(self.text(k).split()), self.place)


def motions_of(text: str, place: Place) -> list[int]:
    """Motions 0 to 5 of components such as "123" or "1 2 3"; none of 0 and of a blank."""
    digits = "".join(text.split())
    if not set(digits) <= set("0123456"):
        raise place.error(f"{text!r} are not components from 1 to 6.")
    return sorted({int(c) - 1 for c in digits} - {-1})


@dataclass
class CaseControl:
    """What the lines before the bulk data select."""

    #: whether there are such lines
    given: bool = False
    subcase: int = 0
    #: (what, number of the subcase; 0: above all) -> set
    sets: dict[tuple[str, int], int] = field(default_factory=dict)

    def read(self, line: str) -> None:
        """One line."""
        self.given = True
        self.subcase += bool(_SUBCASE.match(line))
        if match := _SELECTED.match(line):
            self.sets[match[1].upper(), self.subcase] = int(match[2][:18])

    def of_first(self, what: str) -> int | None:
        """The set of the first subcase, by default that above all subcases."""
        return self.sets.get((what, 1), self.sets.get((what, 0)))


@dataclass
class Bulk:
    """The content of a deck's files."""

    entries: list[Entry] = field(default_factory=list)
    name: str = ""
    #: what the lines before the bulk data select
    control: CaseControl = field(default_factory=CaseControl)
    #: number of a property -> its name in a comment
    names: dict[int, str] = field(default_factory=dict)
    #: warnings, one sentence each
    told: list[str] = field(default_factory=list)


def bulk_data(sources: Sources) -> Bulk:
    """All entries of a deck and of the files that it includes."""
    bulk = Bulk(name=sources.name)
    lines = sources.main()
    begins = [line.split("$")[0].upper().split()[:2] == ["BEGIN", "BULK"] for line in lines]
    # a file without case control contains only bulk data
    started = not any(begins)
    collector = _Collector(sources, bulk, started)
    collector.read(lines, sources.name)
    if not bulk.entries:
        raise MeshError(f"{sources.name} contains no bulk data (GRID, CHEXA, …).")
    collector.continuations.find_lost()
    return bulk


class Continuations:
    """Which entry a continuation belongs to: by its mark (fields 10 and 1), else by order."""

    def __init__(self) -> None:
        #: mark -> entries (by identity) whose last line ends with it
        self._open: dict[str, dict[int, Entry]] = {}
        #: identity of an entry -> the marks of its last line
        self._marks: dict[int, tuple[str, ...]] = {}
        self._last: Entry | None = None
        #: continuations that were joined to the entry before them, which has no mark
        self._by_order: list[tuple[Entry, str, Place]] = []

    def ends(self, entry: Entry, mark: str) -> None:
        """The last line is of this entry and ends with this mark."""
        self._last = entry
        label = mark.strip().upper()
        # without a sign, the first letter stands for one
        own = (label[1:].strip(),) if label[:1] in ("+", "*") else (label, label[1:])
        if any(own):
            self._marks[id(entry)] = own
            for one in filter(None, own):
                self._open.setdefault(one, {})[id(entry)] = entry

    def entry_of(self, name: str, place: Place) -> Entry:
        """The entry that a line with this first field continues."""
        label = name[1:].strip().upper()
        entry = self._last
        assert entry is not None
        before = self._marks.get(id(entry), ())
        if label and label not in before:
            some = list(self._open.get(label, {}).values())
            if len(some) == 1:
                entry = some[0]
            elif some or before:
                entry.fault = _lost(name, place)
            else:
                self._by_order.append((entry, name, place))
        for one in filter(None, self._marks.pop(id(entry), ())):
            del self._open[one][id(entry)]
        return entry

    def find_lost(self) -> None:
        """Note faults where a mark has no continuation, and a continuation no mark."""
        waiting = any(len(own) == 1 and own[0] for own in self._marks.values())
        for entry, name, place in self._by_order if waiting else ():
            entry.fault = entry.fault or _lost(name, place)


def _lost(name: str, place: Place) -> MeshError:
    return place.error(
        f"the continuation {name[:20]!r} does not follow its entry; write it behind "
        "the line that ends with its mark."
    )


class _Collector:
    def __init__(self, sources: Sources, bulk: Bulk, started: bool) -> None:
        self.sources = sources
        self.bulk = bulk
        self.started = started
        self.continuations = Continuations()
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
                try:
                    included = self.sources.enter(named, place)
                except MeshError as error:
                    if self.started:
                        raise
                    self.bulk.told.append(
                        f"{error} It is not read: it stands before the bulk data."
                    )
                    continue
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
        self.bulk.control.read(line)

    def _bulk(self, line: str, place: Place) -> None:
        words = line.upper().split()
        if words[0] == "ENDDATA":
            self.ended = True
            return
        if words[0] == "BEGIN":  # of superelements, after the first
            if words[1:] != ["BULK"]:
                part = _SUPER.search(line) if "MASSID" not in line.upper() else None
                name, number = ("BEGIN SUPER", [part[1]]) if part else ("BEGIN", [])
                self._begin(Entry(name, place, number), "")
            return
        continued, self.continued = self.continued, "," in line and line.rstrip().endswith(",")
        if continued and words[0][0].isdigit() and "," in line:
            line = "," + line
        if words[0].startswith(TEXTS):
            self._begin(Entry(words[0][:6], place), "")
            return
        last = self.bulk.entries[-1].name if self.bulk.entries else ""
        if last in TEXTS and line[0] in " +*,":
            return
        name, fields, large, mark = _fields(line)
        fault = None
        if (name == "GRID" and any(fields[8:])) or any(map(_MARK.match, fields[4:])):
            fault = place.error(
                "a line of free fields ends with the mark of the next line, and one of GRID has up "
                "to 8 fields after its name; write the further ones in a line of their own."
            )
        if name and name[0] == "=":
            self._copy(words[0].split(",")[0], fields, place)
            return
        if not name or name[0] in "+*":
            if not self.bulk.entries:
                raise place.error("a continuation without an entry before it.")
            entry = self.continuations.entry_of(name, place)
            filled = -len(entry.fields) % 8
            if filled and not (large and filled == 4):
                entry.fields += [""] * filled
            entry.fields += fields
            entry.fault = entry.fault or fault
            self.continuations.ends(entry, mark)
            return
        if not name[0].isalpha():
            fault = place.error(f"{name[:20]!r} is not an entry of Nastran's bulk data.")
            if not self.bulk.entries:
                raise fault
            self.bulk.entries[-1].fault = fault
            return
        self._begin(Entry(name.rstrip("*").strip().upper(), place, fields, fault), mark)

    def _begin(self, entry: Entry, mark: str) -> None:
        self.bulk.entries.append(entry)
        self.continuations.ends(entry, mark)

    def _copy(self, name: str, fields: list[str], place: Place) -> None:
        """Copies of the entry before: = the same field, == all of the rest, *(2) more by 2."""
        if not self.bulk.entries:
            raise place.error("a copy (=) without an entry before it.")
        times = 1
        if name != "=":
            times = whole_number(name[1:].strip("()"), place)
            if not 0 < times <= MOST_COPIES or not self.changes:
                raise place.error(f"{name[:20]!r} repeats no copy, or one too often.")
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
            self._begin(own, "")


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


def _fields(line: str) -> tuple[str, list[str], bool, str]:
    """(name, four or eight fields, whether they are large, the mark of the continuation).

    A line of free fields may have more of them: those of the lines that would follow.
    """
    if "," in line:
        first, *rest = (part.strip() for part in line.split(","))
        first, *more = first.split() if first[:1].isalpha() else [first]
        rest = [*more, *rest]  # blanks separate free fields, too
        large = first.endswith("*") or first.startswith("*")
        count = 4 if large else 8
        mark = "".join(rest[count : count + 1])
        if any(rest[count + 1 :]) or _NUMBER.match(mark):  # a line as long as the entry
            return first, rest + [""] * (-len(rest) % count), large, ""
        return first, (rest + [""] * count)[:count], large, mark
    name = line[:8].strip()
    large = "*" in name
    width, count = (16, 4) if large else (8, 8)
    body = line[8 : 8 + width * count].ljust(width * count)
    fields = [body[k * width : (k + 1) * width].strip() for k in range(count)]
    return name, fields, large, line[72:80]


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
