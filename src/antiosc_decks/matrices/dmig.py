"""Nastran DMIG: a matrix by grid points and components, in bulk data and punch (`.pch`) files.

A header card (name, 0, form, type) and one card for each column: its grid point and component, then
groups of grid point, component and value. Form 6 is one triangle of a symmetric matrix. MSC
Nastran, *Quick Reference Guide*, DMIG.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import scipy.sparse

from antiosc.base._types import Matrix
from antiosc.io.matrices import (
    Entries,
    Labels,
    MatrixFormat,
    Source,
    fortran,
    is_text,
    of_labels,
)
from antiosc_decks.nastran.cards import fields_of

#: Form of one triangle of a symmetric matrix, and of a square matrix with both.
SYMMETRIC_FORM, SQUARE_FORM = 6, 1
#: Grid points are numbered up to this.
MOST_GRID = 2**31


def matches(content: bytes) -> bool:
    """Whether it is a text of which a line begins with DMIG."""
    return is_text(content) and re.search(rb"(?im)^DMIG[ \t*,]", content) is not None


def read(source: Source) -> dict[str, Entries]:
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
    if kind not in (1, 2):
        raise source.error(number, f"DMIG {name} is complex: stiffness and mass must be real.")
    if form not in (SYMMETRIC_FORM, SQUARE_FORM):
        raise source.error(number, f"DMIG {name} has form {form}: 6 (symmetric) or 1 is expected.")
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
    if not 0 < grid < MOST_GRID or not 0 <= component <= 6:
        raise source.error(number, f"grid point {grid} with component {component} does not exist.")
    return grid, component


def _number(source: Source, number: int, text: str) -> float:
    try:
        return float(fortran(text.encode()))
    except ValueError:
        raise source.error(number, f"a number is expected; got {text!r}.") from None


def write(path: Path, matrices: dict[str, Matrix], labels: Labels) -> None:
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


FORMAT = MatrixFormat(matches, read, write, (".pch", ".dmig", ".bdf"), labelled=True)
