"""Meshes that share nodes, put together.

dolfinx has one kind of cell in a mesh. A deck with triangles beside quadrilaterals, shells beside
solids or beams beside both is therefore one part for each kind, joined where nodes of the meshes
have the same number. On a common edge or face the displacements (and rotations) of the part with
the higher degree follow those of the other, so that they agree along the whole edge or face.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import basix
import numpy as np
import scipy.sparse

from antiosc.base._types import BoolArray, IntArray
from antiosc.base.errors import InputError
from antiosc.fem.assembly.joint import Joint, Rows
from antiosc.fem.assembly.layout import Layout
from antiosc.fem.mesh.cell_geometry import projected
from antiosc.fem.platform import compat
from antiosc.fem.structure.meshed import DISPLACEMENTS, ROTATIONS, Member

#: Nodes with one number lie in one place, up to this share of the size of the assembly.
SAME_PLACE = 1e-6


@dataclass(frozen=True, eq=False)
class SharedNodes(Joint):
    """A joint of all parts at the nodes that have the same number.

    Attributes
    ----------
    numbers : part -> number of each node of its mesh, in the order in which they were read.
    """

    numbers: Mapping[str, IntArray]
    name: str | None = "shared nodes"
    #: whether a part may share no node with the others, for other joints join it
    loose: bool = False

    def constraints(
        self, layout: Layout, before: Sequence[Rows], fixed: BoolArray, label: str
    ) -> list[Rows]:
        """The dofs of a part on what it shares with an earlier one follow the dofs of this one."""
        ordered = sorted(layout.members.values(), key=lambda m: (_degree(m), -m.part.mesh.tdim))
        cells = [_Cells(m, np.asarray(self.numbers[m.name])) for m in ordered]
        _check_places(layout, cells, self.loose)
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
        if read.max() >= len(numbers):
            raise InputError(
                f"the part {member.name!r} has {read.max() + 1} nodes, and {len(numbers)} numbers "
                "are given for them."
            )
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


def _degree(member: Member) -> int:
    """Polynomial degree of the displacements."""
    space = member.part.form.space
    (path, *_) = member.part.form.components.values()
    return int(compat.subspace(space, path).element.basix_element.degree)


def _check_places(layout: Layout, cells: Sequence[_Cells], loose: bool) -> None:
    """InputError where nodes with one number lie apart, or a part shares no node."""
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
    owner = np.repeat(np.arange(len(cells)), [len(c.numbers) for c in cells])
    shared = np.unique(np.concatenate([owner[first], owner[second]]))
    alone = [c.member.name for k, c in enumerate(cells) if k not in shared]
    if alone and len(cells) > 1 and not loose:
        raise InputError(f"the part {alone[0]!r} shares no node with the others.")


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
