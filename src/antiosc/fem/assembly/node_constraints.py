"""Constraints, springs and dampers between numbered nodes of meshes, as decks have them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy.sparse

from antiosc.base._types import BoolArray, IntArray
from antiosc.fem.assembly.between_nodes import Nodes, Term, between_nodes
from antiosc.fem.assembly.joint import Joint, Rows, Stiffness
from antiosc.fem.assembly.layout import Layout, Sparse
from antiosc.fem.structure.meshed import DISPLACEMENTS, ROTATIONS, Member


@dataclass(frozen=True, eq=False)
class NodeConstraints(Joint):
    """Constraints Σ coefficient × motion = 0, springs and dampers of nodes and reference points.

    Attributes
    ----------
    equations : terms of each constraint; the first is the dependent motion.
    springs : (terms of a relative motion, stiffness in N/m).
    masses : (terms of each of k motions, their mass matrix (k, k), kg).
    points : names of the reference points in the order of their numbers.
    numbers : part -> number of each node of its mesh, in the order in which they were read.
    among : node that the deck does not have, in the middle of a face -> (node, weight) of its own.
    dampers : (terms of a relative motion, damping in N s/m).
    """

    equations: Sequence[Sequence[Term]]
    springs: Sequence[tuple[Sequence[Term], float]]
    points: Sequence[str]
    numbers: Mapping[str, IntArray]
    masses: Sequence[tuple[Sequence[Sequence[Term]], Any, float]] = ()
    among: Mapping[int, Sequence[tuple[int, float]]] = field(default_factory=dict)
    dampers: Sequence[tuple[Sequence[Term], float]] = ()
    name: str | None = "constraints of the deck"

    def constraints(
        self, layout: Layout, before: Sequence[Rows], fixed: BoolArray, label: str
    ) -> list[Rows]:
        """One row for each constraint, those between its nodes, and of middle nodes."""
        nodes = Nodes(layout, self.points, self.numbers)
        own = nodes.functionals(self.equations)
        nodes.prepare((number, motion) for (number, motion, _), *_ in self.equations)
        dependent = np.array([nodes.dof(terms[0]) for terms in self.equations], dtype=int)
        rows = [Rows(own, dependent, label)] if own.shape[0] else []
        nodes.fixed = fixed.copy()
        for one in before:
            alone = np.diff(one.matrix.indptr) == 1
            nodes.fixed[one.matrix[alone].indices] = True
        between = between_nodes(nodes, self.equations, own, self.among)
        if between.shape[0]:
            rows.append(Rows.free(between, label))
        middles = _on_middles(nodes)
        if middles.shape[0]:
            rows.append(Rows.free(middles, label))
        return rows

    def elastic(self, layout: Layout, label: str) -> list[Stiffness]:
        """The springs, the dampers and the masses."""
        nodes = Nodes(layout, self.points, self.numbers)
        flat = [terms for terms, _ in (*self.springs, *self.dampers)]
        every = nodes.functionals([*flat, *(terms for rows, _, _ in self.masses for terms in rows)])
        none = np.zeros((1, 1))
        springs = [
            Stiffness(every[k], np.array([[stiffness]]), none)
            for k, (_, stiffness) in enumerate(self.springs)
        ]
        dampers = [
            Stiffness(every[len(springs) + k], none, none, c=np.array([[damping]]))
            for k, (_, damping) in enumerate(self.dampers)
        ]
        masses, start = [], len(flat)
        for rows, M, mass in self.masses:
            own = every[start : start + len(rows)]
            masses.append(Stiffness(own, np.zeros((len(rows),) * 2), np.array(M), mass))
            start += len(rows)
        return springs + dampers + masses


def _on_middles(nodes: Nodes) -> Sparse:
    """A vertex of one part that is a middle node of another follows it."""
    layout = nodes.layout
    rows = [layout.nothing(0)]
    for k, member in enumerate(nodes.members):
        corners = len(member.part.mesh.geometry.corners)
        vertices = set(nodes.tables[k][:, :corners].ravel().tolist())
        for j, other in enumerate(nodes.members):
            count = len(other.part.mesh.geometry.corners)
            if j == k or nodes.tables[j].shape[1] == count:
                continue
            middles = set(nodes.tables[j][:, count:].ravel().tolist())
            for number in sorted(vertices & middles):
                for names in (
                    (DISPLACEMENTS, ROTATIONS)
                    if member.has_rotations and other.has_rotations
                    else (DISPLACEMENTS,)
                ):
                    both = [_at(nodes, one, number, names) for one in (k, j)]
                    rows.append(both[0] - both[1])
    result = scipy.sparse.vstack(rows).tocsr()
    result.eliminate_zeros()
    return result[np.diff(result.indptr) > 0]


def _at(nodes: Nodes, k: int, number: int, names: tuple[str, ...]) -> Sparse:
    member: Member = nodes.members[k]
    cell, local = nodes.at_cell[k][number]
    X = nodes.reference_points(k)[[local]]
    return nodes.layout.at_points(member, np.array([cell]), X, names)
