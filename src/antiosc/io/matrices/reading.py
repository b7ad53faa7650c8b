"""K and M from files of any format, as one pair of matrices with the labels of their rows."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse

from antiosc.base import checks
from antiosc.base.errors import InputError
from antiosc.io.matrices import matrix_market
from antiosc.io.matrices.formats import (
    Entries,
    Labels,
    Source,
    checked,
    formats,
    is_text,
    of_labels,
    one_triangle,
)


@dataclass(frozen=True)
class Pair:
    """K and M, and (node, component) of each row where the files name them."""

    K: scipy.sparse.csr_matrix
    M: scipy.sparse.csr_matrix
    labels: Labels | None


def read_pair(
    stiffness: str | os.PathLike[str],
    mass: str | os.PathLike[str],
    names: tuple[str, str] | None = None,
) -> Pair:
    """Read K and M.

    Parameters
    ----------
    stiffness, mass : paths
        Matrix Market, Abaqus `*MATRIX GENERATE`, Harwell–Boeing (Ansys HBMAT), Nastran OP4 (text
        or binary) or DMIG; recognised by their content. Both may be one file.
    names : the names of K and M in OP4 and DMIG files that hold more matrices.

    Raises
    ------
    InputError
        A file that is missing, cut, or of another kind; complex, infinite or NaN entries; matrices
        of different sizes or dofs. Says file and line (of binary files the byte).
    """
    pair = (None, None) if names is None else names
    if not isinstance(pair, list | tuple) or len(pair) != 2:
        raise InputError("names must be two, of K and of M: names=('KAA', 'MAA').")
    if names is not None:
        pair = checks.text("names", pair[0]), checks.text("names", pair[1])
    K, M = _one(stiffness, "K", pair[0]), _one(mass, "M", pair[1])
    labels, most = None, max(K.size, M.size)
    K, M = (one if one.counted else replace(one, size=most) for one in (K, M))
    if K.labels is not None and M.labels is not None:
        labels, M = K.labels, _on(K, M)
    elif K.size != M.size:
        raise InputError(
            f"K and M must be of one size: {K.source} has {K.size} rows, {M.source} {M.size}."
        )
    else:
        labels = M.labels if K.labels is None else K.labels
    count = len(K.value) + len(M.value)
    if K.size > count:
        raise InputError(
            f"{K.source} has {K.size:g} rows, but K and M together have {count} entries: "
            "most dofs have neither stiffness nor mass; is the file complete?"
        )
    return Pair(K.matrix(), M.matrix(), labels)


def _on(K: Entries, M: Entries) -> Entries:
    """M on the rows of K, by node and component."""
    assert K.labels is not None
    assert M.labels is not None
    both, index = np.unique(np.vstack([K.labels, M.labels]), axis=0, return_inverse=True)
    index = index.ravel()
    if len(both) > K.size:
        stray = M.labels[int(np.argmax(~np.isin(index[K.size :], index[: K.size])))]
        raise InputError(
            f"{M.source} has dof {stray[1]} of node {stray[0]}, which {K.source} has not: K and M "
            "must be of one model."
        )
    return M.renumbered(index[K.size :], K.size)  # K's labels are sorted, as `both` is


def _one(path: str | os.PathLike[str], letter: str, name: str | None) -> Entries:
    source = Source(path)
    found = _matrices(source)
    if isinstance(found, Entries):
        return checked(found)
    if name is not None:
        wanted = [key for key in found if key.upper() == name.upper()]
    else:
        wanted = list(found)
        if len(found) > 1:
            wanted = [key for key in found if key.upper().startswith(letter)]
    if len(wanted) != 1:
        raise InputError(
            f"{source.name} holds the matrices {', '.join(found)}: say which are K and M, "
            "names=('KAA', 'MAA')."
        )
    return checked(found[wanted[0]])


def _matrices(source: Source) -> Entries | dict[str, Entries]:
    content = source.content
    if content[:14].lower() == matrix_market.BANNER.lower():
        return matrix_market.read(source)
    for form in formats():
        if form.matches(content):
            return form.read(source)
    if not is_text(content):
        raise InputError(
            f"{source.name} is a binary file, but not OP4: it is read as Matrix Market, Abaqus "
            "text, Harwell–Boeing, OP4 or DMIG."
        )
    return read_abaqus(source)


# --- Abaqus ---------------------------------------------------------------------------------------


def read_abaqus(source: Source) -> Entries:
    """The matrix of Abaqus `*MATRIX GENERATE`.

    Lines of node, dof, node, dof, value, or of row, column, value: `*MATRIX OUTPUT` writes the
    first with FORMAT=MATRIX INPUT and LABELS, the second with FORMAT=COORDINATE; of symmetric
    matrices one triangle. Abaqus writes supports as 1e36 on the diagonal.
    """
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
