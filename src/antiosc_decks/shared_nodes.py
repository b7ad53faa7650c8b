"""Meshes that share nodes, numbered nodes of decks, and constraints between them.

The elements here have more dofs than a deck's, at places between the deck's nodes. If constraints
determine all nodes of an edge or a face of a cell, the dofs between these nodes follow by the shape
functions of the deck's element; if all nodes can only slide across one direction, so can the dofs
between them; if all lie on one cell to which they are tied, the dofs between them follow that cell.
A beam bends between its nodes: its dofs follow only if both nodes belong to one rigid body.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import basix
import numpy as np
import scipy.sparse
from numpy.typing import ArrayLike

from antiosc.base._types import Array, IntArray
from antiosc.base.errors import InputError
from antiosc.extension import projected
from antiosc.fem.assembly.joint import HeldDofs, Joint, Rows, Stiffness, following
from antiosc.fem.assembly.layout import Layout, Sparse
from antiosc.fem.platform import compat
from antiosc.fem.structure.meshed import Member
from antiosc.io.dof_map import DISPLACEMENTS, ROTATIONS
from antiosc.io.neutral import Term

#: Columns and values of a row of a matrix.
Row = tuple[IntArray, Array]


class NumberedMesh:
    """The mesh of a part with the numbers that the deck gives its nodes.

    Attributes
    ----------
    member : the part.
    numbers : (cells, nodes of a cell) numbers of the nodes of each cell, its vertices first.
    vertices : (cells, v) numbers of the vertices alone.
    """

    def __init__(self, member: Member, numbers: IntArray) -> None:
        self.member = member
        mesh = member.part.mesh
        self._rows = compat.geometry_nodes(mesh.dolfinx)
        self.numbers = np.asarray(numbers)[
            np.asarray(mesh.dolfinx.geometry.input_global_indices)[self._rows]
        ]
        self.vertices = self.numbers[:, : len(mesh.geometry.corners)]

    @property
    def cell_type(self) -> basix.CellType:
        """The shape of the cells."""
        return getattr(basix.CellType, self.member.part.mesh.cell)

    @property
    def cell_map(self) -> basix.finite_element.FiniteElement:
        """The shape functions of a cell's geometry."""
        mesh = self.member.part.mesh
        return basix.create_element(basix.ElementFamily.P, self.cell_type, mesh.order)

    @cached_property
    def reference_points(self) -> Array:
        """Reference coordinates (nodes, tdim) of the nodes of a cell."""
        return np.asarray(self.cell_map.points)

    @cached_property
    def at_cell(self) -> dict[int, tuple[int, int]]:
        """Number of a node -> (a cell, index of the node in that cell)."""
        _, first = np.unique(self.numbers, return_index=True)
        flat = self.numbers.ravel()
        width = self.numbers.shape[1]
        return {int(flat[k]): divmod(int(k), width) for k in first}

    @cached_property
    def places(self) -> tuple[IntArray, Array]:
        """(numbers (n,), coordinates (n, 3) in the assembly's axes [m]) of the vertices."""
        numbers, first = np.unique(self.vertices, return_index=True)
        rows = self._rows[:, : self.vertices.shape[1]]
        return numbers, self.member.vertices[rows.ravel()[first]]

    def position(self, number: int) -> Array:
        """Coordinates (3,) of a node in the part's axes [m]."""
        return np.asarray(
            self.member.part.mesh.dolfinx.geometry.x[self._rows[self.at_cell[number]]]
        )

    def motions(self, layout: Layout, numbers: Sequence[int], names: tuple[str, ...]) -> Sparse:
        """Displacements or rotations (3 nodes, n) of nodes in the assembly's axes, by n dofs."""
        cells, local = np.array([self.at_cell[number] for number in numbers]).T
        return layout.at_points(self.member, cells, self.reference_points[local], names)

    @cached_property
    def edges(self) -> set[tuple[int, int]]:
        """Pairs (sorted) of vertices that an edge joins."""
        pairs = np.vstack([self.vertices[:, edge] for edge in basix.topology(self.cell_type)[1]])
        return {(int(a), int(b)) for a, b in np.unique(np.sort(pairs, axis=1), axis=0)}

    @cached_property
    def around(self) -> dict[int, set[int]]:
        """Number of a vertex -> cells around it."""
        neighbours: dict[int, set[int]] = {}
        for cell, row in enumerate(self.vertices):
            for number in row:
                neighbours.setdefault(int(number), set()).add(cell)
        return neighbours

    def cell_with(self, numbers: Sequence[int], follower_dim: int) -> int | None:
        """A cell with all these vertices, or None; two vertices of a line must be an edge of it."""
        if len(numbers) == 2 and follower_dim == 1:
            first, second = sorted(numbers)
            if (first, second) not in self.edges:
                return None
        common = set.intersection(*(self.around.get(n, set()) for n in numbers))
        return min(common) if common else None


