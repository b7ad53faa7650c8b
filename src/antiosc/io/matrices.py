"""Files of stiffness and mass matrices: formats, Matrix Market, and pairs of K and M.

Packages register formats as entry points of `antiosc.matrices`. A Matrix Market file has a header
line, the size and the entries (Boisvert and others, NISTIR 5935).
"""

from __future__ import annotations

import inspect
import io
import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import scipy.io
import scipy.sparse

from antiosc.base import checks
from antiosc.base._types import Array, IntArray
from antiosc.base.errors import InputError
from antiosc.io.isolation import entry_points_of, load_entry_point

#: What is told of a table of entries.
WHOLE_NUMBERS_RULE = "rows, nodes and dofs must be whole numbers."
#: Numbers as Fortran writes them: 1.5D+03, 1.5+103 without a letter.
_FORTRAN_NUMBERS = re.compile(rb"([0-9.])[dD]([+-]?[0-9])|([0-9.])([+-][0-9]{1,3})(?![0-9.])")


class MatrixFile:
    """The content of one matrix file."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        file = Path(checks.path("path", path))
        self.name = file.name
        if not file.is_file():
            raise InputError(f"there is no matrix file {os.fspath(path)!r}.")

        try:
            self.content = file.read_bytes()
        except OSError as error:
            raise InputError(f"cannot read matrices from {os.fspath(path)!r}: {error}.") from error
        if not self.content:
            raise InputError(f"{self.name} is empty.")

    def lines(self) -> list[bytes]:
        """The lines of the file, without line ends."""
        return self.content.splitlines()

    def error(self, line: int, text: str) -> InputError:
        """An InputError that names the file and the line (from 1) before the sentence `text`."""
        return InputError(f"{self.name}, line {line}: {text}")

    def needs(self, holds: object, line: int, text: str) -> None:
        """Raise `error(line, text)` unless the condition `holds` is true."""
        if not holds:
            raise self.error(line, text)

    def error_at_byte(self, offset: int, text: str) -> InputError:
        """An InputError that names the file and the byte `offset` before the sentence `text`."""
        return InputError(f"{self.name}, byte {offset}: {text}")

    def table(self, lines: Sequence[bytes], numbers: Sequence[int], columns: int) -> Array:
        """Values (n, columns) of n lines of a table; `numbers`: line numbers, for errors."""
        rows = [line.replace(b",", b" ") for line in lines]
        values = _floats(b"\n".join(rows))
        if values is None or any(len(row.split()) != columns for row in rows):
            for row, number in zip(rows, numbers, strict=True):
                if len(row.split()) != columns or _floats(row) is None:
                    raise self.error(number, f"{columns} numbers are expected; got {_quoted(row)}.")
        assert values is not None
        return values.reshape(-1, columns)

    def rows(self, lines: Sequence[bytes], numbers: Sequence[int], size: int | None) -> Entries:
        """Entries of lines (row, column, value); `size`: row count, None: highest row or column."""
        table = self.table(lines, numbers, 3)
        whole = (table[:, :2] % 1 == 0) & (table[:, :2] >= 1) & (table[:, :2] < 2**31)
        self.needs(whole.all(), numbers[int(whole.all(axis=1).argmin())], WHOLE_NUMBERS_RULE)

        row, column = table[:, :2].astype(np.int64).T - 1
        count = int(max(row.max(), column.max())) + 1 if size is None else size
        triangle = has_one_triangle(self.name, row, column, count)
        return Entries(
            self.name, row, column, table[:, 2], count, triangle, size_is_stated=size is not None
        )


def _floats(text: bytes) -> Array | None:
    """All numbers (n,) of a text; None if it does not consist of numbers."""
    try:
        return np.array(text.split(), dtype=float)
    except ValueError:
        pass

    try:
        return np.array(with_plain_exponents(text).split(), dtype=float)
    except ValueError:
        return None


def with_plain_exponents(text: bytes) -> bytes:
    """The text with Fortran's numbers (1D+3) written as 1E+3."""
    return _FORTRAN_NUMBERS.sub(
        lambda m: m[1] + b"E" + m[2] if m[1] is not None else m[3] + b"E" + m[4], text
    )


