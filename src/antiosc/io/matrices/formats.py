"""Formats of matrix files: a file as bytes and lines, its matrix, and who reads and writes it.

Packages register formats as entry points of `antiosc.matrices`.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse

from antiosc.base import checks
from antiosc.base._types import Array, IntArray
from antiosc.base.errors import InputError
from antiosc.io.registered import loaded, registered

#: Numbers as Fortran writes them: 1.5D+03, 1.5+103 without a letter.
_FORTRAN = re.compile(rb"([0-9.])[dD]([+-]?[0-9])|([0-9.])([+-][0-9]{1,3})(?![0-9.])")


class Source:
    """The content of one file."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        checked = Path(checks.path("path", path))
        self.name = checked.name
        try:
            if not checked.is_file():
                what = "is a folder" if checked.is_dir() else "does not exist"
                raise InputError(f"the matrix file {os.fspath(path)!r} {what}.")
            self.content = checked.read_bytes()
        except OSError as error:
            reason = error.strerror or str(error)
            raise InputError(f"cannot read matrices from {os.fspath(path)!r}: {reason}.") from error
        if not self.content:
            raise InputError(f"{self.name} is empty.")

    def lines(self) -> list[bytes]:
        """Its lines without their ends."""
        return self.content.splitlines()

    def error(self, line: int, text: str) -> InputError:
        """The error for a line, counted from 1."""
        return InputError(f"{self.name}, line {line}: {text}")

    def needs(self, holds: object, line: int, text: str) -> None:
        """Raise the error for a line unless something holds."""
        if not holds:
            raise self.error(line, text)

    def at_byte(self, offset: int, text: str) -> InputError:
        """The error for a place in a binary file."""
        return InputError(f"{self.name}, byte {offset}: {text}")

    def table(self, lines: Sequence[bytes], numbers: Sequence[int], columns: int) -> Array:
        """Lines of `columns` numbers each: (lines, columns); `numbers` are those of the lines."""
        if not lines:
            return np.zeros((0, columns))
        rows = [line.replace(b",", b" ") for line in lines]
        found = _floats(b"\n".join(rows))
        if found is None or any(len(row.split()) != columns for row in rows):
            for row, line, number in zip(rows, lines, numbers, strict=True):
                self._check(row, line, number, columns)
        assert found is not None
        return found.reshape(-1, columns)

    def _check(self, row: bytes, line: bytes, number: int, columns: int) -> None:
        shown = line.decode("ascii", "replace").strip()[:60]
        if len(row.split()) != columns:
            raise self.error(number, f"{columns} numbers are expected; got {shown!r}.")
        if _floats(row) is None:
            raise self.error(number, f"{shown!r} is not {columns} numbers.")


def _floats(text: bytes) -> Array | None:
    """All numbers of a text; None if it contains anything else."""
    try:
        return np.array(text.split(), dtype=float)
    except ValueError:
        pass
    try:
        return np.array(fortran(text).split(), dtype=float)
    except ValueError:
        return None


def fortran(text: bytes) -> bytes:
    """The text with Fortran's exponents as others write them."""
    return _FORTRAN.sub(
        lambda m: m[1] + b"E" + m[2] if m[1] is not None else m[3] + b"E" + m[4], text
    )


def is_text(content: bytes) -> bool:
    """Whether the first bytes are those of a text."""
    head = content[:4096]
    return not any(byte < 9 or 13 < byte < 32 for byte in head)


# --- Entries --------------------------------------------------------------------------------------


#: Columns of a table of labels: node, component.
Labels = IntArray


@dataclass(frozen=True)
class Entries:
    """The entries of a square matrix that stand in a file.

    Attributes
    ----------
    source : name of the file, and of the matrix where it has one
    row, column, value : (entries,), rows counted from 0
    size : number of rows
    triangle : whether the file holds one triangle of a symmetric matrix
    labels : (size, 2) node and component of each row, where the file names them
    counted : whether the file says how many rows there are; otherwise `size` is the last row named
    """

    source: str
    row: IntArray
    column: IntArray
    value: Array
    size: int
    triangle: bool
    labels: Labels | None = None
    counted: bool = True

    def matrix(self) -> scipy.sparse.csr_matrix:
        """The matrix; repeated entries are added."""
        row, column, value = self.row, self.column, self.value
        if self.triangle:
            off = row != column
            row, column = np.append(row, column[off]), np.append(column, row[off])
            value = np.append(value, value[off])
        return scipy.sparse.coo_matrix((value, (row, column)), (self.size, self.size)).tocsr()

    def renumbered(self, position: IntArray, size: int) -> Entries:
        """The same with row i at `position[i]` of `size` rows, without labels."""
        return Entries(
            self.source, position[self.row], position[self.column], self.value, size, self.triangle
        )


def of_labels(source: str, table: Array, triangle: bool | None) -> Entries:
    """Entries of a table (node, component, node, component, value), rows sorted by their labels.

    `triangle` None: the file does not say whether it holds one triangle or both.
    """
    pairs = table[:, :4].reshape(-1, 2).astype(np.int64)
    labels, index = np.unique(pairs, axis=0, return_inverse=True)
    row, column = index.reshape(-1, 2).T
    value = table[:, 4]
    if triangle is None:
        triangle = one_triangle(source, row, column, len(labels))
    return Entries(source, row, column, value, len(labels), triangle, labels)


def one_triangle(source: str, row: IntArray, column: IntArray, size: int) -> bool:
    """Whether off the diagonal no entry has its mirror in the file; InputError for some of them."""
    off = row != column
    keys = row[off].astype(np.int64) * size + column[off]
    mirrored = np.isin(keys, column[off].astype(np.int64) * size + row[off])
    if not mirrored.any():
        return True
    if mirrored.all():
        return False
    i, j = np.column_stack([row[off], column[off]])[int(np.argmin(mirrored))]
    raise InputError(
        f"{source} holds both triangles of the matrix, but of entry ({i}, {j}) only one: symmetric "
        "matrices have one triangle or both."
    )


def checked(entries: Entries) -> Entries:
    """`entries`, or InputError for numbers that are no matrix."""
    source, size = entries.source, entries.size
    bad = ~np.isfinite(entries.value)
    if bad.any():
        k = int(np.argmax(bad))
        raise InputError(
            f"{source} holds {entries.value[k]} at row {entries.row[k] + 1}, column "
            f"{entries.column[k] + 1}: entries must be finite numbers."
        )
    for name, index in (("row", entries.row), ("column", entries.column)):
        out = (index < 0) | (index >= size)
        if out.any():
            raise InputError(
                f"{source} has an entry in {name} {index[int(np.argmax(out))] + 1} of a matrix of "
                f"{size} rows."
            )
    return entries


# --- Formats --------------------------------------------------------------------------------------


class MatrixFormat(NamedTuple):
    """How matrices of one format are recognised, read and written."""

    #: whether a file with this content is of the format
    matches: Callable[[bytes], bool]
    #: the matrix of a file, or several by their names
    read: Callable[[Source], Entries | dict[str, Entries]]
    #: writes symmetric matrices by their names, with node and dof of each row
    write: Callable[[Path, dict[str, Any], Labels], None] | None = None
    #: of the files that are written
    endings: tuple[str, ...] = ()
    #: whether the files hold node and dof of each row
    labelled: bool = False


def formats() -> list[MatrixFormat]:
    """The registered formats."""
    return [loaded(entry, MatrixFormat) for entry in registered("antiosc.matrices")]
