"""The line of every key and value of a TOML text, which `tomllib` does not give."""

from __future__ import annotations

#: Names of tables and keys, and indices of arrays, from the top of the file to a value.
Place = tuple[str | int, ...]

_SPACE = " \t\r\n"
_QUOTES = ('"""', "'''", '"', "'")


def locations(text: str) -> dict[Place, int]:
    """Place of every key, table and array entry -> its line, from 1; of a valid TOML text."""
    return _Scanner(text).scan()


def line_of(lines: dict[Place, int], place: Place) -> int:
    """The line of a place, or of the closest table around it that is written in the file."""
    while place and place not in lines:
        place = place[:-1]
    return lines.get(place, 1)


class _Scanner:
    """Walks through a text that `tomllib` has accepted, so that it need not check anything."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.at = 0
        self.lines: dict[Place, int] = {}
        #: array of tables -> number of its tables so far
        self.tables: dict[Place, int] = {}
        self._counted, self._line = 0, 1

    def scan(self) -> dict[Place, int]:
        table: Place = ()
        self._skip()
        while self.at < len(self.text):
            if self.text[self.at] == "[":
                table = self._header()
            else:
                self._pair(table)
            self._skip()
        return self.lines

    def _header(self) -> Place:
        line, array = self.line, self.text.startswith("[[", self.at)
        self.at += 2 if array else 1
        *parents, last = self._key()
        self.at += 2 if array else 1
        place: Place = ()
        for name in parents:
            place = self._last((*place, name))
        place = (*place, last)
        if array:
            self.tables[place] = number = self.tables.get(place, -1) + 1
            self.lines.setdefault(place, line)
            place = (*place, number)
        else:
            place = self._last(place)
        self._note(place, line)
        return place

    def _last(self, place: Place) -> Place:
        """The last table of an array of tables; another place itself."""
        return (*place, self.tables[place]) if place in self.tables else place

    def _pair(self, table: Place) -> None:
        line = self.line
        place = (*table, *self._key())
        self.at += 1  # the sign =
        self._note(place, line)
        self._value(place)

    def _key(self) -> list[str]:
        """The parts of a dotted key, and what follows it up to its sign."""
        parts = []
        while True:
            self._skip()
            if self.text[self.at] in "\"'":
                parts.append(self._string())
            else:
                start = self.at
                while self.text[self.at] not in ".=] \t":
                    self.at += 1
                parts.append(self.text[start : self.at])
            self._skip()
            if self.text[self.at] != ".":
                return parts
            self.at += 1

    def _value(self, place: Place) -> None:
        self._skip()
        first = self.text[self.at]
        if first == "[":
            self._array(place)
        elif first == "{":
            self._inline(place)
        elif first in "\"'":
            self._string()
        else:
            while self.at < len(self.text) and self.text[self.at] not in ",]}#\n":
                self.at += 1

    def _array(self, place: Place) -> None:
        self.at += 1
        number = 0
        while self._more("]"):
            self._note((*place, number), self.line)
            self._value((*place, number))
            number += 1

    def _inline(self, place: Place) -> None:
        self.at += 1
        while self._more("}"):
            self._pair(place)

    def _more(self, end: str) -> bool:
        """Whether an entry follows; passes commas and the closing bracket."""
        self._skip()
        if self.text[self.at] == ",":
            self.at += 1
            self._skip()
        if self.text[self.at] == end:
            self.at += 1
            return False
        return True

    def _string(self) -> str:
        """Pass a string; its text, of one in a single line with simple escapes only."""
        quote = next(q for q in _QUOTES if self.text.startswith(q, self.at))
        start = self.at = self.at + len(quote)
        while not self.text.startswith(quote, self.at):
            self.at += 2 if quote[0] == '"' and self.text[self.at] == "\\" else 1
        content = self.text[start : self.at]
        self.at += len(quote)
        while len(quote) == 3 and self.text.startswith(quote[0], self.at):
            self.at += 1  # one or two quotes at the end belong to the text
        return content

    def _skip(self) -> None:
        """Pass white space and comments."""
        while self.at < len(self.text):
            if self.text[self.at] == "#":
                end = self.text.find("\n", self.at)
                self.at = len(self.text) if end < 0 else end
            elif self.text[self.at] in _SPACE:
                self.at += 1
            else:
                return

    def _note(self, place: Place, line: int) -> None:
        for length in range(1, len(place) + 1):
            self.lines.setdefault(place[:length], line)

    @property
    def line(self) -> int:
        """The line of the present position; counted onwards, so that a long file stays quick."""
        self._line += self.text.count("\n", self._counted, self.at)
        self._counted = self.at
        return self._line