def is_text(content: bytes) -> bool:
    """Whether the first bytes of a file are text."""
    return not any(byte < 9 or 13 < byte < 32 for byte in content[:4096])


# --- Entries --------------------------------------------------------------------------------------


#: Columns of a table of labels: node, component.
Labels = IntArray


@dataclass(frozen=True)
class Entries:
    """Entries of a square matrix in the order of the file; rows and columns count from 0."""

    source: str  # names of the file and of the matrix
    row: IntArray
    column: IntArray
    value: Array
    size: int  # number of rows
    triangle: bool  # whether it is one triangle of a symmetric matrix
    labels: Labels | None = None  # (size, 2) node and component of each row, if the file has them
    size_is_stated: bool = True  # whether the file says its size, which else is the last row named

    def matrix(self) -> scipy.sparse.csr_matrix:
        """The sparse matrix; repeated entries are added."""
        where = self.row, self.column
        A = scipy.sparse.coo_matrix((self.value, where), (self.size, self.size)).tocsr()
        if not self.triangle:
            return A
        return (A + A.T - scipy.sparse.diags(A.diagonal())).tocsr()


def entries_by_labels(source: str, table: Array, triangle: bool | None) -> Entries:
    """Entries from rows (node, component, node, component, value) of `table`. `triangle`: whether
    only one triangle of the symmetric matrix is listed; None: determine it."""
    pairs = table[:, :4].reshape(-1, 2).astype(np.int64)
    labels, index = np.unique(pairs, axis=0, return_inverse=True)
    row, column = index.reshape(-1, 2).T
    value = table[:, 4]
    if triangle is None:
        triangle = has_one_triangle(source, row, column, len(labels))
    return Entries(source, row, column, value, len(labels), triangle, labels)


def has_one_triangle(source: str, row: IntArray, column: IntArray, size: int) -> bool:
    """Whether one triangle of a matrix is listed; InputError if only some entries are mirrored."""
    off_diagonal = row != column
    keys = row[off_diagonal].astype(np.int64) * size + column[off_diagonal]
    mirrored = np.isin(keys, column[off_diagonal].astype(np.int64) * size + row[off_diagonal])
    if not mirrored.any():
        return True
    if mirrored.all():
        return False
    i, j = np.column_stack([row[off_diagonal], column[off_diagonal]])[int(np.argmin(mirrored))]
    both = f"{source} holds both triangles of the matrix"
    raise InputError(f"{both}, but of entry ({i}, {j}) only one.")


def checked_entries(entries: Entries) -> Entries:
    """Returns `entries`; InputError if a value is not finite, or a row or column out of range."""
    source, size = entries.source, entries.size
    bad = ~np.isfinite(entries.value)
    if bad.any():
        k = int(np.argmax(bad))
        raise InputError(
            f"{source} holds {entries.value[k]} at row {entries.row[k] + 1}, column "
            f"{entries.column[k] + 1}: entries must be finite numbers."
        )

    for name, index in (("row", entries.row), ("column", entries.column)):
        bad = (index < 0) | (index >= size)
        if bad.any():
            where = f"{name} {index[int(np.argmax(bad))] + 1}"
            raise InputError(f"{source} has an entry in {where} of a matrix of {size} rows.")

    return entries


# --- Formats --------------------------------------------------------------------------------------


class MatrixFormat(NamedTuple):
    """A file format of matrices: how to recognise and read it."""

    matches: Callable[[bytes], bool]  # whether a file with this content is of the format
    #: the matrix of a file, or several by their names
    read: Callable[[MatrixFile], Entries | dict[str, Entries]]


#: First word of the file.
MATRIX_MARKET_BANNER = b"%%MatrixMarket"