class Nodes:
    """Finds the numbered nodes of an assembly: part, cell and place in the cell."""

    def __init__(
        self, layout: Layout, points: Sequence[str], numbers: Mapping[str, IntArray]
    ) -> None:
        self.layout = layout
        self.points = points
        self.meshes = [NumberedMesh(m, numbers[m.name]) for m in layout.members.values()]
        self._single: dict[tuple[int, int], Row] = {}
        #: which dofs are zero
        self.fixed = np.zeros(layout.count, dtype=bool)

    def _owner(self, number: int, rotations: bool) -> tuple[int, int, int]:
        """(part, cell, index in the cell) of a node, of a part that rotates if needed."""
        for index, mesh in enumerate(self.meshes):
            if number in mesh.at_cell and (mesh.member.has_rotations or not rotations):
                return index, *mesh.at_cell[number]
        noun = "rotation of the node" if rotations else "node"
        raise InputError(f"a constraint acts on the {noun} {number}, which no part has.")

    def functionals(self, equations: Sequence[Sequence[Term]]) -> Sparse:
        """Σ coefficient × motion as a matrix over the dofs, one row for each list of terms."""
        count = len(equations)
        layout = self.layout
        flat = [(row, *term) for row, terms in enumerate(equations) for term in terms]
        result = layout.nothing(count)
        groups: dict[tuple[int, bool], list[tuple[int, int, int, int, float]]] = {}
        rows = []
        columns = []
        values = []
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
            table = np.array([t[:4] for t in terms])
            X = self.meshes[k].reference_points[table[:, 2]]
            names = ROTATIONS if rotations else DISPLACEMENTS
            motions = layout.at_points(self.meshes[k].member, table[:, 1], X, names)
            rows_of_points = 3 * np.arange(len(terms)) + table[:, 3]
            selection = scipy.sparse.csr_matrix(
                (np.array([t[4] for t in terms]), (table[:, 0], rows_of_points)),
                shape=(count, 3 * len(terms)),
            )
            result = result + selection @ motions

        return result.tocsr()

    def dof(self, term: Term) -> int:
        """The dof that equals a node's motion; -1 if the motion depends on several dofs."""
        columns, _ = self.single(term[0], term[1])
        if len(columns) == 1:
            return int(columns[0])
        return -1

    def is_fixed(self, number: int, motion: int) -> bool:
        """Whether a node's motion is zero."""
        return bool(self.fixed[self.single(number, motion)[0]].all())

    def single(self, number: int, motion: int) -> Row:
        """Row of dofs of one motion of one node."""
        if (number, motion) not in self._single:
            self.prepare([(number, motion)])
        return self._single[number, motion]

    def prepare(self, wanted: Iterable[tuple[int, int]]) -> None:
        """Compute and store the rows of several motions together, which is faster than singly."""
        new = [motion for motion in dict.fromkeys(wanted) if motion not in self._single]
        functionals = self.functionals([[(*motion, 1.0)] for motion in new])
        self._single.update((motion, row_of(functionals, k)) for k, motion in enumerate(new))


def row_of(matrix: Sparse, k: int) -> Row:
    """Columns and values of row `k` of a matrix."""
    span = slice(matrix.indptr[k], matrix.indptr[k + 1])
    return matrix.indices[span], matrix.data[span]


