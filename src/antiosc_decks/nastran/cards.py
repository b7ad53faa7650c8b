"""Entries of Nastran's bulk data, in small, large and free fields."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import takewhile, zip_longest

from antiosc.base.errors import MeshError
from antiosc.io.deck import Place, Placed, real_number, whole_number
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
class Entry(Placed):
    """One entry: its name, and its fields without the name, eight per line."""

    name: str
    place: Place
    fields: list[str] = field(default_factory=list)
    #: what is wrong with its lines; an error where the entry is read
    fault: MeshError | None = None

    def text(self, k: int) -> str:
        """Field k (from 0), "" where it is blank."""
        return self.fields[k].strip() if k < len(self.fields) else ""

    def words(self, first: int, stop: int | None = None) -> list[str]:
        """The fields from `first` that are not blank."""
        last = len(self.fields) if stop is None else stop
        return [word for k in range(first, last) if (word := self.text(k))]

    def _filled(self, k: int) -> str:
        self.needs(self.text(k), f"field {k + 2} of {self.name} is empty.")
        return self.text(k)

    def whole(self, k: int, default: int | None = None) -> int:
        """An integer; MeshError if it is none, or missing without a default."""
        if default is not None and not self.text(k):
            return default
        return whole_number(self._filled(k), self.place)

    def number(self, k: int) -> int:
        """The number of a node, a property, … in field k, as no other part of the deck has it."""
        return self.whole(k) + self.place.scope

    def real(self, k: int, default: float | None = 0.0) -> float:
        """A number; MeshError if it is none, or missing without a default."""
        if default is not None and not self.text(k):
            return default
        return real_number("".join(self._filled(k).split()), self.place)

    def reals(self, first: int, stop: int) -> list[float]:
        """The numbers of some fields; 0 where they are blank."""
        return [self.real(k) for k in range(first, stop)]


def motions_of(text: str, place: Place) -> list[int]:
    """Motions 0 to 5 of components such as "123" or "1 2 3"; none of 0 and of a blank."""
    digits = "".join(text.split())
    place.needs(set(digits) <= set("0123456"), f"{text!r} are not components from 1 to 6.")
    return sorted({int(c) - 1 for c in digits} - {-1})


class Continuations:
    """Which entry a continuation belongs to: by its mark (fields 10 and 1), else by order."""

    def __init__(self) -> None:
        #: mark -> entries (by identity) whose last line ends with it
        self._open: dict[str, dict[int, Entry]] = {}
        #: identity of an entry -> the marks of its last line
        self._marks: dict[int, tuple[str, ...]] = {}
        self._last: Entry | None = None
        #: continuations that were joined to the entry before them, which has no mark
        self._by_order: list[tuple[Entry, MeshError]] = []

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
        if entry is None:
            raise place.error("a continuation without an entry before it.")
        before = self._marks.get(id(entry), ())
        if label and label not in before:
            some = list(self._open.get(label, {}).values())
            lost = place.error(f"the continuation {name[:20]!r} does not follow its entry; write "
                               "it behind the line that ends with its mark.")  # fmt: skip
            if len(some) == 1:
                entry = some[0]
            elif some or before:
                entry.fault = lost
            else:
                self._by_order.append((entry, lost))
        for one in filter(None, self._marks.pop(id(entry), ())):
            del self._open[one][id(entry)]
        return entry

    def find_lost(self) -> None:
        """Note faults where a mark has no continuation, and a continuation no mark."""
        waiting = any(len(own) == 1 and own[0] for own in self._marks.values())
        for entry, lost in self._by_order if waiting else ():
            entry.fault = entry.fault or lost


class Bulk:
    """The entries of a deck and of the files that it includes."""

    def __init__(self, sources: Sources) -> None:
        self.entries: list[Entry] = []
        #: number of a property -> its name in a comment
        self.names: dict[int, str] = {}
        #: warnings, one sentence each
        self.told: list[str] = []
        #: what the lines before the bulk data, if there are such, select: (what, number of the
        #: subcase; 0: above all) -> set
        self.selected: dict[tuple[str, int], int] | None = None
        self._subcase = 0
        self._sources = sources
        lines = sources.main()
        # a file without case control contains only bulk data
        self._started = not any(_begins(line.split("$")[0]) for line in lines)
        self._ended = False
        self._continuations = Continuations()
        #: whether the next line continues a list of free fields
        self._continued = False
        #: changes of the fields of the last copied entry
        self._changes: list[str] | None = None
        self._read(lines, sources.name)
        if not self.entries:
            raise MeshError(f"{sources.name} contains no bulk data (GRID, CHEXA, …).")
        self._continuations.find_lost()

    def _read(self, lines: list[str], file: str) -> None:
        number = 0
        while number < len(lines) and not self._ended:
            number += 1
            line, place = lines[number - 1], Place(file, number)
            line, comment, text = line.partition("$")
            for pattern in PROPERTY_NAMES if comment else ():
                if noted := pattern.match("$" + text):
                    self.names[int(noted[1][:18])] = noted[2].strip()
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
                    included = self._sources.enter(named, place)
                except MeshError as error:
                    if self._started:
                        raise
                    self.told.append(f"{error} It is not read: it stands before the bulk data.")
                    continue
                self._read(included, named.strip("'\" "))
                self._sources.leave()
            elif not self._started:
                self._control(line)
            else:
                self._line(line.expandtabs(8), place)

    def _control(self, line: str) -> None:
        if _begins(line):
            self._started = True
            return
        self.selected = self.selected or {}
        self._subcase += bool(_SUBCASE.match(line))
        if match := _SELECTED.match(line):
            self.selected[match[1].upper(), self._subcase] = int(match[2][:18])

    def _line(self, line: str, place: Place) -> None:
        words = line.upper().split()
        if words[0].startswith("ENDDATA"):
            self._ended = True
            return
        if words[0] == "BEGIN":  # of superelements, after the first
            if words[1:] != ["BULK"]:
                part = _SUPER.search(line) if "MASSID" not in line.upper() else None
                name, number = ("BEGIN SUPER", [part[1]]) if part else ("BEGIN", [])
                self._begin(Entry(name, place, number))
            return
        continued, self._continued = self._continued, "," in line and line.endswith(",")
        if continued and words[0][0].isdigit() and "," in line:
            line = "," + line
        if words[0].startswith(TEXTS):
            self._begin(Entry(words[0][:6], place))
            return
        if self.entries and self.entries[-1].name in TEXTS and line[0] in " +*,":
            return
        name, fields, large, mark = fields_of(line)
        fault = None
        if (name == "GRID" and any(fields[8:])) or any(map(_MARK.match, fields[4:])):
            fault = place.error(
                "a line of free fields ends with the mark of the next line, and one of GRID has up "
                "to 8 fields after its name; write the further ones in a line of their own."
            )
        if name[:1] == "=":
            self._copy(words[0].split(",")[0], fields, place)
        elif name[:1] in ("", "+", "*"):
            entry = self._continuations.entry_of(name, place)
            filled = -len(entry.fields) % 8
            if filled and not (large and filled == 4):
                entry.fields += [""] * filled
            entry.fields += fields
            entry.fault = entry.fault or fault
            self._continuations.ends(entry, mark)
        elif name[0].isalpha():
            self._begin(Entry(name.rstrip("*").strip().upper(), place, fields, fault), mark)
        else:
            fault = place.error(f"{name[:20]!r} is not an entry of Nastran's bulk data.")
            if not self.entries:
                raise fault
            self.entries[-1].fault = fault

    def _begin(self, entry: Entry, mark: str = "") -> None:
        self.entries.append(entry)
        self._continuations.ends(entry, mark)

    def _copy(self, name: str, fields: list[str], place: Place) -> None:
        """Copies of the entry before: = the same field, == all of the rest, *(2) more by 2."""
        place.needs(self.entries, "a copy (=) without an entry before it.")
        times = 1
        if name != "=":
            times = whole_number(name[1:].strip("()"), place)
            if not 0 < times <= MOST_COPIES or self._changes is None:
                raise place.error(f"{name[:20]!r} repeats no copy, or one too often.")
        else:
            self._changes = [*takewhile(lambda word: word != "==", fields)]
        for _ in range(times):
            last = self.entries[-1]
            pairs = zip_longest(
                last.fields, (self._changes or [])[: len(last.fields)], fillvalue="="
            )
            self._begin(Entry(last.name, place, [_changed(*pair, place) for pair in pairs]))


def _begins(line: str) -> bool:
    return line.upper().split()[:2] == ["BEGIN", "BULK"]


def _changed(old: str, change: str, place: Place) -> str:
    if not change.startswith("*"):
        return old if change == "=" else change
    step = change[1:].strip("() ")
    if "." in step:
        return repr(real_number(old or "0", place) + real_number(step, place))
    return str(whole_number(old or "0", place) + whole_number(step, place))


def fields_of(line: str) -> tuple[str, list[str], bool, str]:
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
        first = last = whole_number(words[k], place)
        if k + 2 < len(words) and words[k + 1].upper() == "THRU":
            last = whole_number(words[k + 2], place)
            k += 2
        k += 1
        yield first, last
