"""Meshes that share nodes, numbered nodes of decks, and constraints between them.

The elements here have more dofs than the deck's elements, at places between the deck's nodes. If
constraints determine all nodes of an edge or a face of a cell, the dofs between these nodes follow
by the shape functions of the deck's element. If all nodes can only slide across one direction, so
can the dofs between them. If all nodes are tied to one cell, the dofs between them follow this
cell. A beam bends between its nodes: its dofs follow only if both nodes belong to one rigid body.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import permutations

import basix
import numpy as np
import scipy.sparse

from antiosc.base._types import Array, IntArray
from antiosc.base.errors import InputError
from antiosc.fem.assembly.joint import Constraints, ElasticTerm, Joint, Rows, following_rows
from antiosc.fem.assembly.layout import Layout, Sparse
from antiosc.fem.mesh.surface import projected
from antiosc.fem.platform import compat
from antiosc.fem.structure.meshed import Member
from antiosc.io.matrices import DISPLACEMENTS, ROTATIONS
from antiosc.io.neutral import Joints, MotionTerm

#: Columns and values of a row of a matrix.
MatrixRow = tuple[IntArray, Array]


class NumberedMesh:
    """The mesh of a part with the numbers that the deck gives its nodes."""

    def __init__(self, member: Member, numbers: IntArray) -> None:
        self.member = member
        mesh = member.part.mesh
        self._rows = compat.geometry_nodes(mesh.dolfinx)
        given = np.asarray(mesh.dolfinx.geometry.input_global_indices)
        #: (cells, nodes of a cell), the vertices first, and the vertices alone
        self.numbers = np.asarray(numbers)[given[self._rows]]
        self.vertices = self.numbers[:, : len(mesh.geometry.corners)]

    @property
    def cell_type(self) -> basix.CellType:
        """The shape of the cells."""
        return getattr(basix.CellType, self.member.part.mesh.cell)

    @property
    def coordinate_element(self) -> basix.finite_element.FiniteElement:
        """The shape functions of a cell's geometry."""
        mesh = self.member.part.mesh
        return basix.create_element(basix.ElementFamily.P, self.cell_type, mesh.order)

    @cached_property
    def reference_points(self) -> Array:
        """Reference coordinates (nodes, tdim) of the nodes of a cell."""
        return np.asarray(self.coordinate_element.points)

    @cached_property
    def cell_of_node(self) -> dict[int, tuple[int, int]]:
        """(cell, index of the node in it) by node number."""
        _, first = np.unique(self.numbers, return_index=True)
        flat = self.numbers.ravel()
        width = self.numbers.shape[1]
        return {int(flat[k]): divmod(int(k), width) for k in first}

    def position(self, number: int) -> Array:
        """Coordinates (3,) of a node in the part's axes [m]."""
        x = self.member.part.mesh.dolfinx.geometry.x
        return np.asarray(x[self._rows[self.cell_of_node[number]]])

    def motion_matrix(
        self, layout: Layout, numbers: Sequence[int], names: tuple[str, ...]
    ) -> Sparse:
        """Functionals (3 nodes, n): displacements or rotations of nodes in the assembly's axes."""
        cells, local = np.array([self.cell_of_node[number] for number in numbers]).T
        return layout.at_points(self.member, cells, self.reference_points[local], names)

    @cached_property
    def edges(self) -> set[tuple[int, int]]:
        """Pairs (sorted) of vertices that an edge joins."""
        pairs = np.vstack([self.vertices[:, edge] for edge in basix.topology(self.cell_type)[1]])
        return {(int(a), int(b)) for a, b in np.unique(np.sort(pairs, axis=1), axis=0)}

    @cached_property
    def cells_around(self) -> dict[int, set[int]]:
        """Cells around each vertex, by its number."""
        neighbours: dict[int, set[int]] = {}
        for cell, row in enumerate(self.vertices):
            for number in row:
                neighbours.setdefault(int(number), set()).add(cell)
        return neighbours

    def cell_with(self, numbers: Sequence[int], follower_dim: int) -> int | None:
        """A cell with all these vertices, or None; two vertices of a line must be an edge of it."""
        if len(numbers) == 2 and follower_dim == 1 and tuple(sorted(numbers)) not in self.edges:
            return None
        around = (self.cells_around.get(n, set()) for n in numbers)
        return min(set.intersection(*around), default=None)