# -- Nodes that constraints tie to a cell at their own place.
#
# *TIE, and equations between coincident nodes, may tie all nodes of an edge or a face to one cell
# at their own place. The dofs between them then follow that cell's displacement at their places, so
# that meshes which fit are joined as if they shared nodes.


#: Largest distance of a node from the place to which it is tied, as a share of the tied nodes'
#: size.
TIED_NEAR = 1e-3
LEAST_WEIGHT = 1e-9  # smaller shares are rounding of the shape functions


class CoincidentNodes:
    """The constraints of a deck that tie nodes to a cell at their own place."""

    def __init__(self, nodes: Nodes, equations: Sequence[Sequence[Term]]) -> None:
        self.nodes = nodes
        self.equations = equations
        leaders = {n for terms in equations for n, _, _ in terms[1:] if n >= 0}
        leading = np.fromiter(leaders, dtype=int, count=len(leaders))
        #: node that others follow -> (part, cell) of the cells around it
        self.cells: dict[int, set[tuple[int, int]]] = {}
        for k, mesh in enumerate(nodes.meshes):
            for cell, local in zip(*np.nonzero(np.isin(mesh.numbers, leading)), strict=True):
                self.cells.setdefault(int(mesh.numbers[cell, local]), set()).add((k, int(cell)))

    def displacements(
        self,
        means: Sequence[tuple[Sequence[int], Array]],
        motion: int,
        rows: Mapping[int, int],
    ) -> dict[int, Row]:
        """One motion at weighted mean places of nodes, by the cell to which all these are tied.

        `means`: (nodes, weights) of each place; `rows`: node -> index of its constraint. The result
        has the rows by index of the place, of those whose nodes are all tied to one cell.
        """
        names = ROTATIONS if motion >= 3 else DISPLACEMENTS
        by_mesh: dict[int, list[tuple[int, int, Array]]] = {}
        for index, (numbers, weights) in enumerate(means):
            place = self._place(numbers, weights, motion, rows)
            if place is not None:
                k, cell, X = place
                by_mesh.setdefault(k, []).append((index, cell, X))
        result: dict[int, Row] = {}
        for k, places in by_mesh.items():
            indices, cells, points = zip(*places, strict=True)
            member = self.nodes.meshes[k].member
            motions = self.nodes.layout.at_points(member, np.array(cells), np.array(points), names)
            motions = motions[motion % 3 :: 3]
            result |= {index: row_of(motions, i) for i, index in enumerate(indices)}
        return result

    def _place(
        self, numbers: Sequence[int], weights: Array, motion: int, rows: Mapping[int, int]
    ) -> tuple[int, int, Array] | None:
        """(part, cell, reference point) of the mean place of nodes tied to one cell."""
        if not all(number in rows for number in numbers):
            return None
        positions = np.array([self._position(number) for number in numbers])
        reach = TIED_NEAR * float(np.linalg.norm(positions - positions.mean(axis=0), axis=1).max())
        total: dict[int, float] = {}
        for number, weight, x in zip(numbers, weights, positions, strict=True):
            first, *other_terms = self.equations[rows[number]]
            shares = {n: -c / first[2] for n, _, c in other_terms if abs(c) > LEAST_WEIGHT}
            if any(m != motion or n < 0 for n, m, c in other_terms if n in shares):
                return None
            if not shares or abs(sum(shares.values()) - 1) > TIED_NEAR:
                return None
            place = sum(share * self._position(n) for n, share in shares.items())
            if not float(np.linalg.norm(place - x)) <= reach:
                return None
            for n, share in shares.items():
                total[n] = total.get(n, 0.0) + weight * share

        cells_around = [self.cells.get(n, set()) for n in total]
        common = set.intersection(*cells_around)
        names = ROTATIONS if motion >= 3 else DISPLACEMENTS
        for k, cell in sorted(common):
            mesh = self.nodes.meshes[k]
            if mesh.member.part.form.components.get(names[motion % 3]) is None:
                continue
            positions = mesh.numbers[cell].tolist()
            X = sum(w * mesh.reference_points[positions.index(n)] for n, w in total.items())
            return k, cell, np.asarray(X)

        return None

    def _position(self, number: int) -> Array:
        """Coordinates (3,) of a node of the deck [m]; nan if no part has it."""
        owners = [mesh for mesh in self.nodes.meshes if number in mesh.at_cell]
        if owners:
            return owners[-1].position(number)
        return np.full(3, np.nan)


