"""Meshes that share nodes, and constraints between numbered nodes, as decks have them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import basix
import numpy as np
import scipy.sparse
from numpy.typing import ArrayLike

from antiosc.base._types import IntArray
from antiosc.base.errors import InputError
from antiosc.fem.assembly.between_nodes import Nodes, between_nodes
from antiosc.fem.assembly.joint import Held, Joint, Rows, Stiffness
from antiosc.fem.assembly.layout import Layout, Sparse
from antiosc.fem.mesh.mesh import projected
from antiosc.fem.platform import compat
from antiosc.fem.structure.meshed import DISPLACEMENTS, ROTATIONS, Member
from antiosc.io.neutral import Term

#: Nodes with one number lie in one place, up to this share of the size of the assembly.
SAME_PLACE = 1e-6


@dataclass(frozen=True, eq=False)
class SharedNodes(Joint):
    """A joint of all parts at the nodes that have the same number."""

    #: part -> number of each node of its mesh, in the order in which they were read
    numbers: Mapping[str, IntArray]
    name: str | None = "shared nodes"

    def constraints(self, layout: Layout, held: Held, label: str) -> list[Rows]:
        """The dofs of a part on what it shares with an earlier one follow the dofs of this one."""
        ordered = sorted(
            layout.members.values(), key=lambda m: (m.part.form.degree, -m.part.mesh.tdim)
        )
        cells = [_Cells(m, np.asarray(self.numbers[m.name])) for m in ordered]
        _check_places(layout, cells)
        return [
            rows
            for k, follower in enumerate(cells)
            for rows in _following(layout, follower, cells[:k])
        ]


class _Cells:
    """The cells of a part with the numbers of their vertices.

    Attributes
    ----------
    member : the part.
    vertices : (cells, v) numbers of the vertices.
    """

    def __init__(self, member: Member, numbers: IntArray) -> None:
        self.member = member
        mesh = member.part.mesh
        read = np.asarray(mesh.dolfinx.geometry.input_global_indices)
        corners = len(mesh.geometry.corners)
        nodes = compat.geometry_nodes(mesh.dolfinx)[:, :corners]
        self.vertices = numbers[read[nodes]]
        flat, first = np.unique(self.vertices, return_index=True)
        self.numbers = flat
        self.positions = member.vertices[nodes.ravel()[first]]

    @cached_property
    def edges(self) -> set[tuple[int, int]]:
        """Pairs of vertices with an edge between them."""
        kind = getattr(basix.CellType, self.member.part.mesh.cell)
        pairs = np.vstack([self.vertices[:, edge] for edge in basix.topology(kind)[1]])
        return {(int(a), int(b)) for a, b in np.unique(np.sort(pairs, axis=1), axis=0)}

    @cached_property
    def around(self) -> dict[int, set[int]]:
        """Number of a vertex -> the cells around it."""
        found: dict[int, set[int]] = {}
        for cell, row in enumerate(self.vertices):
            for number in row:
                found.setdefault(int(number), set()).add(cell)
        return found

    def cell_with(self, numbers: Sequence[int], follower_dim: int) -> int | None:
        """A cell with all these vertices; for lines, if they are an edge of it."""
        if len(numbers) == 2 and follower_dim == 1:
            first, second = sorted(numbers)
            if (first, second) not in self.edges:
                return None
        common = set.intersection(*(self.around.get(n, set()) for n in numbers))
        return min(common) if common else None


def _check_places(layout: Layout, cells: Sequence[_Cells]) -> None:
    """InputError where nodes with one number lie apart."""
    numbers = np.concatenate([c.numbers for c in cells])
    positions = np.vstack([c.positions for c in cells])
    order = np.argsort(numbers, kind="stable")
    same = np.flatnonzero(np.diff(numbers[order]) == 0)
    first, second = order[same], order[same + 1]
    apart = np.linalg.norm(positions[first] - positions[second], axis=1)
    if len(apart) and apart.max() > SAME_PLACE * layout.size:
        k = int(np.argmax(apart))
        raise InputError(
            f"node {numbers[first[k]]} lies {apart[k]:.3g} m apart in two parts that share it."
        )


def _following(layout: Layout, follower: _Cells, leaders: Sequence[_Cells]) -> list[Rows]:
    """Constraints of the dofs of one part on what it shares with earlier ones."""
    found: list[Rows] = []
    for names in (DISPLACEMENTS, ROTATIONS):
        done: set[int] = set()
        for leader in leaders:
            common = [
                name
                for name in names
                if name in follower.member.part.form.components
                and name in leader.member.part.form.components
            ]
            where = _shared(follower, leader, done) if common else {}
            done |= set(where)
            if where:
                found.append(_tied(layout, follower.member, leader.member, where, names, common))
    return found


def _shared(follower: _Cells, leader: _Cells, done: set[int]) -> dict[int, int]:
    """Node of the follower -> a cell of the leader that holds it, of nodes not in `done`."""
    member = follower.member
    space, mesh = member.part.form.space, member.part.mesh
    (path, *_) = member.part.form.components.values()
    layout = space.dofmap.dof_layout
    topology = basix.topology(getattr(basix.CellType, mesh.cell))
    common = np.isin(follower.vertices, leader.numbers)
    touching = np.flatnonzero(common.any(axis=1))
    nodes = compat.cell_dofs(space, path, touching) // member.block
    where: dict[int, int] = {}
    for row, cell in enumerate(touching):
        for dim, entities in enumerate(topology):
            for number, corners in enumerate(entities):
                local = layout.entity_dofs(dim, number)
                if not len(local) or not common[cell, corners].all():
                    continue
                own = [int(n) for n in nodes[row, local]]
                if all(n in done or n in where for n in own):
                    continue
                vertices = [int(n) for n in follower.vertices[cell, corners]]
                holds = leader.cell_with(vertices, mesh.tdim)
                if holds is not None:
                    where |= {n: holds for n in own if n not in done}
    return where


def _tied(
    layout: Layout,
    follower: Member,
    leader: Member,
    where: Mapping[int, int],
    names: tuple[str, ...],
    common: Sequence[str],
) -> Rows:
    """Nodes of one part follow the cells of another in which they lie."""
    nodes, cells = np.array(list(where)), np.array(list(where.values()))
    geometry = leader.part.mesh.geometry
    points = leader.at.own(follower.nodes[nodes])
    start = np.tile(geometry.centre(), (len(nodes), 1))
    X = projected(lambda k, X: geometry.at(cells[k], X), points, start, affine=geometry.affine)
    for exact in (0.0, 1.0):
        X = np.where(np.abs(X - exact) < 1e-12, exact, X)
    led = layout.at_points(leader, cells, X, names)
    rows, pivots = [], []
    for name in common:
        dofs = layout.dofs(follower, nodes, name)
        axis = follower.at.rotation[:, names.index(name)]
        rows.append(layout.units(dofs) - sum(axis[c] * led[c::3] for c in range(3)))
        pivots.append(dofs)
    return Rows(scipy.sparse.vstack(rows).tocsr(), np.concatenate(pivots), "shared nodes")


@dataclass(frozen=True, eq=False)
class NodeConstraints(Joint):
    """Constraints Σ coefficient × motion = 0, springs and dampers of nodes and reference points."""

    #: terms of each constraint; the first is the dependent motion
    equations: Sequence[Sequence[Term]]
    #: (terms of a relative motion, stiffness in N/m)
    springs: Sequence[tuple[Sequence[Term], float]]
    points: Sequence[str]  # names of the reference points in the order of their numbers
    #: part -> number of each node of its mesh, in the order in which they were read
    numbers: Mapping[str, IntArray]
    #: (terms of each of k motions, their mass matrix (k, k), kg)
    masses: Sequence[tuple[Sequence[Sequence[Term]], ArrayLike, float]] = ()
    #: node that the deck does not have, in the middle of a face -> (node, weight) of its own
    among: Mapping[int, Sequence[tuple[int, float]]] = field(default_factory=dict)
    #: (terms of a relative motion, damping in N s/m)
    dampers: Sequence[tuple[Sequence[Term], float]] = ()
    name: str | None = "constraints of the deck"

    def constraints(self, layout: Layout, held: Held, label: str) -> list[Rows]:
        """One row for each constraint, those between its nodes, and of middle nodes."""
        nodes = Nodes(layout, self.points, self.numbers)
        own = nodes.functionals(self.equations)
        nodes.prepare((number, motion) for (number, motion, _), *_ in self.equations)
        dependent = np.array([nodes.dof(terms[0]) for terms in self.equations], dtype=int)
        rows = [Rows(own, dependent, label)] if own.shape[0] else []
        nodes.fixed = held.fixed.copy()
        for one in held.rows:
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
