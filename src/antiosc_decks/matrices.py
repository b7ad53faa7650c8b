"""Matrices of Nastran (DMIG, OUTPUT4) and Ansys (Harwell–Boeing).

DMIG addresses entries by grid points and components: a header card (name, 0, form, type), then for
each column a card with its grid point and component, followed by groups of grid point, component
and value. Form 6 stores one triangle. MSC Nastran, *Quick Reference Guide*, DMIG.

Harwell–Boeing files of Ansys HBMAT store the columns of a matrix in fixed Fortran fields. Duff,
Grimes and Lewis, *Users' guide for the Harwell–Boeing sparse matrix collection*, 1992.

OUTPUT4 stores matrices by columns, as text or binary, dense or sparse. Every matrix has a header
(columns, rows, form, type, name), then records of columns: (column, first row, words) and values.
With first row 0 the column is a list of strings, each with its own length and row: in one word
(rows below 65536), or in two if the number of rows is negative ("BIGMAT"). A record of the last
column + 1 ends the matrix. MSC Nastran, *Reference Guide*, OUTPUT4.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from itertools import product
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.io.matrices import (
    Entries,
    MatrixFile,
    MatrixFormat,
    entries_by_labels,
    is_text,
    with_plain_exponents,
)
from antiosc_decks.nastran_cards import fields_of

#: Form numbers: one triangle of a symmetric matrix; a full square matrix.
SYMMETRIC_FORM = 6
SQUARE_FORM = 1
#: Numbers of grid points are below this.
MAX_GRID_NUMBER = 2**31


def is_dmig(content: bytes) -> bool:
    """Whether the content is text with a line that begins with DMIG."""
    return is_text(content) and re.search(rb"(?im)^DMIG[ \t*,]", content) is not None


def read_dmig(source: MatrixFile) -> dict[str, Entries]:
    """The matrices of a file with DMIG cards, by name."""
    forms: dict[str, int] = {}
    tables: dict[str, list[tuple[float, ...]]] = {}
    for number, (name, *fields) in _dmig_cards(source):
        name = name.upper()
        if fields[:1] == ["0"]:
            forms[name] = _form_number(source, number, name, fields)
            tables.setdefault(name, [])
            continue
        source.needs(name in forms, number, f"DMIG {name} has no header card before its columns.")
        column = _grid_component(source, number, fields[:2])
        for k in range(3, len(fields), 4):
            group = fields[k : k + 4]
            if any(group):
                value = _real_number(source, number, group[2] if len(group) > 2 else "")
                tables[name].append((*_grid_component(source, number, group[:2]), *column, value))

    source.needs(tables, 1, "the file has no DMIG card.")
    source.needs(any(tables.values()), 1, f"the DMIG matrices {', '.join(tables)} have no entries.")
    return {
        name: entries_by_labels(
            f"{source.name} ({name})", np.array(rows), forms[name] == SYMMETRIC_FORM
        )
        for name, rows in tables.items()
        if rows
    }


def _form_number(source: MatrixFile, line: int, name: str, fields: list[str]) -> int:
    """Form number of a DMIG header, which must be real."""
    try:
        form = int(fields[1])
        kind = int(fields[2])
    except (ValueError, IndexError):
        raise source.error(line, f"the header of DMIG {name} has no form and type.") from None
    is_real = kind in (1, 2)
    valid = form in (SYMMETRIC_FORM, SQUARE_FORM)
    source.needs(is_real, line, f"DMIG {name} is complex: stiffness and mass must be real.")
    source.needs(valid, line, f"DMIG {name} has form {form}: 6 (symmetric) or 1 is expected.")
    return form


def _dmig_cards(source: MatrixFile) -> Iterator[tuple[int, list[str]]]:
    """Yields (line, fields) of each DMIG card with its continuations, its name first."""
    card: list[str] = []
    start = 0
    for number, raw in enumerate(source.lines(), 1):
        line = raw.decode("ascii", "replace").partition("$")[0].rstrip().expandtabs(8)
        if not line:
            continue
        name, fields, large, _ = fields_of(line)
        del fields[4 if large else 8 :]
        if name[:1] in ("*", "+", ""):
            card += fields if card else []
            continue
        if card:
            yield start, card
        card = fields if name.rstrip("*").upper() == "DMIG" else []
        start = number
    if card:
        yield start, card


def _grid_component(source: MatrixFile, line: int, words: list[str]) -> tuple[int, int]:
    """(grid point, component) of two fields; component 0 is a scalar point."""
    try:
        grid = int(words[0])
        component = int(words[1] or 0)
    except (ValueError, IndexError):
        message = f"a grid point and a component are expected; got {' '.join(words)!r}."
        raise source.error(line, message) from None
    exists = 0 < grid < MAX_GRID_NUMBER and 0 <= component <= 6
    source.needs(exists, line, f"grid point {grid} with component {component} does not exist.")
    return grid, component


def _real_number(source: MatrixFile, line: int, text: str) -> float:
    """A real number of a DMIG field."""
    try:
        return float(with_plain_exponents(text.encode()))
    except ValueError:
        raise source.error(line, f"a number is expected; got {text!r}.") from None


DMIG = MatrixFormat(is_dmig, read_dmig)


#: A Fortran format of one kind of number: (10I8), (1P,4E20.12), (3D25.16).
_FORTRAN_FORMAT = re.compile(r"\((?:\d*P,?)?(\d*)([IEDFG])(\d+)(?:\.(\d+))?(?:E\d+)?\)")


def is_harwell_boeing(content: bytes) -> bool:
    """Whether the third line has the form of a Harwell–Boeing file."""
    lines = content[:2000].splitlines()
    card = rb"[RCPrcp][A-Za-z]{2}\s+\d+\s+\d+\s+\d+"
    return len(lines) >= 4 and re.match(card, lines[2]) is not None


def read_harwell_boeing(source: MatrixFile) -> Entries:
    """The matrix of a Harwell–Boeing file; right-hand sides are ignored."""
    lines = source.lines()
    source.needs(len(lines) >= 5, len(lines), "the file ends within its header.")
    cards = _integers(source, lines[1], 2, 4)
    kind = lines[2][:3].decode("ascii", "replace").upper()
    if kind[0] != "R":
        kind_text = {"C": "complex", "P": "a pattern without values"}.get(kind[0], repr(kind))
        raise source.error(3, f"the matrix is {kind_text}: stiffness and mass must be real.")
    message = f"the type must be RSA or RUA (real, symmetric or not, assembled); got {kind!r}."
    source.needs(kind[1] in "SU" and kind[2] == "A", 3, message)
    rows, columns, count = _integers(source, lines[2][3:], 3, 3)[:3]
    square = f"the matrix must be square; got {rows} rows, {columns} columns."
    source.needs(rows == columns and rows >= 1, 3, square)
    size = len(source.content)
    too_many = f"{count:g} entries in {rows:g} rows are more than a file of {size} bytes holds."
    source.needs(count >= 1 and max(count, rows) <= size, 3, too_many)
    formats = [_fortran_format(source, lines[3][a:b]) for a, b in ((0, 16), (16, 32), (32, 52))]
    first = 5 if len(cards) > 4 and cards[4] > 0 else 4  # a line on the right-hand sides

    blocks: list[Array] = []
    for form, number_count in zip(formats, (columns + 1, count, count), strict=True):
        blocks.append(_read_numbers(source, lines, first, form, number_count))
        first += -(-number_count // form[0])
    pointers, index, value = blocks
    starts = np.diff(pointers)
    rise = pointers[0] == 1 and pointers[-1] == count + 1 and (starts >= 0).all()
    source.needs(rise, 5, f"the column pointers do not rise from 1 to {count + 1}.")
    invalid = (index < 1) | (index > rows) | (index != np.floor(index))
    if invalid.any():
        raise source.error(first, f"row indices are 1 to {rows}; got {index[invalid][0]:g}.")
    column = np.repeat(np.arange(columns), starts.astype(np.int64))
    row = index.astype(np.int64) - 1

    return Entries(source.name, row, column, value, rows, triangle=kind[1] == "S")


def _integers(source: MatrixFile, text: bytes, line: int, least_count: int) -> list[int]:
    """The integers of a line; at least `least_count`."""
    words = text.split()
    sound = len(words) >= least_count and all(re.fullmatch(rb"[+-]?\d+", word) for word in words)
    got = repr(text.decode("ascii", "replace").strip()[:60])
    source.needs(sound, line, f"{least_count} whole numbers are expected; got {got}.")
    return [int(word) for word in words]


def _fortran_format(source: MatrixFile, text: bytes) -> tuple[int, int]:
    """(numbers in a line, width of a number) of a Fortran format."""
    format_text = text.decode("ascii", "replace").strip()
    match = _FORTRAN_FORMAT.fullmatch(format_text.upper().replace(" ", ""))
    if match is None or int(match[3]) == 0 or match[1] == "0":
        raise source.error(4, f"the Fortran format {format_text!r} is not one of numbers.")
    return int(match[1] or 1), int(match[3])


def _read_numbers(
    source: MatrixFile, lines: list[bytes], first_line: int, form: tuple[int, int], wanted: int
) -> Array:
    """Read `wanted` numbers from line `first_line` on; `form`: numbers in a line, width of one."""
    per_line, width = form
    line_count = -(-wanted // per_line)
    remaining = len(lines) - first_line
    message = f"the file ends within a matrix, after {remaining} of {line_count} lines."
    source.needs(remaining >= line_count, len(lines), message)
    values = np.empty(wanted)
    count_read = 0
    for k in range(first_line, first_line + line_count):
        count = min(per_line, wanted - count_read)
        fields = lines[k].split()
        if len(fields) != count:  # no blank between some of them
            fields = [lines[k][i * width : (i + 1) * width] for i in range(count)]
        try:
            numbers = [float(with_plain_exponents(field)) for field in fields]
            values[count_read : count_read + count] = numbers
        except ValueError:
            line_text = lines[k].decode("ascii", "replace").strip()[:60]
            raise source.error(k + 1, f"{count} numbers are expected; got {line_text!r}.") from None
        count_read += count
    return values


HARWELL_BOEING = MatrixFormat(is_harwell_boeing, read_harwell_boeing)


# --- OUTPUT4 --------------------------------------------------------------------------------------


S = TypeVar("S", bound=np.generic)
#: From this number of rows on, one word cannot hold length and row of a string.
BIGMAT_ROWS = 65536
NO_ROWS = np.zeros(0, dtype=np.int64)


class _Header(NamedTuple):
    """Header of a matrix in an OP4 file."""

    columns: int
    rows: int
    number_type: int
    name: str
    bigmat: bool


def is_op4(content: bytes) -> bool:
    """Whether the content begins with the header of an OP4 matrix."""
    if not is_text(content):
        return _markers(content) is not None
    line = content[:400].split(b"\n")[0].decode("ascii", "replace")
    try:
        _text_header(line)
    except ValueError:
        return False
    return True


def read_op4(source: MatrixFile) -> dict[str, Entries]:
    """The matrices of an OP4 file, by name."""
    reader = _TextReader(source) if is_text(source.content) else _BinaryReader(source)
    matrices: dict[str, Entries] = {}
    while (header := reader.header()) is not None:
        label = f"{source.name}: the matrix {header.name}"
        size = header.rows
        if header.number_type not in (1, 2):
            raise InputError(f"{label} is complex: stiffness and mass must be real.")
        if size != header.columns or size < 1:
            got = f"got {size} rows and {header.columns} columns."
            raise InputError(f"{label} must be square; {got}")

        entries = [(NO_ROWS, NO_ROWS, np.zeros(0))]
        for column, row, value in _column_strings(reader, header):
            if row < 0 or row + len(value) > size:
                message = f"column {column + 1} of {header.name} has {len(value)} entries"
                raise InputError(f"{source.name}: {message} from row {row + 1} of {size} rows.")
            nonzero = np.flatnonzero(value)
            entries.append((row + nonzero, np.full(len(nonzero), column), value[nonzero]))
        rows, columns, values = (np.concatenate(part) for part in zip(*entries, strict=True))
        name = f"{source.name} ({header.name})"
        matrices[header.name] = Entries(name, rows, columns, values, size, triangle=False)

    return matrices


def _column_strings(
    reader: _TextReader | _BinaryReader, header: _Header
) -> Iterator[tuple[int, int, Array]]:
    """Yields (column, first row, values) of each string of entries."""
    word_count = 2 if header.bigmat or header.rows >= BIGMAT_ROWS else 1
    text = isinstance(reader, _TextReader)
    words = 1 if text else reader.words  # of a number of a dense column
    while True:
        reader.begin_record()
        column, row, count = reader.integers(3)
        if column > header.columns:
            reader.numbers(count if text else 0)
            return
        if column < 1 or count < 0 or (row > 0 and count % words):
            told = f"column {column} of {header.columns} columns has {count} words"
            raise reader.record_error(told)
        if row > 0:
            yield column - 1, row - 1, reader.numbers(count // words)
        while row <= 0 and count > 0:
            first, *second = reader.integers(word_count)
            length, start = [first, *second] if second else [first >> 16, first & 0xFFFF]
            length -= 1
            count -= length + word_count
            if length < 0 or length % reader.words or count < 0:
                raise reader.record_error("the length of a string of entries is expected")
            yield column - 1, start - 1, reader.numbers(length // reader.words)


class _TextReader:
    """Reads OP4 records from text."""

    def __init__(self, source: MatrixFile) -> None:
        self._source = source
        self._lines = source.lines()
        self._at = 0

    def begin_record(self) -> None:
        """Do nothing: records of a text are lines."""

    def header(self) -> _Header | None:
        """The next header; None at the end of the file."""
        while self._at < len(self._lines) and not self._lines[self._at].strip():
            self._at += 1
        if self._at == len(self._lines):
            return None
        try:
            header, self._per_line, self._width = _text_header(self._line())
        except ValueError:
            expected = "a header of columns, rows, form, type and name is expected"
            raise self.record_error(expected) from None
        self.words = header.number_type  # of a number in a string
        return header

    def _line(self) -> str:
        """The next line."""
        self._source.needs(self._at != len(self._lines), self._at, "the file ends within a matrix.")
        self._at += 1
        return self._lines[self._at - 1].decode("ascii", "replace")

    def integers(self, count: int) -> list[int]:
        """The first `count` integers of the next line."""
        line = self._line()
        fields = [line[8 * k : 8 * k + 8] for k in range(count)]
        if len(line.rstrip()) > 8 * count:  # |I16, or fields divided by blanks
            fields = line.split()[:count]
        try:
            first, *others = map(int, fields)
        except ValueError:
            raise self.record_error(f"{count} whole numbers are expected") from None
        if len(others) + 1 < count:
            raise self.record_error(f"{count} whole numbers are expected")
        return [first, *others]

    def numbers(self, count: int) -> Array:
        """The next `count` real numbers."""
        first = self._at
        form = (self._per_line, self._width)
        self._at += -(-count // self._per_line)
        return _read_numbers(self._source, self._lines, first, form, count)

    def record_error(self, text: str) -> InputError:
        """The error of the current line, with the sentence `text`."""
        line = self._lines[self._at - 1].decode("ascii", "replace").strip()[:60]
        return self._source.error(self._at, f"{text}; got {line!r}.")


def _text_header(line: str) -> tuple[_Header, int, int]:
    """(header, numbers in a line, width of a number) of a text line."""
    width = 16 if line.rstrip().endswith("|I16") else 8
    line = line.rstrip().removesuffix("|I16")
    columns = int(line[:width])
    rows = int(line[width : 2 * width])
    tail = line[2 * width :]
    form = int(tail[:8])
    kind = int(tail[8:16])
    name = tail[16:24].strip()
    layout = tail[24:].strip().upper().removeprefix("1P,").replace("D", "E").partition("E")
    per_line, size = (int(layout[0]), int(layout[2].partition(".")[0])) if layout[2] else (5, 16)
    sound = columns >= 0 and 0 < form < 20 and 0 < kind < 5 and name[:1].isalpha()
    if not sound or per_line < 1 or size < 1:
        raise ValueError(line)
    return _Header(columns, abs(rows), kind, name, rows < 0), per_line, size


def _markers(content: bytes) -> tuple[str, int] | None:
    """(byte order, size of an integer in bytes) of a binary file; None if it is not OP4."""
    for order, (size, length) in product("<>", ((4, 24), (8, 48))):
        if len(content) >= length + 8:
            ends = (struct.unpack_from(order + "i", content, at)[0] for at in (0, length + 4))
            if {*ends} == {length}:
                return order, size
    return None


class _BinaryReader:
    """Reads OP4 records from a binary file."""

    def __init__(self, source: MatrixFile) -> None:
        markers = _markers(source.content)
        if markers is None:
            raise source.error_at_byte(0, "the record marker of an OP4 header is expected.")
        self._order, self._size = markers
        self._source = source
        self._at = 0
        self._start = 0
        self._record = b""

    def header(self) -> _Header | None:
        """The next header; None at the end of the file."""
        if self._at == len(self._source.content):
            return None
        self.begin_record()
        if len(self._record) != 6 * self._size:
            raise self.record_error("the header of a matrix is expected")
        columns, rows, _, kind = self.integers(4)
        name = self._record[self._next :].decode("ascii", "replace").strip()
        single = kind == 1 and self._size == 4
        self._real = np.dtype(f"{self._order}f{4 if single else 8}")
        self.words = self._real.itemsize // self._size  # of one number
        return _Header(columns, abs(rows), kind, name, rows < 0)

    def begin_record(self) -> None:
        """Read one Fortran record: its length, its bytes, the length again."""
        content = self._source.content
        offset = self._at
        self._start = offset
        if offset + 4 > len(content):
            raise self._source.error_at_byte(len(content), "the file ends within a matrix.")
        (length,) = struct.unpack_from(self._order + "i", content, offset)
        if length < 0 or offset + 8 + length > len(content):
            raise self.record_error(f"the file ends within a record of {length} bytes")
        (closing_length,) = struct.unpack_from(self._order + "i", content, offset + 4 + length)
        if closing_length != length:
            raise self.record_error(f"a record of {length} bytes ends with {closing_length}")
        self._at = offset + 8 + length
        self._record = content[offset + 4 : offset + 4 + length]
        self._next = 0

    def _values(self, kind: np.dtype[S], count: int) -> NDArray[S]:
        """The next `count` numbers of the record."""
        offset = self._next
        self._next += count * kind.itemsize
        if count < 0 or self._next > len(self._record):
            size = len(self._record)
            raise self.record_error(f"{count} numbers are expected, in a record of {size} bytes")
        return np.frombuffer(self._record, kind, count, offset)

    def integers(self, count: int) -> list[int]:
        """The next `count` integers of the record."""
        return list(map(int, self._values(np.dtype(f"{self._order}i{self._size}"), count)))

    def numbers(self, count: int) -> Array:
        """The next `count` real numbers of the record."""
        return self._values(self._real, count)

    def record_error(self, text: str) -> InputError:
        """The error of the current record, with the sentence `text`."""
        return self._source.error_at_byte(self._start, f"{text}.")


OP4 = MatrixFormat(is_op4, read_op4)