#: node added here, of a face or by halving -> (node of the deck, weight) that give its place
Among = Mapping[int, Sequence[tuple[int, float]]]


def between_nodes(
    nodes: Nodes, equations: Sequence[Sequence[Term]], functionals: Sparse, among: Among
) -> Sparse:
    """Constraints of the dofs between nodes; `functionals`: the equations over all dofs."""
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

    rows_found: list[Row] = []
    coincident = CoincidentNodes(nodes, equations)
    for mesh in nodes.meshes:
        for motion in dependent:
            rows_found += _followers(
                nodes, mesh, motion, dependent, equations, functionals, among, coincident
            )
        for first, directions in sliding.items():
            rows_found += _sliders(nodes, mesh, first, directions, among)

    if not rows_found:
        return nodes.layout.nothing(0)
    rows = np.repeat(np.arange(len(rows_found)), [len(columns) for columns, _ in rows_found])
    result = nodes.layout.matrix(rows, *_sum(rows_found), len(rows_found))
    result.eliminate_zeros()
    return result


def _dofs(
    mesh: NumberedMesh, motion: int, selected: Mapping[int, object], among: Among
) -> Iterator[tuple[int, list[int], Array]]:
    """Yield (dof, nodes that determine it, their weights) for one motion between `selected` nodes.

    A dof at the place of a deck's node is that node's motion, and is left out.
    """
    member = mesh.member
    numbers = mesh.numbers
    name = (ROTATIONS if motion >= 3 else DISPLACEMENTS)[motion % 3]
    path = member.part.form.components.get(name)
    between = [n for n, shares in among.items() if any(node in selected for node, _ in shares)]
    touching = np.flatnonzero(np.isin(numbers, [*selected, *between]).any(axis=1))
    if path is None or not len(touching):
        return
    space = member.part.form.space
    X = np.asarray(compat.subspace(space, path).element.basix_element.points)
    weights = np.asarray(mesh.cell_map.tabulate(0, X))[0, :, :, 0]
    columns_of_rows = [np.flatnonzero(np.abs(row) > 1e-12) for row in weights]
    dofs = compat.cell_dofs(space, path, touching)

    used: set[int] = set()
    for position, cell in enumerate(touching):
        for d, members in enumerate(columns_of_rows):
            column = member.first + int(dofs[position, d])
            if column not in used:
                used.add(column)
                functional = _of_the_deck(numbers[cell, members], weights[d, members], among)
                if len(functional) > 1 and any(n in selected for n in functional):
                    yield column, list(functional), np.array(list(functional.values()))


def _of_the_deck(numbers: IntArray, weights: Array, among: Among) -> dict[int, float]:
    """Node of the deck -> weight; nodes that were added here are replaced by those of the deck."""
    result: dict[int, float] = {}
    for number, weight in zip(numbers.tolist(), weights.tolist(), strict=True):
        for node, share in among.get(number, ((number, 1.0),)):
            result[node] = result.get(node, 0.0) + weight * share
    return result


