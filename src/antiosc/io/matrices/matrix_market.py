"""Matrix Market: a header line, the size, then entries (Boisvert and others, NISTIR 5935)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TextIO

import numpy as np
import scipy.sparse

from antiosc.base._types import Array
from antiosc.io.matrices.formats import Entries, Source

#: First word of the file.
BANNER = b"%%MatrixMarket"


def read(source: Source) -> Entries:
    """The matrix of a Matrix Market file."""
    lines = source.lines()
    words = lines[0].decode("ascii", "replace").lower().split()
    if len(words) < 5 or words[1] != "matrix":
        raise source.error(1, "the header must be '%%MatrixMarket matrix FORMAT FIELD SYMMETRY'.")
    form, field, symmetry = words[2:5]
    if field not in ("real", "integer", "double"):
        raise source.error(1, f"the matrix is {field}: stiffness and mass must be real.")
    if symmetry not in ("general", "symmetric"):
        raise source.error(1, f"the matrix is {symmetry}: stiffness and mass are symmetric.")
    if form not in ("coordinate", "array"):
        raise source.error(1, f"the format must be coordinate or array; got {form!r}.")
    used = [k for k, line in enumerate(lines) if line.strip() and not line.startswith(b"%")]
    source.needs(used, len(lines), "the file ends before the size of the matrix.")
    shape = _shape(source, lines[used[0]], used[0] + 1, 3 if form == "coordinate" else 2)
    if shape[0] != shape[1]:
        raise source.error(
            used[0] + 1, f"the matrix must be square; got {shape[0]} rows and {shape[1]} columns."
        )
    data, numbers = [lines[k] for k in used[1:]], [k + 1 for k in used[1:]]
    read_as: Callable[..., Entries] = _coordinate if form == "coordinate" else _array
    return read_as(source, shape, data, numbers, symmetry == "symmetric")


def _shape(source: Source, line: bytes, number: int, columns: int) -> list[int]:
    values = source.table([line], [number], columns)[0]
    if (values < 1).any() or (values != np.floor(values)).any():
        raise source.error(number, "sizes must be positive whole numbers.")
    return [int(value) for value in values]


def _coordinate(
    source: Source, shape: list[int], lines: list[bytes], numbers: list[int], triangle: bool
) -> Entries:
    size, count = shape[0], shape[2]
    _complete(source, count, lines)
    table = source.table(lines, numbers, 3)
    index = table[:, :2]
    bad = (index < 1) | (index > size) | (index != np.floor(index))
    if bad.any():
        k = int(np.argmax(bad.any(axis=1)))
        raise source.error(
            numbers[k], f"rows and columns are 1 to {size}; got {index[k, 0]:g}, {index[k, 1]:g}."
        )
    row, column = index.astype(np.int64).T - 1
    return Entries(source.name, row, column, table[:, 2], size, triangle)


def _array(
    source: Source, shape: list[int], lines: list[bytes], numbers: list[int], triangle: bool
) -> Entries:
    size = shape[0]
    count = size * (size + 1) // 2 if triangle else size * size
    _complete(source, count, lines)
    value = source.table(lines, numbers, 1)[:, 0]
    # column by column, from the diagonal down where one triangle stands there
    column = np.repeat(np.arange(size), np.arange(size, 0, -1) if triangle else size)
    first = np.cumsum(np.arange(size, 0, -1)) - np.arange(size, 0, -1) if triangle else None
    row = np.arange(count) % size if first is None else np.arange(count) - first[column] + column
    some = value != 0
    return Entries(source.name, row[some], column[some], value[some], size, triangle)


def _complete(source: Source, count: int, lines: list[bytes]) -> None:
    if len(lines) != count:
        last = len(source.lines())
        raise source.error(last, f"the header promises {count:g} entries; there are {len(lines)}.")


def write(out: TextIO, matrix: Any, comment: str = "") -> None:
    """Write a symmetric matrix: its lower triangle, with all digits."""
    lower = scipy.sparse.tril(scipy.sparse.csc_matrix(matrix)).tocoo()
    out.write("%%MatrixMarket matrix coordinate real symmetric\n")
    for line in comment.splitlines():
        out.write(f"% {line}\n")
    out.write(f"{lower.shape[0]} {lower.shape[1]} {lower.nnz}\n")
    rows: tuple[Array, ...] = (lower.row, lower.col, lower.data)
    for i, j, value in zip(*rows, strict=True):
        out.write(f"{i + 1} {j + 1} {float(value)!r}\n")