def read_matrix_market(source: MatrixFile) -> Entries:
    """The matrix of a Matrix Market file, read by SciPy."""
    lines = source.lines()
    words = lines[0].decode("ascii", "replace").lower().split()
    header_text = "the header must be '%%MatrixMarket matrix FORMAT FIELD SYMMETRY'."
    source.needs(len(words) >= 5 and words[1] == "matrix", 1, header_text)
    field, symmetry = words[3:5]
    is_real = field in ("real", "integer", "double")
    source.needs(is_real, 1, f"the matrix is {field}: stiffness and mass must be real.")
    symmetric = symmetry in ("general", "symmetric")
    source.needs(symmetric, 1, f"the matrix is {symmetry}: stiffness and mass are symmetric.")

    # SciPy waits for a size, and allocates what the file promises
    numbers_follow = (line.split() for line in lines if line.strip() and line[:1] != b"%")
    size = next(numbers_follow, None)
    source.needs(size, len(lines), "the file ends before the size of the matrix.")
    assert size is not None

    if all(number.isdigit() for number in size):
        numbers = [float(number) for number in size]
        promised = numbers[-1] if len(numbers) > 2 else np.prod(numbers) / 2
        if promised > len(source.content):
            raise InputError(f"{source.name} promises {promised:.3g} entries: it is cut off.")

    header, _, rest = source.content.partition(b"\n")
    content = header.replace(b"double", b"real") + b"\n" + with_plain_exponents(rest)
    newer = "spmatrix" in inspect.signature(scipy.io.mmread).parameters
    options = {"spmatrix": True} if newer else {}

    try:
        matrix = scipy.sparse.coo_matrix(scipy.io.mmread(io.BytesIO(content), **options))
    except Exception as error:  # its parser raises many kinds
        reason = " ".join(str(error).split())[:120].rstrip(".") or type(error).__name__
        raise InputError(f"{source.name} is cut off or damaged: {reason}.") from error

    rows, columns = matrix.shape
    square = f"the matrix must be square; got {rows} rows and {columns} columns."
    source.needs(rows == columns, 1, square)
    row, column = (index.astype(np.int64) for index in (matrix.row, matrix.col))
    return Entries(source.name, row, column, matrix.data.astype(float), rows, False)


@dataclass(frozen=True)
class MatrixPair:
    """K and M, and labels (n, 2), node and component, of their rows if the files give them."""

    K: scipy.sparse.csr_matrix
    M: scipy.sparse.csr_matrix
    labels: Labels | None


def read_pair(
    stiffness: str | os.PathLike[str],
    mass: str | os.PathLike[str],
    names: tuple[str, str] | None = None,
) -> MatrixPair:
    """Read K and M from files of any format; `names`: their names in files of several matrices."""
    pair = (None, None) if names is None else names
    if not isinstance(pair, list | tuple) or len(pair) != 2:
        raise InputError("names must be two, of K and of M: names=('KAA', 'MAA').")
    K = _matrix_of(stiffness, "K", pair[0])
    M = _matrix_of(mass, "M", pair[1])

    size = max(K.size, M.size)
    K, M = (matrix if matrix.size_is_stated else replace(matrix, size=size) for matrix in (K, M))
    labels = M.labels if K.labels is None else K.labels

    if K.labels is not None and M.labels is not None:
        M = _mass_in_order_of(K, M)
    elif K.size != M.size:
        raise InputError(f"K and M differ in size: {K.source} {K.size} rows, {M.source} {M.size}.")

    count = len(K.value) + len(M.value)
    if K.size > count:
        raise InputError(
            f"{K.source} has {K.size:g} rows, but {count} entries with M: is the file complete?"
        )

    return MatrixPair(K.matrix(), M.matrix(), labels)


