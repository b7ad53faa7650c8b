"""Nastran OUTPUT4: matrices by columns, as text or binary, dense or sparse.

Every matrix has a header (columns, rows, form, type, name), then records of columns: (column, first
row, words) and values. With first row 0 the column is a list of strings, each with its own length
and row: in one word (rows below 65536), or in two where the number of rows is negative ("BIGMAT").
A record of column + 1 ends the matrix. MSC Nastran, *Reference Guide*, OUTPUT4.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
import scipy.sparse
from numpy.typing import NDArray

from antiosc.base._types import Array, Matrix
from antiosc.base.errors import InputError
from antiosc.io.matrices import Entries, Labels, MatrixFormat, Source, fortran, is_text

S = TypeVar("S", bound=np.generic)
#: Rows from which one word does not hold length and row of a string.
BIGMAT_ROWS = 65536
NO_ROWS = np.zeros(0, dtype=np.int64)
#: Form of a symmetric matrix, type of real numbers in double precision.
SYMMETRIC_FORM, DOUBLE = 6, 2


@dataclass(frozen=True)
class _Header:
    columns: int
    rows: int
    kind: int
    name: str
    bigmat: bool


def matches(content: bytes) -> bool:
    """Whether the content begins with the header of an OP4 file."""
    if not is_text(content):
        return _markers(content) is not None
    line = content[:400].split(b"\n")[0].decode("ascii", "replace")
    try:
        _text_header(line)
    except ValueError:
        return False
    return True


def read(source: Source) -> dict[str, Entries]:
    """The matrices of an OP4 file by their names."""
    reader = _Text(source) if is_text(source.content) else _Binary(source)
    found: dict[str, Entries] = {}
    while (header := reader.header()) is not None:
        label, size = f"{source.name}: the matrix {header.name}", header.rows
        if header.kind not in (1, 2):
            raise InputError(f"{label} is complex: stiffness and mass must be real.")
        if size != header.columns or size < 1:
            square = f"must be square; got {size} rows and {header.columns} columns."
            raise InputError(f"{label} {square}")
        rows, columns, values = [], [], []
        for column, row, value in _strings(reader, header):
            if row < 0 or row + len(value) > size:
                told = f"column {column + 1} of {header.name} has {len(value)} entries"
                raise InputError(f"{source.name}: {told} from row {row + 1} of {size} rows.")
            some = np.flatnonzero(value)
            rows.append(row + some)
            columns.append(np.full(len(some), column))
            values.append(value[some])
        at, of = (np.concatenate([NO_ROWS, *part]) for part in (rows, columns))
        entries = np.concatenate([np.zeros(0), *values])
        name = f"{source.name} ({header.name})"
        found[header.name] = Entries(name, at, of, entries, size, triangle=False)
    return found


def _strings(reader: _Text | _Binary, header: _Header) -> Iterator[tuple[int, int, Array]]:
    """(column, first row, values) of each string of entries."""
    lead = 2 if header.bigmat or header.rows >= BIGMAT_ROWS else 1
    text = isinstance(reader, _Text)
    words = 1 if text else reader.words  # of a number of a dense column
    while True:
        reader.begin()
        column, row, count = reader.whole(3)
        if column > header.columns:
            reader.numbers(count if text else 0)
            return
        if column < 1 or count < 0 or (row > 0 and count % words):
            raise reader.bad(f"column {column} of {header.columns} columns has {count} words")
        if row > 0:
            yield column - 1, row - 1, reader.numbers(count // words)
        while row <= 0 and count > 0:
            first, *second = reader.whole(lead)
            length, start = [first, *second] if second else [first >> 16, first & 0xFFFF]
            length -= 1
            count -= length + lead
            if length < 0 or length % reader.words or count < 0:
                raise reader.bad("the length of a string of entries is expected")
            yield column - 1, start - 1, reader.numbers(length // reader.words)


class _Text:
    def __init__(self, source: Source) -> None:
        self._source, self._lines, self._at = source, source.lines(), 0

    def begin(self) -> None:
        """Records are lines."""

    def header(self) -> _Header | None:
        while self._at < len(self._lines) and not self._lines[self._at].strip():
            self._at += 1
        if self._at == len(self._lines):
            return None
        try:
            found, self._per_line, self._width = _text_header(self._line())
        except ValueError:
            raise self.bad("a header of columns, rows, form, type and name is expected") from None
        self.words = found.kind  # of a number in a string
        return found

    def _line(self) -> str:
        self._source.needs(self._at != len(self._lines), self._at, "the file ends within a matrix.")
        self._at += 1
        return self._lines[self._at - 1].decode("ascii", "replace")

    def whole(self, count: int) -> list[int]:
        line = self._line()
        fields = [line[8 * k : 8 * k + 8] for k in range(count)]
        if len(line.rstrip()) > 8 * count:  # |I16, or fields divided by blanks
            fields = line.split()[:count]
        try:
            found = [int(field) for field in fields]
        except ValueError:
            found = []
        if len(found) < count:
            raise self.bad(f"{count} whole numbers are expected")
        return found

    def numbers(self, count: int) -> Array:
        if self._at + -(-count // self._per_line) > len(self._lines):
            raise self._source.error(len(self._lines), "the file ends within a matrix.")
        found = np.empty(count)
        for first in range(0, count, self._per_line):
            text = self._line().encode()
            stop = min(first + self._per_line, count)
            fields = [text[k * self._width :][: self._width] for k in range(stop - first)]
            try:
                found[first:stop] = [float(fortran(field)) for field in fields]
            except ValueError:
                raise self.bad(f"{stop - first} numbers are expected") from None
        return found

    def bad(self, text: str) -> InputError:
        line = self._lines[self._at - 1].decode("ascii", "replace").strip()[:60]
        return self._source.error(self._at, f"{text}; got {line!r}.")


def _text_header(line: str) -> tuple[_Header, int, int]:
    """Header, numbers in a line, and characters of each."""
    width = 16 if line.rstrip().endswith("|I16") else 8
    line = line.rstrip().removesuffix("|I16")
    columns, rows = int(line[:width]), int(line[width : 2 * width])
    rest = line[2 * width :]
    form, kind, name = int(rest[:8]), int(rest[8:16]), rest[16:24].strip()
    layout = rest[24:].strip().upper().removeprefix("1P,").replace("D", "E").partition("E")
    per_line, size = (int(layout[0]), int(layout[2].partition(".")[0])) if layout[2] else (5, 16)
    sound = columns >= 0 and 0 < form < 20 and 0 < kind < 5 and name[:1].isalpha()
    if not sound or per_line < 1 or size < 1:
        raise ValueError(line)
    return _Header(columns, abs(rows), kind, name, rows < 0), per_line, size


def _markers(content: bytes) -> tuple[str, int] | None:
    """(byte order, bytes of an integer) of a binary file."""
    for order in "<>":
        for size, length in ((4, 24), (8, 48)):
            if len(content) >= length + 8:
                (first,) = struct.unpack_from(order + "i", content)
                (last,) = struct.unpack_from(order + "i", content, length + 4)
                if first == last == length:
                    return order, size
    return None


class _Binary:
    def __init__(self, source: Source) -> None:
        found = _markers(source.content)
        if found is None:
            raise source.at_byte(0, "the record marker of an OP4 header is expected.")
        self._order, self._size = found
        self._source, self._at, self._start, self._record = source, 0, 0, b""

    def header(self) -> _Header | None:
        if self._at == len(self._source.content):
            return None
        self.begin()
        if len(self._record) != 6 * self._size:
            raise self.bad("the header of a matrix is expected")
        columns, rows, _, kind = self.whole(4)
        name = self._record[self._next :].decode("ascii", "replace").strip()
        single = kind == 1 and self._size == 4
        self._real = np.dtype(f"{self._order}f{4 if single else 8}")
        self.words = self._real.itemsize // self._size  # of one number
        return _Header(columns, abs(rows), kind, name, rows < 0)

    def begin(self) -> None:
        """One Fortran record: its length, the bytes, the length again."""
        content, at = self._source.content, self._at
        self._start = at
        if at + 4 > len(content):
            raise self._source.at_byte(len(content), "the file ends within a matrix.")
        (length,) = struct.unpack_from(self._order + "i", content, at)
        if length < 0 or at + 8 + length > len(content):
            raise self.bad(f"the file ends within a record of {length} bytes")
        (again,) = struct.unpack_from(self._order + "i", content, at + 4 + length)
        if again != length:
            raise self.bad(f"a record of {length} bytes ends with {again}")
        self._at = at + 8 + length
        self._record, self._next = content[at + 4 : at + 4 + length], 0

    def _values(self, kind: np.dtype[S], count: int) -> NDArray[S]:
        at, self._next = self._next, self._next + count * kind.itemsize
        if count < 0 or self._next > len(self._record):
            size = len(self._record)
            raise self.bad(f"{count} numbers are expected, in a record of {size} bytes")
        return np.frombuffer(self._record, kind, count, at)

    def whole(self, count: int) -> list[int]:
        return list(map(int, self._values(np.dtype(f"{self._order}i{self._size}"), count)))

    def numbers(self, count: int) -> Array:
        return np.asarray(self._values(self._real, count))

    def bad(self, text: str) -> InputError:
        return self._source.at_byte(self._start, f"{text}.")


def write(path: Path, matrices: dict[str, Matrix], labels: Labels) -> None:
    """Write symmetric matrices by name: binary, double precision, little-endian, BIGMAT."""
    with path.open("wb") as out:
        for name, matrix in matrices.items():
            out.writelines(_written(name, scipy.sparse.csc_matrix(matrix)))


def _written(name: str, columns: scipy.sparse.csc_matrix) -> Iterator[bytes]:
    size = columns.shape[0]
    label = name.upper()[:8].ljust(8).encode("ascii")
    yield struct.pack("<5i8si", 24, size, -size, SYMMETRIC_FORM, DOUBLE, label, 24)
    for column in range(size):
        part = slice(columns.indptr[column], columns.indptr[column + 1])
        row, value = columns.indices[part], columns.data[part]
        if not len(row):
            continue
        # strings of neighbouring rows
        cuts = np.flatnonzero(np.diff(row) != 1) + 1
        parts = zip(np.split(row, cuts), np.split(value, cuts), strict=True)
        words = ((struct.pack("<2i", 2 * len(v) + 1, r[0] + 1), v.astype("<f8")) for r, v in parts)
        content = b"".join(lead + v.tobytes() for lead, v in words)
        length = 12 + len(content)
        yield struct.pack("<4i", length, column + 1, 0, len(content) // 4) + content
        yield struct.pack("<i", length)
    yield struct.pack("<4idi", 20, size + 1, 1, 2, 1.0, 20)


FORMAT = MatrixFormat(matches, read, write, (".op4",))
