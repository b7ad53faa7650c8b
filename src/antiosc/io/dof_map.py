"""`DofMap`: the node and the direction of each row of a matrix, and where the nodes are."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array, IntArray
from antiosc.base.errors import InputError
from antiosc.io.matrices import Labels, MatrixFile

#: Largest number of a dof: Abaqus's temperatures have 11 to 30.
LARGEST_DOF = 30
#: Displacements and rotations of a node by their numbers 1 to 6.
DISPLACEMENTS = ("x", "y", "z")
ROTATIONS = ("rx", "ry", "rz")
COMPONENTS = (*DISPLACEMENTS, *ROTATIONS)
#: The same in Ansys's mapping files and in Nastran's tables.
_OTHER_NAMES = {
    **{name: k + 1 for k, name in enumerate(COMPONENTS)},
    **{name: k + 1 for k, name in enumerate(("ux", "uy", "uz", "rotx", "roty", "rotz"))},
    **{name: k + 1 for k, name in enumerate(("t1", "t2", "t3", "r1", "r2", "r3"))},
}


@dataclass(frozen=True, eq=False)
class DofMap:
    """Node and component of each row of K and M.

    Attributes
    ----------
    node : (n,) number of the node of each row.
    component : (n,) 1 to 6 for x, y, z, rx, ry, rz along the axes of the coordinates; 0 or more
        than 6 for dofs that are neither.
    points : (n, 3) coordinates of the node of each row, m; NaN where they are not known.
    """

    node: IntArray
    component: IntArray
    points: Array

    @property
    def located(self) -> bool:
        """Whether coordinates of the nodes are known."""
        return bool(np.isfinite(self.points).all(axis=1).any())

    def row(self, node: int, component: int) -> int:
        """The row of a node's component; InputError if there is none."""
        rows = np.flatnonzero(self.node == node)
        if not len(rows):
            raise InputError(f"node {node} is not in the matrices' map of nodes and dofs.")
        matches = rows[self.component[rows] == component]
        if not len(matches):
            components = ", ".join(name_of(int(k)) for k in self.component[rows])
            raise InputError(
                f"node {node} has no dof {name_of(component)} in the matrices: it has {components} "
                "(fixed dofs are left out by most programs)."
            )
        return int(matches[0])


def name_of(component: int) -> str:
    """x, y, z, rx, ry, rz, or the number of another dof."""
    if 1 <= component <= 6:
        return COMPONENTS[component - 1]
    return str(component)


def component_of(dof: object) -> int:
    """The number of a dof's name (x, ux, t1, …) or number; InputError for others."""
    if isinstance(dof, str):
        component = _OTHER_NAMES.get(dof.strip().lower())
        if component is not None:
            return component
        if dof.strip().isdigit():
            return int(dof)
        raise InputError(
            f"dof must be one of {', '.join(COMPONENTS)} or a number; got {checks.shown(dof)}."
        )
    return checks.whole("dof", dof, least=0)


def rows_of(supports: object, rows: DofMap | None) -> IntArray:
    """The rows of {node: "all" or names of dofs}."""
    if rows is None:
        raise InputError("supports by nodes need a map of the nodes and dofs of the matrices.")
    expected = "a dict of node -> 'all' or names of dofs"
    supports_of = checks.instance("supports", supports, Mapping, expected)
    row_numbers: list[int] = []
    for node, dofs in supports_of.items():
        number = checks.whole("a node of supports", node)
        names = list(dofs) if isinstance(dofs, list | tuple) else [dofs]
        if names == ["all"]:
            of_node = np.flatnonzero(rows.node == number)
            if not len(of_node):
                raise InputError(f"node {number} is not in the matrices' map of nodes and dofs.")
            row_numbers += of_node.tolist()
        else:
            row_numbers += [rows.row(number, component_of(name)) for name in names]
    return np.unique(np.array(row_numbers, dtype=np.int64))


