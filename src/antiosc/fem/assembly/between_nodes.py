"""Numbered nodes of a deck, and the dofs between constrained ones.

The displacements here are richer than those of a deck's elements. Where constraints determine all
nodes of an edge or a face of a cell, the dofs between these nodes follow by the functions of the
cell's map, by which the deck's own elements move there; where all nodes slide across one direction,
so do the dofs between them; where all lie on one cell to which they are tied, the dofs between them
follow that cell. Beams bend between their nodes: they follow where both nodes are of
one rigid body.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

import basix
import numpy as np
import scipy.sparse

from antiosc.base._types import Array, IntArray
from antiosc.base.errors import InputError
from antiosc.fem.assembly.layout import Layout, Sparse
from antiosc.fem.platform import compat
from antiosc.fem.structure.meshed import DISPLACEMENTS, ROTATIONS
from antiosc.io.neutral import Term

#: Columns and values of a row of a matrix.
Row = tuple[IntArray, Array]


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
        self._single: dict[tuple[int, int], Row] = {}
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
        columns, _ = self.single(term[0], term[1])
        return int(columns[0]) if len(columns) == 1 else -1

    def is_fixed(self, number: int, motion: int) -> bool:
        """Whether a motion of a node is zero."""
        return bool(self.fixed[self.single(number, motion)[0]].all())

    def single(self, number: int, motion: int) -> Row:
        """One motion of one node."""
        if (number, motion) not in self._single:
            self.prepare([(number, motion)])
        return self._single[number, motion]

    def prepare(self, wanted: Iterable[tuple[int, int]]) -> None:
        """Find motions of nodes at once, which is faster than one after the other."""
        new = [one for one in dict.fromkeys(wanted) if one not in self._single]
        found = self.functionals([[(*one, 1.0)] for one in new])
        self._single.update((one, row_of(found, k)) for k, one in enumerate(new))


def row_of(matrix: Sparse, k: int) -> Row:
    """One row of a matrix."""
    own = slice(matrix.indptr[k], matrix.indptr[k + 1])
    return matrix.indices[own], matrix.data[own]


# -- Nodes that constraints tie to the place of a cell where they lie.
#
# Where all nodes of an edge or a face are tied in this way to one cell, as *TIE and equations
# between coincident nodes do it, what lies between them follows the displacement of that cell at
# its own place. Meshes that fit are then joined as if they had common nodes.


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


#: node that the deck does not have -> (node of the deck, weight) of those among which it lies
Among = Mapping[int, Sequence[tuple[int, float]]]


def between_nodes(
    nodes: Nodes, equations: Sequence[Sequence[Term]], own: Sparse, among: Among
) -> Sparse:
    """Constraints of the dofs between nodes; `own` are the functionals of the equations."""
    dependent: dict[int, dict[int, int]] = {}  # motion -> node -> its constraint
    sliding: dict[int, dict[int, list[Array]]] = {}  # 0 or 3 -> node -> directions held
    for row, terms in enumerate(equations):
        number, motion, _ = terms[0]
        if number < 0:
            continue
        if {n for n, _, _ in terms} == {number}:
            direction = np.zeros(3)
            for _, m, coefficient in terms:
                direction[m % 3] = coefficient
            sliding.setdefault(3 * (motion // 3), {}).setdefault(number, []).append(direction)
        else:
            dependent.setdefault(motion, {}).setdefault(number, row)
    found: list[Row] = []
    tied = CoincidentNodes(nodes, equations)
    for k in range(len(nodes.members)):
        for motion in dependent:
            found += _followers(nodes, k, motion, dependent, equations, own, among, tied)
        for first, directions in sliding.items():
            found += _sliders(nodes, k, first, directions, among)
    if not found:
        return nodes.layout.nothing(0)
    rows = np.repeat(np.arange(len(found)), [len(columns) for columns, _ in found])
    result = nodes.layout.matrix(rows, *_sum(found), len(found))
    result.eliminate_zeros()
    return result


def _dofs(
    nodes: Nodes, k: int, motion: int, some: Mapping[int, object], among: Among
) -> Iterator[tuple[int, list[int], Array]]:
    """(dof, nodes of its entity, their weights) of the dofs of one motion near `some` nodes.

    A dof in the place of a node of the deck is that node's own, and is left out.
    """
    member, table = nodes.members[k], nodes.tables[k]
    name = (ROTATIONS if motion >= 3 else DISPLACEMENTS)[motion % 3]
    path = member.part.form.components.get(name)
    touching = np.flatnonzero(np.isin(table, np.fromiter(some, dtype=int)).any(axis=1))
    if path is None or not len(touching):
        return
    mesh, space = member.part.mesh, member.part.form.space
    kind = getattr(basix.CellType, mesh.cell)
    X = np.asarray(compat.subspace(space, path).element.basix_element.points)
    cell_map = basix.create_element(basix.ElementFamily.P, kind, mesh.order)
    weights = np.asarray(cell_map.tabulate(0, X))[0, :, :, 0]
    needed = [np.flatnonzero(np.abs(row) > 1e-12) for row in weights]
    dofs = compat.cell_dofs(space, path, touching)
    done: set[int] = set()
    for at, cell in enumerate(touching):
        for d, near in enumerate(needed):
            column = member.first + int(dofs[at, d])
            if column not in done:
                done.add(column)
                found = _of_the_deck(table[cell, near], weights[d, near], among)
                if len(found) > 1 and any(n in some for n in found):
                    yield column, list(found), np.array(list(found.values()))


def _of_the_deck(numbers: IntArray, weights: Array, among: Among) -> dict[int, float]:
    """Weights of the deck's own nodes."""
    result: dict[int, float] = {}
    for number, weight in zip(numbers.tolist(), weights.tolist(), strict=True):
        for one, share in among.get(number, ((number, 1.0),)):
            result[one] = result.get(one, 0.0) + weight * share
    return result


