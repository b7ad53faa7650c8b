"""Harwell–Boeing, as Ansys HBMAT writes it: columns of a matrix in fixed Fortran fields.

Duff, Grimes and Lewis, *Users' guide for the Harwell–Boeing sparse matrix collection*, 1992.
"""

from __future__ import annotations

import re

import numpy as np

from antiosc.base._types import Array
from antiosc.io.matrices import Entries, MatrixFormat, Source, fortran

#: A Fortran format of one kind of number: (10I8), (1P,4E20.12), (3D25.16).
_FORMAT = re.compile(r"\((?:\d*P,?)?(\d*)([IEDFG])(\d+)(?:\.(\d+))?(?:E\d+)?\)")


def matches(content: bytes) -> bool:
    """Whether the third line is that of a Harwell–Boeing file."""
    lines = content[:2000].splitlines()
    card = rb"[RCPrcp][A-Za-z]{2}\s+\d+\s+\d+\s+\d+"
    return len(lines) >= 4 and re.match(card, lines[2]) is not None


def read(source: Source) -> Entries:
    """The matrix of a Harwell–Boeing file; right-hand sides are left aside."""
    lines = source.lines()
    source.needs(len(lines) >= 5, len(lines), "the file ends within its header.")
    cards = _whole(source, lines[1], 2, 4)
    kind = lines[2][:3].decode("ascii", "replace").upper()
    if kind[0] != "R":
        what = {"C": "complex", "P": "a pattern without values"}.get(kind[0], repr(kind))
        raise source.error(3, f"the matrix is {what}: stiffness and mass must be real.")
    if kind[1] not in "SU" or kind[2] != "A":
        raise source.error(
            3, f"the type must be RSA or RUA (real, symmetric or not, assembled); got {kind!r}."
        )
    rows, columns, count = _whole(source, lines[2][3:], 3, 3)[:3]
    if rows != columns or rows < 1:
        raise source.error(3, f"the matrix must be square; got {rows} rows, {columns} columns.")
    if count < 1 or max(count, rows) > len(source.content):
        held = f"than a file of {len(source.content)} bytes holds."
        raise source.error(3, f"{count:g} entries in {rows:g} rows are more {held}")
    formats = [_format(source, lines[3][a:b]) for a, b in ((0, 16), (16, 32), (32, 52))]
    first = 5 if len(cards) > 4 and cards[4] > 0 else 4  # a line on the right-hand sides
    blocks: list[Array] = []
    for form, wanted in zip(formats, (columns + 1, count, count), strict=True):
        blocks.append(_fields(source, lines, first, form, wanted))
        first += -(-wanted // form[0])
    pointers, index, value = blocks
    starts = np.diff(pointers)
    if pointers[0] != 1 or pointers[-1] != count + 1 or (starts < 0).any():
        raise source.error(5, f"the column pointers do not rise from 1 to {count + 1}.")
    bad = (index < 1) | (index > rows) | (index != np.floor(index))
    if bad.any():
        raise source.error(first, f"row indices are 1 to {rows}; got {index[bad][0]:g}.")
    column = np.repeat(np.arange(columns), starts.astype(np.int64))
    row = index.astype(np.int64) - 1
    return Entries(source.name, row, column, value, rows, triangle=kind[1] == "S")


def _whole(source: Source, text: bytes, line: int, least: int) -> list[int]:
    try:
        found = [int(word) for word in text.split()]
    except ValueError:
        found = []
    if len(found) < least:
        shown = text.decode("ascii", "replace").strip()[:60]
        raise source.error(line, f"{least} whole numbers are expected; got {shown!r}.")
    return found


def _format(source: Source, text: bytes) -> tuple[int, int]:
    """(numbers in a line, characters of each)."""
    shown = text.decode("ascii", "replace").strip()
    found = _FORMAT.fullmatch(shown.upper().replace(" ", ""))
    if found is None or int(found[3]) == 0 or found[1] == "0":
        raise source.error(4, f"the Fortran format {shown!r} is not one of numbers.")
    return int(found[1] or 1), int(found[3])


def _fields(
    source: Source, lines: list[bytes], first: int, form: tuple[int, int], wanted: int
) -> Array:
    """`wanted` numbers from line `first`; `form`: of a line the numbers, of these the width."""
    per_line, width = form
    used = -(-wanted // per_line)
    if len(lines) < first + used:
        raise source.error(len(lines), f"the file ends after {len(lines) - first} of {used} lines.")
    found = np.empty(wanted)
    at = 0
    for k in range(first, first + used):
        count = min(per_line, wanted - at)
        fields = lines[k].split()
        if len(fields) != count:  # no blank between some of them
            fields = [lines[k][i * width : (i + 1) * width] for i in range(count)]
        try:
            found[at : at + count] = [float(fortran(field)) for field in fields]
        except ValueError:
            shown = lines[k].decode("ascii", "replace").strip()[:60]
            raise source.error(k + 1, f"{count} numbers are expected; got {shown!r}.") from None
        at += count
    return found


FORMAT = MatrixFormat(matches, read)