def _followers(
    nodes: Nodes,
    mesh: NumberedMesh,
    motion: int,
    dependent: Mapping[int, Mapping[int, int]],
    equations: Sequence[Sequence[Term]],
    functionals: Sparse,
    among: Among,
    tied: CoincidentNodes,
) -> Iterator[Row]:
    """Yields a constraint for each dof that is a weighted sum of constrained nodes."""
    rows = dependent[motion]
    beam = mesh.member.part.mesh.tdim == 1
    dofs = list(_dofs(mesh, motion, rows, among))
    nodes.prepare((n, motion) for _, numbers, _ in dofs for n in numbers)
    following_dofs = [
        (column, numbers, weights)
        for column, numbers, weights in dofs
        if (not beam or _in_one_body(numbers, dependent, equations, nodes.layout.plane))
        and _determined(nodes, numbers, motion, rows, equations)
    ]
    means = [] if beam else [(numbers, weights) for _, numbers, weights in following_dofs]
    tied_motions = tied.displacements(means, motion, rows)

    for index, (column, numbers, weights) in enumerate(following_dofs):
        terms = [(np.array([column]), np.ones(1))]
        if index in tied_motions:
            columns, values = tied_motions[index]
            yield _sum([*terms, (columns, -values)])
            continue
        for node, weight in zip(numbers, weights, strict=True):
            columns, values = nodes.single(node, motion)
            terms.append((columns, -weight * values))
            if node in rows:  # by its constraint without its own term
                columns, values = row_of(functionals, rows[node])
                terms.append((columns, weight * values / equations[rows[node]][0][2]))
        yield _sum(terms)


def _sum(terms: Sequence[Row]) -> Row:
    """The sum of rows."""
    columns, values = (np.concatenate(pieces) for pieces in zip(*terms, strict=True))
    return columns, values


def _in_one_body(
    numbers: Sequence[int],
    dependent: Mapping[int, Mapping[int, int]],
    equations: Sequence[Sequence[Term]],
    plane: bool,
) -> bool:
    """Whether all motions of the nodes follow one point, which may be one of them."""
    leaders: set[int] = set()
    followers: list[set[int]] = []
    for motion in (0, 1, 5) if plane else range(6):
        rows = dependent.get(motion, {})
        followers.append({n for n in numbers if n in rows})
        leaders |= {term[0] for n in followers[-1] for term in equations[rows[n]][1:]}
    same_followers = all(follower == followers[0] for follower in followers)
    return same_followers and len(leaders) == 1 and set(numbers) - followers[0] <= leaders


def _determined(
    nodes: Nodes,
    numbers: Sequence[int],
    motion: int,
    rows: Mapping[int, int],
    equations: Sequence[Sequence[Term]],
) -> bool:
    """Whether constraints or supports determine a motion of all these nodes.

    They do if each node that is not dependent is fixed, or if each dependent one follows all that
    are not.
    """
    dependent = [n for n in numbers if n in rows]
    independent = set(numbers) - set(dependent)
    if dependent and all(
        independent <= {n for n, m, _ in equations[rows[node]][1:] if m == motion}
        for node in dependent
    ):
        return True
    return all(nodes.is_fixed(n, motion) for n in independent)


def _sliders(
    nodes: Nodes,
    mesh: NumberedMesh,
    first: int,
    directions: Mapping[int, list[Array]],
    among: Among,
) -> Iterator[Row]:
    """Yields constraints for the dofs between nodes that slide across a direction or are fixed."""
    axes = range(2 if nodes.layout.plane else 3)
    by_motion = [list(_dofs(mesh, first + c, directions, among)) for c in axes]
    near_nodes = {n for _, numbers, _ in by_motion[0] for n in numbers}
    nodes.prepare((n, first + c) for n in near_nodes - directions.keys() for c in axes)
    for directions_of_node in zip(*by_motion, strict=True):
        columns = [column for column, _, _ in directions_of_node]
        _, numbers, weights = directions_of_node[0]
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


#: Nodes of the same number must coincide up to this share of the size of the assembly.
SAME_PLACE = 1e-6


@dataclass(frozen=True, eq=False)
class SharedNodes(Joint):
    """Joins all parts at the nodes that have the same number."""

    #: part -> number of each node of its mesh, in the order in which they were read
    numbers: Mapping[str, IntArray]
    name: str | None = "shared nodes"

    def constraints(self, layout: Layout, held: HeldDofs, label: str) -> list[Rows]:
        """Constraints by which the shared dofs of a part follow those of an earlier part."""
        ordered = sorted(
            layout.members.values(), key=lambda m: (m.part.form.degree, -m.part.mesh.tdim)
        )
        meshes = [NumberedMesh(m, self.numbers[m.name]) for m in ordered]
        _check_places(layout, meshes)
        return [
            rows
            for k, follower in enumerate(meshes)
            for rows in _following(layout, follower, meshes[:k])
        ]


