"""`Entries`: a matrix as its file holds it, checked before anything of its size is allocated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse

from antiosc.base._types import Array, IntArray
from antiosc.base.errors import InputError

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
            self.source,
            position[self.row],
            position[self.column],
            self.value,
            size,
            self.triangle,
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
