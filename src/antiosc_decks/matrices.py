"""Matrices of Nastran (DMIG) and Ansys (Harwell–Boeing).

DMIG is a matrix by grid points and components: a header card (name, 0, form, type), and for each
column a card with its grid point and component, then groups of grid point, component and value.
Form 6 is one triangle. MSC Nastran, *Quick Reference Guide*, DMIG.

Harwell–Boeing, as Ansys HBMAT writes it, has the columns of a matrix in fixed Fortran fields. Duff,
Grimes and Lewis, *Users' guide for the Harwell–Boeing sparse matrix collection*, 1992.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import scipy.sparse

from antiosc.base._types import Array, Matrix
from antiosc.io.matrices import Entries, Labels, MatrixFormat, Source, fortran, is_text, of_labels
from antiosc_decks.nastran_cards import fields_of

#: Form of one triangle of a symmetric matrix, and of a square matrix with both.
SYMMETRIC_FORM, SQUARE_FORM = 6, 1
#: Grid points are numbered up to this.
MOST_GRID = 2**31


def is_dmig(content: bytes) -> bool:
    """Whether it is a text of which a line begins with DMIG."""
    return is_text(content) and re.search(rb"(?im)^DMIG[ \t*,]", content) is not None


def read_dmig(source: Source) -> dict[str, Entries]:
    """The matrices of a file with DMIG cards by their names."""
    forms: dict[str, int] = {}
    tables: dict[str, list[tuple[float, ...]]] = {}
    for number, (name, *fields) in _cards(source):
        name = name.upper()
        if fields[:1] == ["0"]:
            forms[name] = _form(source, number, name, fields)
            tables.setdefault(name, [])
            continue
        source.needs(name in forms, number, f"DMIG {name} has no header card before its columns.")
        column = _label(source, number, fields[:2])
        for k in range(3, len(fields), 4):
            group = fields[k : k + 4]
            if any(group):
                value = _number(source, number, group[2] if len(group) > 2 else "")
                tables[name].append((*_label(source, number, group[:2]), *column, value))
    source.needs(tables, 1, "the file has no DMIG card.")
    source.needs(any(tables.values()), 1, f"the DMIG matrices {', '.join(tables)} have no entries.")
    return {
        name: of_labels(f"{source.name} ({name})", np.array(rows), forms[name] == SYMMETRIC_FORM)
        for name, rows in tables.items()
        if rows
    }


def _form(source: Source, number: int, name: str, fields: list[str]) -> int:
    try:
        form, kind = int(fields[1]), int(fields[2])
    except (ValueError, IndexError):
        raise source.error(number, f"the header of DMIG {name} has no form and type.") from None
    real, known = kind in (1, 2), form in (SYMMETRIC_FORM, SQUARE_FORM)
    source.needs(real, number, f"DMIG {name} is complex: stiffness and mass must be real.")
    source.needs(known, number, f"DMIG {name} has form {form}: 6 (symmetric) or 1 is expected.")
    return form


def _cards(source: Source) -> Iterator[tuple[int, list[str]]]:
    """(line, fields) of each DMIG card with its continuations: its name first."""
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
        card, start = fields if name.rstrip("*").upper() == "DMIG" else [], number
    if card:
        yield start, card


def _label(source: Source, number: int, words: list[str]) -> tuple[int, int]:
    """(grid point, component): 0 for a scalar point."""
    try:
        grid, component = int(words[0]), int(words[1] or 0)
    except (ValueError, IndexError):
        told = f"a grid point and a component are expected; got {' '.join(words)!r}."
        raise source.error(number, told) from None
    there = 0 < grid < MOST_GRID and 0 <= component <= 6
    source.needs(there, number, f"grid point {grid} with component {component} does not exist.")
    return grid, component


def _number(source: Source, number: int, text: str) -> float:
    try:
        return float(fortran(text.encode()))
    except ValueError:
        raise source.error(number, f"a number is expected; got {text!r}.") from None


def write_dmig(path: Path, matrices: dict[str, Matrix], labels: Labels) -> None:
    """Write symmetric matrices by name, rows by their labels (n, 2): large fields, one triangle."""
    with path.open("w") as out:
        for name, matrix in matrices.items():
            out.writelines(_written(name, scipy.sparse.csc_matrix(matrix), labels))


def _written(name: str, matrix: scipy.sparse.csc_matrix, labels: Labels) -> Iterator[str]:
    size = matrix.shape[0]
    yield f"{'DMIG':<8}{name:<8}{0:>8}{SYMMETRIC_FORM:>8}{2:>8}{0:>8}{'':>16}{size:>8}\n"
    lower = scipy.sparse.tril(matrix).tocsc()
    for column, (grid, component) in enumerate(labels):
        part = slice(lower.indptr[column], lower.indptr[column + 1])
        if part.start == part.stop:
            continue
        yield f"{'DMIG*':<8}{name:<16}{grid:>16}{component:>16}\n"
        for row, value in zip(lower.indices[part], lower.data[part], strict=True):
            where = f"{labels[row][0]:>16}{labels[row][1]:>16}"
            yield f"{'*':<8}{where}{_large(float(value)):>16}\n"


def _large(value: float) -> str:
    """A number in 16 characters, the nearest that fits: 12 to 15 digits."""
    mantissa, exponent = f"{value:.16e}".split("e")
    power = f"{int(exponent):+d}"
    texts = [f"{float(mantissa):.{digits}f}{power}" for digits in range(13)]
    texts += [f"{value:.{digits}f}" for digits in range(1, 16)]
    fitting = [text for text in texts if len(text) <= 16 and "." in text]
    return min(fitting, key=lambda text: abs(float(fortran(text.encode())) - value))


DMIG = MatrixFormat(is_dmig, read_dmig, write_dmig, (".pch", ".dmig", ".bdf"), labelled=True)


#: A Fortran format of one kind of number: (10I8), (1P,4E20.12), (3D25.16).
_FORMAT = re.compile(r"\((?:\d*P,?)?(\d*)([IEDFG])(\d+)(?:\.(\d+))?(?:E\d+)?\)")


def is_harwell_boeing(content: bytes) -> bool:
    """Whether the third line is that of a Harwell–Boeing file."""
    lines = content[:2000].splitlines()
    card = rb"[RCPrcp][A-Za-z]{2}\s+\d+\s+\d+\s+\d+"
    return len(lines) >= 4 and re.match(card, lines[2]) is not None


def read_harwell_boeing(source: Source) -> Entries:
    """The matrix of a Harwell–Boeing file; right-hand sides are left aside."""
    lines = source.lines()
    source.needs(len(lines) >= 5, len(lines), "the file ends within its header.")
    cards = _whole(source, lines[1], 2, 4)
    kind = lines[2][:3].decode("ascii", "replace").upper()
    if kind[0] != "R":
        what = {"C": "complex", "P": "a pattern without values"}.get(kind[0], repr(kind))
        raise source.error(3, f"the matrix is {what}: stiffness and mass must be real.")
    told = f"the type must be RSA or RUA (real, symmetric or not, assembled); got {kind!r}."
    source.needs(kind[1] in "SU" and kind[2] == "A", 3, told)
    rows, columns, count = _whole(source, lines[2][3:], 3, 3)[:3]
    square = f"the matrix must be square; got {rows} rows, {columns} columns."
    source.needs(rows == columns and rows >= 1, 3, square)
    size = len(source.content)
    source.needs(count >= 1 and max(count, rows) <= size, 3, f"{count:g} entries in {rows:g} rows "
                 f"are more than a file of {size} bytes holds.")  # fmt: skip
    formats = [_format(source, lines[3][a:b]) for a, b in ((0, 16), (16, 32), (32, 52))]
    first = 5 if len(cards) > 4 and cards[4] > 0 else 4  # a line on the right-hand sides
    blocks: list[Array] = []
    for form, wanted in zip(formats, (columns + 1, count, count), strict=True):
        blocks.append(_fields(source, lines, first, form, wanted))
        first += -(-wanted // form[0])
    pointers, index, value = blocks
    starts = np.diff(pointers)
    rise = pointers[0] == 1 and pointers[-1] == count + 1 and (starts >= 0).all()
    source.needs(rise, 5, f"the column pointers do not rise from 1 to {count + 1}.")
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
    used, there = -(-wanted // per_line), len(lines) - first
    source.needs(there >= used, len(lines), f"the file ends after {there} of {used} lines.")
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


HARWELL_BOEING = MatrixFormat(is_harwell_boeing, read_harwell_boeing)