def _check_places(layout: Layout, meshes: Sequence[NumberedMesh]) -> None:
    """Raise InputError if nodes of the same number lie apart."""
    numbers = np.concatenate([mesh.places[0] for mesh in meshes])
    positions = np.vstack([mesh.places[1] for mesh in meshes])
    order = np.argsort(numbers, kind="stable")
    equal = np.flatnonzero(np.diff(numbers[order]) == 0)
    first = order[equal]
    second = order[equal + 1]
    distances = np.linalg.norm(positions[first] - positions[second], axis=1)
    if len(distances) and distances.max() > SAME_PLACE * layout.size:
        k = int(np.argmax(distances))
        raise InputError(
            f"node {numbers[first[k]]} lies {distances[k]:.3g} m apart in two parts that share it."
        )


def _following(
    layout: Layout, follower: NumberedMesh, leaders: Sequence[NumberedMesh]
) -> list[Rows]:
    """Constraints by which a part follows earlier parts at shared nodes."""
    constraints: list[Rows] = []
    for names in (DISPLACEMENTS, ROTATIONS):
        followed: set[int] = set()
        for leader in leaders:
            components = [mesh.member.part.form.components.keys() for mesh in (follower, leader)]
            node_places = (
                _shared(follower, leader, followed)
                if components[0] & components[1] & set(names)
                else {}
            )
            followed |= set(node_places)
            if node_places:
                constraints.append(
                    _tied(layout, follower.member, leader.member, node_places, names)
                )
    return constraints


def _shared(follower: NumberedMesh, leader: NumberedMesh, followed: set[int]) -> dict[int, int]:
    """Node of the follower -> cell of the leader that contains it; without nodes in `followed`."""
    member = follower.member
    space = member.part.form.space
    (path, *_) = member.part.form.components.values()
    layout = space.dofmap.dof_layout
    topology = basix.topology(follower.cell_type)
    common = np.isin(follower.vertices, leader.vertices)
    touching = np.flatnonzero(common.any(axis=1))
    nodes = compat.cell_dofs(space, path, touching) // member.block

    where: dict[int, int] = {}
    for row, cell in enumerate(touching):
        for dim, entities in enumerate(topology):
            for number, corners in enumerate(entities):
                local = layout.entity_dofs(dim, number)
                if not len(local) or not common[cell, corners].all():
                    continue
                dofs_here = [int(n) for n in nodes[row, local]]
                if all(n in followed or n in where for n in dofs_here):
                    continue
                vertices = [int(n) for n in follower.vertices[cell, corners]]
                holder = leader.cell_with(vertices, member.part.mesh.tdim)
                if holder is not None:
                    where |= {n: holder for n in dofs_here if n not in followed}

    return where


def _tied(
    layout: Layout,
    follower: Member,
    leader: Member,
    where: Mapping[int, int],
    names: tuple[str, ...],
) -> Rows:
    """Constraints by which nodes of one part follow the cells of another that contain them."""
    nodes = np.array(list(where))
    cells = np.array(list(where.values()))
    geometry = leader.part.mesh.geometry
    points = leader.at.own(follower.nodes[nodes])
    start = np.tile(geometry.centre(), (len(nodes), 1))
    X = projected(lambda k, X: geometry.at(cells[k], X), points, start, affine=geometry.affine)
    for exact in (0.0, 1.0):
        X = np.where(np.abs(X - exact) < 1e-12, exact, X)
    motions = layout.at_points(leader, cells, X, names)
    return following(layout, follower, nodes, [(names, motions)], "shared nodes")