def _mass_in_order_of(K: Entries, M: Entries) -> Entries:
    """M with its rows in K's order, matched by their labels (node, component)."""
    assert K.labels is not None
    assert M.labels is not None
    all_labels, index = np.unique(np.vstack([K.labels, M.labels]), axis=0, return_inverse=True)
    index = index.ravel()
    if len(all_labels) > K.size:
        stray = M.labels[int(np.argmax(~np.isin(index[K.size :], index[: K.size])))]
        dof = f"dof {stray[1]} of node {stray[0]}"
        raise InputError(f"{M.source} has {dof}, which {K.source} has not.")
    row = index[K.size :]  # K's labels are sorted, as all are
    return replace(M, row=row[M.row], column=row[M.column], size=K.size)


def _matrix_of(path: str | os.PathLike[str], letter: str, name: str | None) -> Entries:
    """The matrix `name` of a file; default: its only one, or the one that begins with `letter`."""
    source = MatrixFile(path)
    matrices = _matrices(source)
    if isinstance(matrices, Entries):
        return checked_entries(matrices)

    matching_keys = list(matrices)
    if name is not None:
        wanted = checks.text("names", name).upper()
        matching_keys = [key for key in matrices if key.upper() == wanted]
    elif len(matrices) > 1:
        matching_keys = [key for key in matrices if key.upper().startswith(letter)]

    if len(matching_keys) != 1:
        raise InputError(
            f"{source.name} holds {', '.join(matrices)}: give names=('KAA', 'MAA') of K and M."
        )

    return checked_entries(matrices[matching_keys[0]])


def _matrices(source: MatrixFile) -> Entries | dict[str, Entries]:
    """The matrix of a file, or its matrices by name; the format is found by the content."""
    content = source.content
    if content[:14].lower() == MATRIX_MARKET_BANNER.lower():
        return read_matrix_market(source)
    if re.match(rb"\s*function +a *=", content):
        return read_sierra(source)
    for entry in entry_points_of("antiosc.matrices"):
        form = load_entry_point(entry, MatrixFormat)
        if form.matches(content):
            return form.read(source)

    if not is_text(content):
        raise InputError(
            f"{source.name} is a binary file, but not OP4: it is read as Matrix Market, Abaqus or "
            "Sierra/SD text, Harwell–Boeing, OP4 or DMIG."
        )

    return read_abaqus(source)


# --- Sierra/SD ------------------------------------------------------------------------------------


def read_sierra(source: MatrixFile) -> Entries:
    """The matrix in a MATLAB function written by Sierra/SD: lines of row, column, value."""
    lines = [line.strip() for line in source.lines()]
    size = re.search(rb"NumRows *= *(\d+)", source.content)
    source.needs(size and b"a=[" in lines, 1, "'NumRows =' and 'a=[' are expected before entries.")
    assert size is not None
    first = lines.index(b"a=[") + 1
    source.needs(b"];" in lines[first:], len(lines), "the file ends before '];': it is cut off.")
    last = lines.index(b"];", first)
    source.needs(last > first, first, "the matrix has no entries.")

    entries = [line.rstrip(b";") for line in lines[first:last]]
    return source.rows(entries, range(first + 1, last + 1), int(size[1]))


# --- Abaqus ---------------------------------------------------------------------------------------


def read_abaqus(source: MatrixFile) -> Entries:
    """Matrix of `*MATRIX GENERATE`: node, dof, node, dof, value, or row, column, value."""
    texts = {k: line.strip().rstrip(b",") for k, line in enumerate(source.lines(), 1)}
    entries = {k: text for k, text in texts.items() if text and not text.startswith(b"*")}
    source.needs(entries, 1, "the file has no entries.")
    lines, numbers = list(entries.values()), list(entries)
    columns = len(lines[0].replace(b",", b" ").split())
    if columns == 3:
        return source.rows(lines, numbers, None)

    source.needs(
        columns == 5,
        numbers[0],
        "an Abaqus matrix has lines of node, dof, node, dof, value or of row, column, value; "
        f"got {_quoted(lines[0])}.",
    )
    table = source.table(lines, numbers, columns)
    whole = ((table[:, :4] % 1 == 0) & (np.abs(table[:, :4]) < 2**31)).all(axis=1)
    source.needs(whole.all(), numbers[int(whole.argmin())], WHOLE_NUMBERS_RULE)
    return entries_by_labels(source.name, table, None)


