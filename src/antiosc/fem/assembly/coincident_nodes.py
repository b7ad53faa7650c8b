"""Nodes that constraints tie to the place of a cell where they lie.

Where all nodes of an edge or a face are tied in this way to one cell, as *TIE and equations between
coincident nodes do it, what lies between them follows the displacement of that cell at its own
place. Meshes that fit are then joined as if they had common nodes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from antiosc._types import Array
from antiosc.fem import compat
from antiosc.fem.assembly.layout import Sparse
from antiosc.fem.assembly.numbered_nodes import Nodes, Term
from antiosc.fem.structure.member import DISPLACEMENTS, ROTATIONS

#: Distance from the tied place, as a share of the distance between the tied nodes.
TIED_NEAR = 1e-3
LEAST_WEIGHT = 1e-9


class CoincidentNodes:
    """The constraints of this kind among those of a deck."""

    def __init__(self, nodes: Nodes, equations: Sequence[Sequence[Term]]) -> None:
        self.nodes = nodes
        self.equations = equations
        self._places: dict[int, Array] = {}
        leaders = {n for terms in equations for n, _, _ in terms[1:] if n >= 0}
        some = np.fromiter(leaders, dtype=int, count=len(leaders))
        #: node -> (part, cell) of the cells around it, of nodes that others follow
        self.cells: dict[int, set[tuple[int, int]]] = {}
        for k, table in enumerate(nodes.tables):
            for cell, local in zip(*np.nonzero(np.isin(table, some)), strict=True):
                self.cells.setdefault(int(table[cell, local]), set()).add((k, int(cell)))

    def displacement(
        self, numbers: Sequence[int], weights: Array, motion: int, rows: Mapping[int, int]
    ) -> Sparse | None:
        """One motion at the place `weights` of these nodes, in the cell that all are tied to.

        `rows`: node -> number of its constraint. None if they are not all tied to one cell.
        """
        if not all(number in rows for number in numbers):
            return None
        own = np.array([self._position(number) for number in numbers])
        reach = TIED_NEAR * float(np.linalg.norm(own - own.mean(axis=0), axis=1).max())
        total: dict[int, float] = {}
        for number, weight, x in zip(numbers, weights, own, strict=True):
            first, *others = self.equations[rows[number]]
            shares = {n: -c / first[2] for n, _, c in others if abs(c) > LEAST_WEIGHT}
            if any(m != motion or n < 0 for n, m, c in others if n in shares):
                return None
            if not shares or abs(sum(shares.values()) - 1) > TIED_NEAR:
                return None
            there = sum(share * self._position(n) for n, share in shares.items())
            if not float(np.linalg.norm(there - x)) <= reach:
                return None
            for n, share in shares.items():
                total[n] = total.get(n, 0.0) + weight * share
        around = [self.cells.get(n, set()) for n in total]
        common = set.intersection(*around)
        names = ROTATIONS if motion >= 3 else DISPLACEMENTS
        for k, cell in sorted(common):
            member = self.nodes.members[k]
            if member.part.form.components.get(names[motion % 3]) is None:
                continue
            table, X_of = self.nodes.tables[k][cell].tolist(), self.nodes.reference_points(k)
            X = sum(w * X_of[table.index(n)] for n, w in total.items())
            three = self.nodes.layout.at_points(member, np.array([cell]), X[None], names)
            return three[[motion % 3]]
        return None

    def _position(self, number: int) -> Array:
        """Coordinates of a node of the deck."""
        if number not in self._places:
            self._places[number] = np.full(3, np.nan)
            for k, where in enumerate(self.nodes.at_cell):
                if number in where:
                    mesh = self.nodes.members[k].part.mesh.dolfinx
                    row = compat.geometry_nodes(mesh)[where[number]]
                    self._places[number] = np.asarray(mesh.geometry.x[row])
        return self._places[number]