class AssemblyNodes:
    """The numbered nodes of an assembly, each with its part, cell and place in the cell."""

    def __init__(
        self, layout: Layout, points: Sequence[str], numbers: Mapping[str, IntArray]
    ) -> None:
        self.layout = layout
        self.points = points
        self.meshes = [NumberedMesh(m, numbers[m.name]) for m in layout.members.values()]
        self._single: dict[tuple[int, int], MatrixRow] = {}
        #: which dofs are zero
        self.fixed = np.zeros(layout.count, dtype=bool)

    def _owner(self, number: int, rotations: bool) -> tuple[int, int, int]:
        """(part, cell, index in the cell) of a node; with `rotations` in a part that has them."""
        for index, mesh in enumerate(self.meshes):
            if number in mesh.cell_of_node and (mesh.member.has_rotations or not rotations):
                return index, *mesh.cell_of_node[number]
        noun = "rotation of the node" if rotations else "node"
        raise InputError(f"a constraint acts on the {noun} {number}, which no part has.")

    def functionals(self, equations: Sequence[Sequence[MotionTerm]]) -> Sparse:
        """Σ coefficient × motion as a matrix over the dofs, one row for each list of terms."""
        count = len(equations)
        layout = self.layout
        groups: dict[tuple[int, bool], list[tuple[int, int, int, int, float]]] = {}
        points: list[tuple[int, int, float]] = []
        for row, terms in enumerate(equations):
            for number, motion, value in terms:
                if number < 0:
                    column = layout.point_dofs(self.points[-1 - number])[motion]
                    points.append((row, column, value))
                    continue
                k, cell, local = self._owner(int(number), motion >= 3)
                group = groups.setdefault((k, motion >= 3), [])
                group.append((row, cell, local, motion % 3, value))

        result = layout.zeros(count)
        if points:
            rows, columns, values = map(np.array, zip(*points, strict=True))
            result = layout.matrix(rows, columns, values, count)
        for (k, rotations), group in groups.items():
            rows, cells, locals_, axes, values = map(np.array, zip(*group, strict=True))
            mesh = self.meshes[k]
            names = ROTATIONS if rotations else DISPLACEMENTS
            motions = layout.at_points(mesh.member, cells, mesh.reference_points[locals_], names)
            columns = 3 * np.arange(len(group)) + axes
            shape = (count, 3 * len(group))
            selection = scipy.sparse.csr_matrix((values, (rows, columns)), shape=shape)
            result = result + selection @ motions
        return result.tocsr()

    def dof_of(self, term: MotionTerm) -> int:
        """The dof that equals a node's motion; -1 if the motion depends on several dofs."""
        columns, _ = self.motion_row(term[0], term[1])
        return int(columns[0]) if len(columns) == 1 else -1

    def is_fixed(self, number: int, motion: int) -> bool:
        """Whether a node's motion is zero."""
        return bool(self.fixed[self.motion_row(number, motion)[0]].all())

    def motion_row(self, number: int, motion: int) -> MatrixRow:
        """The row (dofs, coefficients) that gives one motion (0 to 5) of one node."""
        if (number, motion) not in self._single:
            self.prepare_rows([(number, motion)])
        return self._single[number, motion]

    def prepare_rows(self, wanted: Iterable[tuple[int, int]]) -> None:
        """Compute and store the rows of several motions together, which is faster than singly."""
        new = [motion for motion in dict.fromkeys(wanted) if motion not in self._single]
        functionals = self.functionals([[(*motion, 1.0)] for motion in new])
        self._single.update((motion, row_of(functionals, k)) for k, motion in enumerate(new))


def row_of(matrix: Sparse, k: int) -> MatrixRow:
    """Columns and values of row `k` of a matrix."""
    span = slice(matrix.indptr[k], matrix.indptr[k + 1])
    return matrix.indices[span], matrix.data[span]


#: Largest distance of a node from the place to which it is tied, as a share of the tied nodes'
#: size.
TIE_DISTANCE = 1e-3
MIN_WEIGHT = 1e-9  # smaller shares are rounding of the shape functions

#: Node that was added to the deck's -> [(node of the deck, weight)], whose weighted mean it is.
AddedNodes = Mapping[int, Sequence[tuple[int, float]]]
#: A dof between nodes, the nodes that determine it, and their weights.
InterpolatedDof = tuple[int, list[int], Array]