@dataclass(frozen=True, eq=False)
class NodeConstraints(Joint):
    """Constraints Σ coefficient × motion = 0, springs, dampers and masses on nodes of a deck."""

    #: terms of each constraint; the first is the dependent motion
    equations: Sequence[Sequence[Term]]
    #: (terms of a relative motion, stiffness in N/m)
    springs: Sequence[tuple[Sequence[Term], float]]
    points: Sequence[str]  # names of the reference points in the order of their numbers
    #: part -> number of each node of its mesh, in the order in which they were read
    numbers: Mapping[str, IntArray]
    #: (terms of each of k motions, their mass matrix (k, k), kg)
    masses: Sequence[tuple[Sequence[Sequence[Term]], ArrayLike, float]] = ()
    #: as in `Joints`
    among: Mapping[int, Sequence[tuple[int, float]]] = field(default_factory=dict)
    #: (terms of a relative motion, damping in N s/m)
    dampers: Sequence[tuple[Sequence[Term], float]] = ()
    name: str | None = "constraints of the deck"

    def constraints(self, layout: Layout, held: HeldDofs, label: str) -> list[Rows]:
        """Rows of the constraints, of the dofs between their nodes, and of middle nodes."""
        nodes = Nodes(layout, self.points, self.numbers)
        equations = nodes.functionals(self.equations)
        nodes.prepare((number, motion) for (number, motion, _), *_ in self.equations)
        dependent = np.array([nodes.dof(terms[0]) for terms in self.equations], dtype=int)
        rows = [Rows(equations, dependent, label)] if equations.shape[0] else []
        nodes.fixed = held.fixed.copy()
        for row in held.rows:
            is_single = np.diff(row.matrix.indptr) == 1
            nodes.fixed[row.matrix[is_single].indices] = True
        inner_rows = between_nodes(nodes, self.equations, equations, self.among)
        if inner_rows.shape[0]:
            rows.append(Rows.free(inner_rows, label))
        middles = _on_middles(nodes)
        if middles.shape[0]:
            rows.append(Rows.free(middles, label))
        return rows

    def elastic(self, layout: Layout, label: str) -> list[Stiffness]:
        """The springs, dampers and masses as stiffness contributions."""
        nodes = Nodes(layout, self.points, self.numbers)
        flat = [terms for terms, _ in (*self.springs, *self.dampers)]
        functionals = nodes.functionals(
            [*flat, *(terms for rows, _, _ in self.masses for terms in rows)]
        )
        zero_mass = np.zeros((1, 1))
        springs = [
            Stiffness(functionals[k], np.array([[stiffness]]), zero_mass)
            for k, (_, stiffness) in enumerate(self.springs)
        ]
        dampers = [
            Stiffness(functionals[len(springs) + k], zero_mass, zero_mass, c=np.array([[damping]]))
            for k, (_, damping) in enumerate(self.dampers)
        ]
        masses = []
        start = len(flat)
        for rows, M, mass in self.masses:
            rows_of_mass = functionals[start : start + len(rows)]
            masses.append(Stiffness(rows_of_mass, np.zeros((len(rows),) * 2), np.array(M), mass))
            start += len(rows)
        return springs + dampers + masses


def _on_middles(nodes: Nodes) -> Sparse:
    """Constraints by which a vertex of one part follows the part whose middle node it is."""
    layout = nodes.layout
    rows = [layout.nothing(0)]
    for mesh in nodes.meshes:
        vertices = set(mesh.vertices.ravel().tolist())
        for other in nodes.meshes:
            middles = other.numbers[:, other.vertices.shape[1] :]
            rotate = mesh.member.has_rotations and other.member.has_rotations
            kinds = (DISPLACEMENTS, ROTATIONS) if rotate else (DISPLACEMENTS,)
            common = vertices.intersection(middles.ravel().tolist()) if other is not mesh else ()
            numbers = sorted(common)
            rows += [
                mesh.motions(layout, numbers, names) - other.motions(layout, numbers, names)
                for names in kinds
                if numbers
            ]
    result = scipy.sparse.vstack(rows).tocsr()
    result.eliminate_zeros()
    return result[np.diff(result.indptr) > 0]