#: Distance [m] up to which a node that two bodies share is at one place in both.
SAME_PLACE_DISTANCE = 1e-6
#: Largest number of a dof: Abaqus's temperatures have 11 to 30.
LARGEST_DOF_NUMBER = 30
#: Displacements and rotations of a node by their numbers 1 to 6.
DISPLACEMENTS = ("x", "y", "z")
ROTATIONS = ("rx", "ry", "rz")
COMPONENTS = (*DISPLACEMENTS, *ROTATIONS)
#: The same in Ansys's mapping files and in Nastran's tables.
_NUMBER_OF_COMPONENT = {
    **{name: k + 1 for k, name in enumerate(COMPONENTS)},
    **{name: k + 1 for k, name in enumerate(("ux", "uy", "uz", "rotx", "roty", "rotz"))},
    **{name: k + 1 for k, name in enumerate(("t1", "t2", "t3", "r1", "r2", "r3"))},
}


@dataclass(frozen=True, eq=False)
class DofMap:
    """(node, component) of each of the n rows of K and M, and the coordinates of its node."""

    node: IntArray  # (n,) numbers of nodes in the other program
    #: (n,) 1 to 6 for x, y, z, rx, ry, rz along the axes of `points`; 0 or more than 6 for others
    component: IntArray
    points: Array  # (n, 3) m; NaN where they are not known

    @property
    def located(self) -> bool:
        """Whether coordinates of nodes are known."""
        return bool(np.isfinite(self.points).all(axis=1).any())

    def row(self, node: int, component: int) -> int:
        """The row of a component of a node; InputError if there is none."""
        rows = self.rows(node)
        matches = rows[self.component[rows] == component]
        if not len(matches):
            components = ", ".join(component_name(int(k)) for k in self.component[rows])
            raise InputError(
                f"node {node} has no dof {component_name(component)} in the matrices: it has "
                f"{components} (fixed dofs are left out by most programs)."
            )

        return int(matches[0])

    def rows(self, node: int) -> IntArray:
        """All rows of a node; InputError if there is none."""
        rows = np.flatnonzero(self.node == node)
        if not len(rows):
            raise InputError(f"node {node} is not in the matrices' map of nodes and dofs.")
        return rows


def component_name(component: int) -> str:
    """Name of a component: x, y, z, rx, ry or rz, or its number as text."""
    return COMPONENTS[component - 1] if 1 <= component <= 6 else str(component)


def component_number(dof: object) -> int:
    """Component number for a name (x, ux, t1, …) or number; InputError if it is unknown."""
    if not isinstance(dof, str):
        return checks.whole("dof", dof, least=0)
    component = _NUMBER_OF_COMPONENT.get(dof.strip().lower())
    if component is not None:
        return component
    if dof.strip().isdigit():
        return int(dof)
    raise InputError(
        f"dof must be one of {', '.join(COMPONENTS)} or a number; got {checks.shown(dof)}."
    )


def supported_rows(supports: object, rows: DofMap | None) -> IntArray:
    """Rows (n,), ascending, of the dofs fixed by supports {node: "all" or names of dofs}."""
    if rows is None:
        raise InputError("supports by nodes need a map of the nodes and dofs of the matrices.")
    expected = "a dict of node -> 'all' or names of dofs"
    supports_of = checks.instance("supports", supports, Mapping, expected)
    row_numbers: list[int] = []
    for node, dofs in supports_of.items():
        number = checks.whole("a node of supports", node)
        names = list(dofs) if isinstance(dofs, list | tuple) else [dofs]
        if names == ["all"]:
            row_numbers += rows.rows(number).tolist()
        else:
            row_numbers += [rows.row(number, component_number(name)) for name in names]

    return np.unique(np.array(row_numbers, dtype=np.int64))


