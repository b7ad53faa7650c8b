"""Abaqus `*MATRIX GENERATE`: lines of node, dof, node, dof, value, or of row, column, value.

`*MATRIX OUTPUT` writes the first with FORMAT=MATRIX INPUT and LABELS, the second with
FORMAT=COORDINATE; of symmetric matrices one triangle. Abaqus writes supports as 1e36 on the
diagonal.
"""

from __future__ import annotations

import numpy as np

from antiosc.io.matrices.entries import Entries, of_labels, one_triangle
from antiosc.io.matrices.source import Source


def read(source: Source) -> Entries:
    """The matrix of an Abaqus matrix file."""
    lines, numbers, triangle = [], [], None
    for k, line in enumerate(source.lines()):
        text = line.strip().rstrip(b",")
        if text.startswith(b"*"):
            if not text.startswith(b"**") and b"UNSYMMETRIC" in text.upper().replace(b" ", b""):
                triangle = False
        elif text:
            lines.append(text)
            numbers.append(k + 1)
    source.needs(lines, 1, "the file has no entries.")
    columns = len(lines[0].replace(b",", b" ").split())
    if columns not in (3, 5):
        raise source.error(
            numbers[0],
            "an Abaqus matrix has lines of node, dof, node, dof, value or of row, column, value; "
            f"got {lines[0].decode('ascii', 'replace')[:60]!r}.",
        )
    table = source.table(lines, numbers, columns)
    index = table[:, :-1]
    bad = (index != np.floor(index)) | (np.abs(index) >= 2**31)
    if columns == 3:
        bad |= index < 1
    if bad.any():
        k = int(np.argmax(bad.any(axis=1)))
        raise source.error(numbers[k], "rows, nodes and dofs must be whole numbers.")
    if columns == 5:
        return of_labels(source.name, table, triangle)
    row, column = index.astype(np.int64).T - 1
    size = int(max(row.max(), column.max())) + 1
    if triangle is None:
        triangle = one_triangle(source.name, row, column, size)
    return Entries(source.name, row, column, table[:, 2], size, triangle, counted=False)