class DofsBetween:
    """Constraints that make dofs between the deck's nodes follow these nodes.

    `equations`: terms of the constraints of the nodes; `functionals`: the same, as rows over all
    dofs; `among`: the nodes that were added to those of the deck.

    If *TIE or equations between coincident nodes tie all nodes of an edge or a face to one cell at
    their own place, the dofs between them follow this cell's displacement there.
    """

    def __init__(
        self,
        nodes: AssemblyNodes,
        equations: Sequence[Sequence[MotionTerm]],
        functionals: Sparse,
        among: AddedNodes,
    ) -> None:
        self.nodes = nodes
        self.equations = equations
        self.functionals = functionals
        self.among = among
        #: motion -> node -> its constraint; 0 or 3 -> node -> directions held
        self.dependent: dict[int, dict[int, int]] = {}
        self.sliding: dict[int, dict[int, list[Array]]] = {}
        for row, terms in enumerate(equations):
            number, motion, _ = terms[0]
            if number < 0:
                continue
            if {n for n, _, _ in terms} != {number}:
                self.dependent.setdefault(motion, {}).setdefault(number, row)
                continue
            direction = np.zeros(3)
            for _, m, coefficient in terms:
                direction[m % 3] = coefficient
            self.sliding.setdefault(3 * (motion // 3), {}).setdefault(number, []).append(direction)

        leaders = np.array([n for terms in equations for n, _, _ in terms[1:] if n >= 0], dtype=int)
        #: node that others follow -> (part, cell) of the cells around it
        self.cells: dict[int, set[tuple[int, int]]] = {}
        for k, mesh in enumerate(nodes.meshes):
            for cell, local in zip(*np.nonzero(np.isin(mesh.numbers, leaders)), strict=True):
                self.cells.setdefault(int(mesh.numbers[cell, local]), set()).add((k, int(cell)))

    def matrix(self) -> Sparse:
        """The constraints, one in each row."""
        found: list[MatrixRow] = []
        for mesh in self.nodes.meshes:
            for motion in self.dependent:
                found += self._followers(mesh, motion)
            for first in self.sliding:
                found += self._slider_rows(mesh, first)

        if not found:
            return self.nodes.layout.zeros(0)
        rows = np.repeat(np.arange(len(found)), [len(columns) for columns, _ in found])
        result = self.nodes.layout.matrix(rows, *_sum_of_rows(found), len(found))
        result.eliminate_zeros()
        return result

    def _dofs(
        self, mesh: NumberedMesh, motion: int, selected: Mapping[int, object]
    ) -> Iterator[InterpolatedDof]:
        """Yield the dofs of one motion between nodes of the deck, some of them `selected`."""
        member = mesh.member
        path = member.part.form.components.get(_component_names(motion)[motion % 3])
        near = [n for n, among in self.among.items() if any(k in selected for k, _ in among)]
        touching = np.flatnonzero(np.isin(mesh.numbers, [*selected, *near]).any(axis=1))
        if path is None or not len(touching):
            return
        space = member.part.form.space
        X = np.asarray(compat.subspace(space, path).element.basix_element.points)
        weights = np.asarray(mesh.coordinate_element.tabulate(0, X))[0, :, :, 0]
        nonzero = [np.flatnonzero(np.abs(row) > 1e-12) for row in weights]
        dofs = member.first + compat.cell_dofs(space, path, touching)

        # each dof once, in the first cell that has it
        first = np.unique(dofs, return_index=True)[1]
        for position, d in (divmod(k, dofs.shape[1]) for k in np.sort(first).tolist()):
            members = nonzero[d]
            numbers = mesh.numbers[touching[position], members]
            shares = self._deck_weights(numbers, weights[d, members])
            if len(shares) > 1 and any(n in selected for n in shares):
                yield int(dofs[position, d]), list(shares), np.array(list(shares.values()))

    def _deck_weights(self, numbers: IntArray, weights: Array) -> dict[int, float]:
        """Weights by node of the deck; an added node is replaced by the nodes that define it."""
        result: dict[int, float] = {}
        for number, weight in zip(numbers.tolist(), weights.tolist(), strict=True):
            for node, share in self.among.get(number, ((number, 1.0),)):
                result[node] = result.get(node, 0.0) + weight * share
        return result

    def _followers(self, mesh: NumberedMesh, motion: int) -> Iterator[MatrixRow]:
        """Yield a constraint for each dof that is a weighted sum of constrained nodes."""
        nodes = self.nodes
        rows = self.dependent[motion]
        beam = mesh.member.part.mesh.tdim == 1
        dofs = list(self._dofs(mesh, motion, rows))
        nodes.prepare_rows((n, motion) for _, numbers, _ in dofs for n in numbers)
        dofs = [dof for dof in dofs if not beam or self._in_one_body(dof[1])]
        dofs = [dof for dof in dofs if self._is_determined(dof[1], motion)]
        tied = {} if beam else self._tied_rows(dofs, motion)

        for column, numbers, weights in dofs:
            terms = [(np.array([column]), np.ones(1))]
            if column in tied:
                columns, values = tied[column]
                yield _sum_of_rows([*terms, (columns, -values)])
                continue
            for node, weight in zip(numbers, weights, strict=True):
                columns, values = nodes.motion_row(node, motion)
                terms.append((columns, -weight * values))
                if node in rows:  # by its constraint without its own term
                    columns, values = row_of(self.functionals, rows[node])
                    terms.append((columns, weight * values / self.equations[rows[node]][0][2]))
            yield _sum_of_rows(terms)

    def _tied_rows(self, dofs: Sequence[InterpolatedDof], motion: int) -> dict[int, MatrixRow]:
        """Row of the motion at each dof's place in the one cell to which all its nodes are tied."""
        by_mesh: dict[int, list[tuple[int, int, Array]]] = {}
        for dof in dofs:
            for k, cell, X in self._tied_places(dof, motion):
                by_mesh.setdefault(k, []).append((dof[0], cell, X))
        result: dict[int, MatrixRow] = {}
        for k, places in by_mesh.items():
            columns, cells, points = zip(*places, strict=True)
            member = self.nodes.meshes[k].member
            where = np.array(cells), np.array(points), _component_names(motion)
            motions = self.nodes.layout.at_points(member, *where)[motion % 3 :: 3]
            result |= {column: row_of(motions, i) for i, column in enumerate(columns)}
        return result

    def _tied_places(self, dof: InterpolatedDof, motion: int) -> list[tuple[int, int, Array]]:
        """[(part, cell, reference point)] of a dof in the one cell of its tied nodes; else []."""
        _, numbers, weights = dof
        rows = self.dependent[motion]
        if not all(number in rows for number in numbers):
            return []
        followed: list[dict[int, float]] = []
        for number in numbers:
            first, *others = self.equations[rows[number]]
            shares = {n: -c / first[2] for n, _, c in others if abs(c) > MIN_WEIGHT}
            alike = all(m == motion and n >= 0 for n, m, _ in others if n in shares)
            if not alike or not shares or abs(sum(shares.values()) - 1) > TIE_DISTANCE:
                return []
            followed.append(shares)

        positions = np.array([self._position(number) for number in numbers])
        distances = np.linalg.norm(positions - positions.mean(axis=0), axis=1)
        reach = TIE_DISTANCE * distances.max()
        total: dict[int, float] = {}
        for shares, weight, x in zip(followed, weights, positions, strict=True):
            place = sum(share * self._position(n) for n, share in shares.items())
            if not float(np.linalg.norm(place - x)) <= reach:
                return []
            for n, share in shares.items():
                total[n] = total.get(n, 0.0) + weight * share

        for k, cell in sorted(set.intersection(*(self.cells.get(n, set()) for n in total))):
            mesh = self.nodes.meshes[k]
            if _component_names(motion)[motion % 3] in mesh.member.part.form.components:
                local = [mesh.numbers[cell].tolist().index(n) for n in total]
                return [(k, cell, np.array([*total.values()]) @ mesh.reference_points[local])]
        return []

    def _position(self, number: int) -> Array:
        """Coordinates (3,) of a node of the deck [m]; nan if no part has it."""
        owners = [mesh for mesh in self.nodes.meshes if number in mesh.cell_of_node]
        return owners[-1].position(number) if owners else np.full(3, np.nan)

    def _in_one_body(self, numbers: Sequence[int]) -> bool:
        """Whether all motions of the nodes follow one point, which may be one of the nodes."""
        leaders: set[int] = set()
        followers: list[set[int]] = []
        for motion in (0, 1, 5) if self.nodes.layout.plane else range(6):
            rows = self.dependent.get(motion, {})
            followers.append({n for n in numbers if n in rows})
            leaders |= {term[0] for n in followers[-1] for term in self.equations[rows[n]][1:]}
        alike = all(follower == followers[0] for follower in followers)
        return alike and len(leaders) == 1 and set(numbers) - followers[0] <= leaders

    def _is_determined(self, numbers: Sequence[int], motion: int) -> bool:
        """Whether constraints or supports determine a motion of all these nodes.

        This holds if every independent node is fixed, or if each dependent node follows all
        independent nodes.
        """
        rows = self.dependent[motion]
        dependent = [n for n in numbers if n in rows]
        independent = set(numbers) - set(dependent)
        equations = [self.equations[rows[n]] for n in dependent]
        followed = [{n for n, m, _ in terms[1:] if m == motion} for terms in equations]
        if followed and all(independent <= leaders for leaders in followed):
            return True
        return all(self.nodes.is_fixed(n, motion) for n in independent)

    def _slider_rows(self, mesh: NumberedMesh, first_motion: int) -> Iterator[MatrixRow]:
        """Yield constraints for dofs between nodes that are fixed or slide across a direction.

        Displacements if `first_motion` is 0, rotations if it is 3.
        """
        nodes = self.nodes
        directions = self.sliding[first_motion]
        axes = range(2 if nodes.layout.plane else 3)
        by_motion = [list(self._dofs(mesh, first_motion + c, directions)) for c in axes]
        near = {n for _, numbers, _ in by_motion[0] for n in numbers}
        nodes.prepare_rows((n, first_motion + c) for n in near - directions.keys() for c in axes)
        for dofs in zip(*by_motion, strict=True):
            columns = np.array([column for column, _, _ in dofs])
            _, numbers, weights = dofs[0]
            sliding = [n for n in numbers if n in directions]
            fixed = [n for n in numbers if n not in directions]
            if not all(nodes.is_fixed(n, first_motion + c) for n in fixed for c in axes):
                continue
            shares = [w for n, w in zip(numbers, weights, strict=True) if n in directions]
            for i in range(min(len(directions[n]) for n in sliding)):
                yield columns, (np.array(shares) @ [directions[n][i] for n in sliding])[axes]


def _component_names(motion: int) -> tuple[str, ...]:
    """The components of a displacement, or of a rotation, to which a motion (0 to 5) belongs."""
    return ROTATIONS if motion >= 3 else DISPLACEMENTS


def _sum_of_rows(terms: Sequence[MatrixRow]) -> MatrixRow:
    """The sum of rows."""
    columns, values = (np.concatenate(pieces) for pieces in zip(*terms, strict=True))
    return columns, values


@dataclass(frozen=True, eq=False)
class SharedNodes(Joint):
    """Joins all parts at the nodes that have the same number."""

    #: part -> number of each node of its mesh, in the order in which they were read
    numbers: Mapping[str, IntArray]
    name: str | None = "shared nodes"

    def constraints(self, layout: Layout, held: Constraints, label: str) -> list[Rows]:
        """Constraints that make shared dofs of a part follow those of an earlier part."""
        members = layout.members.values()
        ordered = sorted(members, key=lambda m: (m.part.form.degree, -m.part.mesh.tdim))
        meshes = [NumberedMesh(m, self.numbers[m.name]) for m in ordered]
        rows: list[Rows] = []
        for k, follower in enumerate(meshes):
            rows += _follower_constraints(layout, follower, meshes[:k])
        return rows


def _follower_constraints(
    layout: Layout, follower: NumberedMesh, leaders: Sequence[NumberedMesh]
) -> list[Rows]:
    """Constraints that make a part follow earlier parts at shared nodes."""
    constraints: list[Rows] = []
    for names in (DISPLACEMENTS, ROTATIONS):
        followed: set[int] = set()
        for leader in leaders:
            own, others = (m.member.part.form.components.keys() for m in (follower, leader))
            if own & others & set(names) and (places := _shared_nodes(follower, leader, followed)):
                followed |= set(places)
                tied = _tied_nodes(layout, follower.member, leader.member, places, names)
                constraints.append(tied)
    return constraints


def _shared_nodes(
    follower: NumberedMesh, leader: NumberedMesh, followed: set[int]
) -> dict[int, int]:
    """Cell of the leader by node of the follower in it; without nodes in `followed`."""
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


def _tied_nodes(
    layout: Layout, follower: Member, leader: Member, where: dict[int, int], names: tuple[str, ...]
) -> Rows:
    """Constraints that make nodes of a part follow the cells of another that contain them."""
    nodes = np.array(list(where))
    cells = np.array(list(where.values()))
    geometry = leader.part.mesh.geometry
    points = leader.at.own(follower.nodes[nodes])
    start = np.tile(geometry.centre(), (len(nodes), 1))
    affine = geometry.affine[cells]
    X = projected(lambda k, X: geometry.at(cells[k], X), points, start, affine=affine)
    for exact in (0.0, 1.0):
        X = np.where(np.abs(X - exact) < 1e-12, exact, X)
    motions = layout.at_points(leader, cells, X, names)
    return following_rows(layout, follower, nodes, [(names, motions)], "shared nodes")


@dataclass(frozen=True, eq=False)
class NodeConstraints(Joint):
    """Constraints Σ coefficient × motion = 0, springs, dampers and masses on nodes of a deck."""

    joints: Joints
    points: Sequence[str]  # names of the reference points in the order of their numbers
    #: part -> number of each node of its mesh, in the order in which they were read
    numbers: Mapping[str, IntArray]
    name: str | None = "constraints of the deck"

    def constraints(self, layout: Layout, held: Constraints, label: str) -> list[Rows]:
        """Rows of the constraints, of the dofs between their nodes, and of middle nodes."""
        nodes = AssemblyNodes(layout, self.points, self.numbers)
        equations = self.joints["equations"]
        matrix = nodes.functionals(equations)
        nodes.prepare_rows((number, motion) for (number, motion, _), *_ in equations)
        dependent = np.array([nodes.dof_of(terms[0]) for terms in equations], dtype=int)
        rows = [Rows(matrix, dependent, label)] if equations else []
        nodes.fixed = held.fixed.copy()
        for row in held.rows:
            is_single = np.diff(row.matrix.indptr) == 1
            nodes.fixed[row.matrix[is_single].indices] = True
        among = dict(self.joints.get("among", []))
        inner = DofsBetween(nodes, equations, matrix, among).matrix()
        found = (inner, _middle_node_constraints(nodes))
        return rows + [Rows.free(matrix, label) for matrix in found if matrix.shape[0]]

    def elastic(self, layout: Layout, label: str) -> list[ElasticTerm]:
        """The springs, dampers and masses as terms of K, C and M."""
        nodes = AssemblyNodes(layout, self.points, self.numbers)
        contributions: list[ElasticTerm] = []
        none = np.zeros((1, 1))
        springs = self.joints["springs"]
        links = [*springs, *self.joints["dampers"]]
        rows = nodes.functionals([terms for terms, _ in links])
        for k, (_, value) in enumerate(links):
            matrix = np.array([[value]])
            K, C = (matrix, None) if k < len(springs) else (none, matrix)
            contributions.append(ElasticTerm(rows[k], K, none, c=C))

        masses = self.joints["masses"]
        rows = nodes.functionals([terms for motions, _, _ in masses for terms in motions])
        start = 0
        for motions, M, mass in masses:
            of_mass = rows[start : start + len(motions)]
            start += len(motions)
            no_stiffness = np.zeros((len(motions),) * 2)
            contributions.append(ElasticTerm(of_mass, no_stiffness, np.array(M), mass))
        return contributions


def _middle_node_constraints(nodes: AssemblyNodes) -> Sparse:
    """Constraints that make a vertex of a part follow the part whose middle node it is."""
    layout = nodes.layout
    rows = [layout.zeros(0)]
    for mesh, other in permutations(nodes.meshes, 2):
        middles = other.numbers[:, other.vertices.shape[1] :]
        numbers = np.intersect1d(mesh.vertices, middles).tolist()
        rotate = mesh.member.has_rotations and other.member.has_rotations
        for names in (DISPLACEMENTS, ROTATIONS)[: 1 + rotate] if numbers else ():
            own, others = (one.motion_matrix(layout, numbers, names) for one in (mesh, other))
            rows.append(own - others)
    result = scipy.sparse.vstack(rows).tocsr()
    result.eliminate_zeros()
    return result[np.diff(result.indptr) > 0]