def dof_map(source: object, labels: Labels | None, size: int) -> DofMap | None:
    """The map of `size` rows given by `source`, in any form of `from_matrices`; `labels`: (node,
    component) of rows in matrix files."""
    if source is None:
        if labels is None:
            return None
        return DofMap(labels[:, 0], labels[:, 1], np.full((size, 3), np.nan))
    name = "map"
    if isinstance(source, str | os.PathLike):
        name, table = _read_map(MatrixFile(source))
    elif isinstance(source, tuple) and all(isinstance(s, str | os.PathLike) for s in source[:2]):
        name, table = _map_of_sierra(*map(MatrixFile, source))
    elif isinstance(source, tuple) and 2 <= len(source) <= 3 and size > 3:
        table = _map_of_columns(source, size)
    else:
        table = checks.floats("map", source, (None, None))

    if table.shape[1] == 4:
        return _with_coordinates(name, table, labels)

    if table.shape[1] == 3:  # row, node, dof
        order = np.argsort(table[:, 0], kind="stable")
        if not np.array_equal(table[order, 0], np.arange(1, len(table) + 1)):
            raise InputError(f"the first column of {name} must number the rows from 1 to {size}.")
        table = table[order, 1:]

    if table.shape[1] not in (2, 5) or len(table) != size:
        rows, columns = table.shape
        raise InputError(
            f"{name} must have a row of node, dof or of node, dof, x, y, z for each of the {size} "
            f"rows of the matrices, or rows of node, x, y, z; got {rows} rows of {columns} numbers."
        )

    pairs = table[:, :2].astype(np.int64)
    outside = (pairs < 0).any(axis=1) | (pairs[:, 1] > LARGEST_DOF_NUMBER)
    bad = outside | (pairs != table[:, :2]).any(axis=1)
    if bad.any():
        node, dof = table[bad.argmax(), :2]
        raise InputError(
            f"{name} gives nodes and dofs as whole numbers, of x, y, z, rx, ry, rz 1 to 6, of "
            f"others 0 or up to {LARGEST_DOF_NUMBER}; got node {node:g}, dof {dof:g}."
        )
    if len(np.unique(pairs, axis=0)) < size:
        raise InputError(f"{name} names one dof of a node twice.")
    points = table[:, 2:] if table.shape[1] == 5 else np.full((size, 3), np.nan)
    return DofMap(pairs[:, 0], pairs[:, 1], points)


def _map_of_columns(columns: tuple[object, ...], size: int) -> Array:
    """Table (size, 2 or 5) of node, dof and perhaps x, y, z, each given as a sequence."""
    nodes = checks.floats("the nodes of map", columns[0], (size,))
    dofs = columns[1] if isinstance(columns[1], list | tuple | np.ndarray) else [columns[1]]
    numbers = [component_number(dof.item() if isinstance(dof, np.generic) else dof) for dof in dofs]
    if len(numbers) != size:
        raise InputError(f"map needs a dof for each of the {size} rows; got {len(numbers)}.")
    points = [checks.floats("the points of map", x, (size, 3)) for x in columns[2:]]
    return np.column_stack([nodes, numbers, *points])


def _with_coordinates(name: str, table: Array, labels: Labels | None) -> DofMap:
    """The map with the matrices' `labels` and coordinates from rows node, x, y, z of `table`."""
    if labels is None:
        raise InputError(
            f"{name} must have rows of node, dof, x, y, z: the files do not name the nodes of rows."
        )

    place = {node: x for node, *x in table.tolist()}
    points = np.array([place.get(node, [np.nan] * 3) for node in labels[:, 0].tolist()])
    if np.isnan(points).all():
        raise InputError(f"{name} has none of the nodes of the matrices.")
    return DofMap(labels[:, 0], labels[:, 1], points)