def _followers(
    nodes: Nodes,
    k: int,
    motion: int,
    dependent: Mapping[int, Mapping[int, int]],
    equations: Sequence[Sequence[Term]],
    own: Sparse,
    among: Among,
    tied: CoincidentNodes,
) -> Iterator[Row]:
    """Dofs that are the weighted sum of what their nodes are by their constraints."""
    rows = dependent[motion]
    beam = nodes.members[k].part.mesh.tdim == 1
    every = list(_dofs(nodes, k, motion, rows, among))
    nodes.prepare((n, motion) for _, numbers, _ in every for n in numbers)
    for column, numbers, weights in every:
        if beam and not _in_one_body(numbers, dependent, equations, nodes.layout.plane):
            continue
        if not _determined(nodes, numbers, motion, rows, equations):
            continue
        terms = [(np.array([column]), np.ones(1))]
        there = None if beam else tied.displacement(numbers, weights, motion, rows)
        if there is not None:
            yield _sum([*terms, (there.indices, -there.data)])
            continue
        for node, weight in zip(numbers, weights, strict=True):
            columns, values = nodes.single(node, motion)
            terms.append((columns, -weight * values))
            if node in rows:  # by its constraint without its own term
                columns, values = row_of(own, rows[node])
                terms.append((columns, weight * values / equations[rows[node]][0][2]))
        yield _sum(terms)


def _sum(terms: Sequence[Row]) -> Row:
    """Rows as one: their sum, if it is one of a matrix."""
    columns, values = (np.concatenate(both) for both in zip(*terms, strict=True))
    return columns, values


def _in_one_body(
    numbers: Sequence[int],
    dependent: Mapping[int, Mapping[int, int]],
    equations: Sequence[Sequence[Term]],
    plane: bool,
) -> bool:
    """Whether all motions of nodes follow those of one point, which may be one of them."""
    leaders: set[int] = set()
    followers: list[set[int]] = []
    for motion in (0, 1, 5) if plane else range(6):
        own = dependent.get(motion, {})
        followers.append({n for n in numbers if n in own})
        leaders |= {term[0] for n in followers[-1] for term in equations[own[n]][1:]}
    alike = all(one == followers[0] for one in followers)
    return alike and len(leaders) == 1 and set(numbers) - followers[0] <= leaders


def _determined(
    nodes: Nodes,
    numbers: Sequence[int],
    motion: int,
    rows: Mapping[int, int],
    equations: Sequence[Sequence[Term]],
) -> bool:
    """Whether each node is dependent, fixed, or leads all that are dependent."""
    dependent = [n for n in numbers if n in rows]
    others = set(numbers) - set(dependent)
    if dependent and all(
        others <= {n for n, m, _ in equations[rows[node]][1:] if m == motion} for node in dependent
    ):
        return True
    return all(nodes.is_fixed(n, motion) for n in others)


def _sliders(
    nodes: Nodes, k: int, first: int, directions: Mapping[int, list[Array]], among: Among
) -> Iterator[Row]:
    """Dofs between nodes that slide across a direction, or are fixed."""
    axes = range(2 if nodes.layout.plane else 3)
    by_motion = [list(_dofs(nodes, k, first + c, directions, among)) for c in axes]
    near = {n for _, numbers, _ in by_motion[0] for n in numbers}
    nodes.prepare((n, first + c) for n in near - directions.keys() for c in axes)
    for found in zip(*by_motion, strict=True):
        columns = [column for column, _, _ in found]
        _, numbers, weights = found[0]
        sliding = [n for n in numbers if n in directions]
        fixed = [n for n in numbers if n not in directions]
        if not all(nodes.is_fixed(n, first + c) for n in fixed for c in axes):
            continue
        for i in range(min(len(directions[n]) for n in sliding)):
            mean = sum(
                w * directions[n][i]
                for n, w in zip(numbers, weights, strict=True)
                if n in directions
            )
            yield np.array(columns), np.asarray(mean)[axes]