def dof_map(source: object, labels: Labels | None, size: int) -> DofMap | None:
    """The map of the rows of matrices.

    Parameters
    ----------
    source : path, array_like or None
        A row for every row of the matrices: node, dof, or node, dof, x, y, z; in a file also
        row, node, dof, and the dof as a name (UX). Or a row for every node: node, x, y, z, for
        matrices whose files name nodes and dofs. Or a tuple of columns, (nodes, dofs) or (nodes,
        dofs, points (size, 3)), with dofs as numbers or names.
    labels : (size, 2) node and component that the files of the matrices name, or None
    size : rows of the matrices
    """
    if source is None:
        if labels is None:
            return None
        return DofMap(labels[:, 0], labels[:, 1], np.full((size, 3), np.nan))
    if isinstance(source, str | os.PathLike):
        name, table = _table(MatrixFile(source))
    elif isinstance(source, tuple) and 2 <= len(source) <= 3 and size > 3:
        name = "map"
        table = _of_columns(source, size)
    else:
        name = "map"
        table = checks.floats("map", source, (None, None))
    if table.shape[1] == 4:
        return _with_nodes(name, table, labels)
    if table.shape[1] == 3:  # row, node, dof
        order = np.argsort(table[:, 0], kind="stable")
        if not np.array_equal(table[order, 0], np.arange(1, len(table) + 1)):
            raise InputError(f"the first column of {name} must number the rows from 1 to {size}.")
        table = table[order, 1:]
    if table.shape[1] not in (2, 5) or len(table) != size:
        raise InputError(
            f"{name} must have a row of node, dof or of node, dof, x, y, z for each of the {size} "
            f"rows of the matrices, or rows of node, x, y, z; got {table.shape[0]} rows of "
            f"{table.shape[1]} numbers."
        )
    labels_table = table[:, :2]
    if (labels_table != np.floor(labels_table)).any():
        raise InputError(f"nodes and dofs of {name} must be whole numbers.")
    bad_rows = np.flatnonzero((labels_table < 0).any(axis=1) | (labels_table[:, 1] > LARGEST_DOF))
    if len(bad_rows):
        node, dof = labels_table[bad_rows[0]]
        raise InputError(
            f"dofs of {name} are 1 to 6 for x, y, z, rx, ry, rz, and 0 or up to {LARGEST_DOF} for"
            f" others; got node {node:g}, dof {dof:g}."
        )
    pairs = labels_table.astype(np.int64)
    if len(np.unique(pairs, axis=0)) < size:
        raise InputError(f"{name} names one dof of a node twice.")
    points = table[:, 2:] if table.shape[1] == 5 else np.full((size, 3), np.nan)
    return DofMap(pairs[:, 0], pairs[:, 1], points)


def _of_columns(columns: tuple[object, ...], size: int) -> Array:
    """Rows of node, dof and perhaps coordinates from columns."""
    nodes = checks.floats("the nodes of map", columns[0], (size,))
    dofs = columns[1] if isinstance(columns[1], list | tuple | np.ndarray) else [columns[1]]
    numbers = [component_of(dof.item() if isinstance(dof, np.generic) else dof) for dof in dofs]
    if len(numbers) != size:
        raise InputError(f"map needs a dof for each of the {size} rows; got {len(numbers)}.")
    points = [checks.floats("the points of map", x, (size, 3)) for x in columns[2:]]
    return np.column_stack([nodes, numbers, *points])


def _with_nodes(name: str, table: Array, labels: Labels | None) -> DofMap:
    """Node and component labels of the matrices, with coordinates from rows of node, x, y, z."""
    if labels is None:
        raise InputError(
            f"{name} has rows of node, x, y, z, but the files do not say which rows of the "
            "matrices belong to a node: give rows of node, dof, x, y, z."
        )
    order = np.argsort(table[:, 0], kind="stable")
    index = np.searchsorted(table[order, 0], labels[:, 0]).clip(max=len(table) - 1)
    rows = order[index]
    is_mapped = table[rows, 0] == labels[:, 0]
    points = np.where(is_mapped[:, None], table[rows, 1:], np.nan)
    if not is_mapped.any():
        raise InputError(f"{name} has none of the nodes of the matrices.")
    return DofMap(labels[:, 0], labels[:, 1], points)


def _table(source: MatrixFile) -> tuple[str, Array]:
    """The numbers of a map file; names of components become their numbers."""
    lines: list[bytes] = []
    numbers: list[int] = []
    for k, line in enumerate(source.lines()):
        text = line.partition(b"#")[0].replace(b",", b" ").strip()
        first = text.split(b" ")[0].lstrip(b"+-")
        if not text or not first[:1].isdigit():
            if lines and text and not text.startswith((b"*", b"!", b"$", b"%")):
                raise source.error(k + 1, f"a row of numbers is expected; got {_shown(text)}.")
            continue  # a comment, or the heading of the table
        lines.append(_numbered(source, k + 1, text.split()))
        numbers.append(k + 1)
    source.needs(lines, 1, "the map has no row of numbers.")
    table = source.table(lines, numbers, len(lines[0].split()))
    if not np.isfinite(table).all():
        raise InputError(f"{source.name} must hold finite numbers.")
    return source.name, table


def _numbered(source: MatrixFile, number: int, words: Sequence[bytes]) -> bytes:
    result = []
    for word in words:
        text = word.decode("ascii", "replace")
        known = _OTHER_NAMES.get(text.lower())
        if known is None and text[:1].isalpha():
            raise source.error(number, f"{text!r} is not the name of a dof.")
        result.append(word if known is None else str(known).encode())
    return b" ".join(result)


def _shown(text: bytes) -> str:
    return repr(text.decode("ascii", "replace")[:60])