def _read_map(source: MatrixFile) -> tuple[str, Array]:
    """(name, table) of a map file, with component names replaced by numbers."""
    rows: dict[int, bytes] = {}
    for k, line in enumerate(source.lines(), 1):
        text = line.partition(b"#")[0].replace(b",", b" ").strip()
        if text.lstrip(b"+-")[:1].isdigit():
            rows[k] = b" ".join(_dof_as_number(source, k, word) for word in text.split())
        elif rows and text and not text.startswith((b"*", b"!", b"$", b"%")):
            raise source.error(k, f"a row of numbers is expected; got {_quoted(text)}.")

        # else a comment, or the heading of the table
    source.needs(rows, 1, "the map has no row of numbers.")
    table = source.table(list(rows.values()), list(rows), len(next(iter(rows.values())).split()))
    if not np.isfinite(table).all():
        raise InputError(f"{source.name} must hold finite numbers.")
    return source.name, table


def _map_of_sierra(gid: MatrixFile, aset: MatrixFile) -> tuple[str, Array]:
    """(name, rows (node, dof)) from two files of Sierra/SD: node numbers, row of each dof."""
    nodes, rows = (_matlab_vector(file) for file in (gid, aset))
    each = len(rows) // len(nodes)
    if len(rows) != each * len(nodes):
        raise InputError(f"{aset.name} has {len(rows)} dofs of {len(nodes)} nodes of {gid.name}.")
    dofs = np.flatnonzero(rows)
    dofs = dofs[np.argsort(rows[dofs])]
    return aset.name, np.column_stack([nodes[dofs // each], dofs % each + 1])


def _matlab_vector(source: MatrixFile) -> Array:
    """The vector in a MATLAB text: x = zeros(n, 1), then lines x(i) = value."""
    size = re.search(rb"x = zeros\((\d{1,9}), 1\)", source.content)
    source.needs(size, 1, "'x = zeros(n, 1)' is expected, as Sierra/SD writes vectors.")
    assert size is not None
    entries = re.findall(rb"x\((\d{1,9})\) = (\d{1,9});", source.content)
    index, values = np.array(entries, dtype=np.int64).reshape(-1, 2).T
    vector = np.zeros(int(size[1]))
    if not len(index) or index.max() > len(vector):
        raise InputError(f"{source.name} has entries outside its {len(vector)}, or none.")
    vector[index - 1] = values
    return vector


#: K, M and the map of a body.
Body: TypeAlias = tuple[Any, Any, DofMap | None]


def joined_bodies(bodies: Sequence[Body]) -> Body:
    """Several bodies joined into one at nodes with equal numbers; their K and M are added."""
    maps = [rows for *_, rows in bodies if rows is not None]
    if len(maps) < len(bodies):
        raise InputError("bodies are tied at nodes of the same number: give the map of each.")
    labels = np.vstack([np.column_stack([rows.node, rows.component]) for rows in maps])
    shared, first, index = np.unique(labels, axis=0, return_index=True, return_inverse=True)
    if len(shared) == len(labels):
        raise InputError("the bodies have no node with the same number, at which they are tied.")

    points = np.vstack([rows.points for rows in maps])
    apart = np.abs(points - points[first][np.ravel(index)]).max(axis=1) > SAME_PLACE_DISTANCE
    if apart.any():
        raise InputError(f"node {labels[apart][0, 0]} of two bodies is not at one place.")
    ones = np.ones(len(labels)), (np.arange(len(labels)), np.ravel(index))
    T = scipy.sparse.csr_matrix(ones)
    K, M = (T.T @ scipy.sparse.block_diag(body) @ T for body in list(zip(*bodies, strict=True))[:2])
    return K.tocsr(), M.tocsr(), DofMap(shared[:, 0], shared[:, 1], points[first])


def _dof_as_number(source: MatrixFile, number: int, word: bytes) -> bytes:
    """A word of line `number` of a map file, in which a dof's name is replaced by its number."""
    text = word.decode("ascii", "replace")
    known = _NUMBER_OF_COMPONENT.get(text.lower())
    source.needs(known or not text[:1].isalpha(), number, f"{text!r} is not the name of a dof.")
    return word if known is None else str(known).encode()


def _quoted(text: bytes) -> str:
    """The first 60 characters of a line, in quotes."""
    return repr(text.decode("ascii", "replace")[:60])
