"""Nodes of the meshes of an assembly by the numbers that a deck gives them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import basix
import numpy as np
import scipy.sparse

from antiosc._types import Array, IntArray
from antiosc.errors import InputError
from antiosc.fem import compat
from antiosc.fem.assembly.layout import Layout, Sparse
from antiosc.fem.structure.member import DISPLACEMENTS, ROTATIONS

#: Number of a node, or -1 - k for the k-th reference point; motion 0 to 5; coefficient.
Term = tuple[int, int, float]


class Nodes:
    """Where the numbered nodes of an assembly are: part, cell, and place in the cell."""

    def __init__(
        self, layout: Layout, points: Sequence[str], numbers: Mapping[str, IntArray]
    ) -> None:
        self.layout = layout
        self.points = points
        self.members = list(layout.members.values())
        self.at_cell: list[dict[int, tuple[int, int]]] = []
        self.tables: list[IntArray] = []
        self._single: dict[tuple[int, int], Sparse] = {}
        #: which dofs are zero
        self.fixed = np.zeros(layout.count, dtype=bool)
        for member in self.members:
            mesh = member.part.mesh
            read = np.asarray(mesh.dolfinx.geometry.input_global_indices)
            of_cells = read[compat.geometry_nodes(mesh.dolfinx)]
            table = np.asarray(numbers[member.name])[of_cells]
            _, first = np.unique(table, return_index=True)
            self.tables.append(table)
            width = table.shape[1]
            flat = table.ravel()
            self.at_cell.append({int(flat[k]): divmod(int(k), width) for k in first})

    def reference_points(self, member: int) -> Array:
        """Reference coordinates of the nodes of a cell of a part."""
        mesh = self.members[member].part.mesh
        kind = getattr(basix.CellType, mesh.cell)
        element = basix.create_element(basix.ElementFamily.P, kind, mesh.order)
        return np.asarray(element.points)

    def _owner(self, number: int, rotations: bool) -> tuple[int, int, int]:
        """(part, cell, node of the cell) of a node; of rotations a part that has them."""
        for k, where in enumerate(self.at_cell):
            if number in where and (self.members[k].has_rotations or not rotations):
                return k, *where[number]
        what = "rotation of the node" if rotations else "node"
        raise InputError(f"a constraint acts on the {what} {number}, which no part has.")

    def functionals(self, equations: Sequence[Sequence[Term]]) -> Sparse:
        """Σ coefficient × motion, one row for each list of terms."""
        count, layout = len(equations), self.layout
        flat = [(row, *term) for row, terms in enumerate(equations) for term in terms]
        result = layout.nothing(count)
        groups: dict[tuple[int, bool], list[tuple[int, int, int, int, float]]] = {}
        rows, columns, values = [], [], []
        for row, number, motion, coefficient in flat:
            if number < 0:
                rows.append(row)
                columns.append(layout.of_point(self.points[-1 - number])[motion])
                values.append(coefficient)
                continue
            rotations = motion >= 3
            k, cell, local = self._owner(int(number), rotations)
            groups.setdefault((k, rotations), []).append(
                (row, cell, local, motion % 3, coefficient)
            )
        if rows:
            result = layout.matrix(np.array(rows), np.array(columns), np.array(values), count)
        for (k, rotations), terms in groups.items():
            whole = np.array([t[:4] for t in terms])
            X = self.reference_points(k)[whole[:, 2]]
            names = ROTATIONS if rotations else DISPLACEMENTS
            three = layout.at_points(self.members[k], whole[:, 1], X, names)
            rows_of_points = 3 * np.arange(len(terms)) + whole[:, 3]
            pick = scipy.sparse.csr_matrix(
                (np.array([t[4] for t in terms]), (whole[:, 0], rows_of_points)),
                shape=(count, 3 * len(terms)),
            )
            result = result + pick @ three
        return result.tocsr()

    def dof(self, term: Term) -> int:
        """The dof that a motion of a node is; -1 if it is no single one."""
        own = self.single(term[0], term[1])
        return int(own.indices[0]) if own.nnz == 1 else -1

    def is_fixed(self, number: int, motion: int) -> bool:
        """Whether a motion of a node is zero."""
        return bool(self.fixed[self.single(number, motion).indices].all())

    def single(self, number: int, motion: int) -> Sparse:
        """One motion of one node."""
        if (number, motion) not in self._single:
            self._single[number, motion] = self.functionals([[(number, motion, 1.0)]])
        return self._single[number, motion]
