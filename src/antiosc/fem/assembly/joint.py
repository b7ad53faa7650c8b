"""What joints, supports and attachments add: constraints C u = 0, springs and masses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import scipy.sparse

from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.checks import Checked, checked_by, text
from antiosc.base.errors import InputError
from antiosc.fem.assembly.ends import END, End, Motion, end_text, group_end, motion
from antiosc.fem.assembly.layout import Layout, Sparse
from antiosc.fem.assembly.superelement import Condensed
from antiosc.fem.mesh.entities import largest
from antiosc.fem.structure.attachments import Damper, PointMass, Spring, values_of
from antiosc.fem.structure.meshed import DISPLACEMENTS, ROTATIONS, Member
from antiosc.fem.structure.placement import in_space
from antiosc.fem.structure.support import Support
from antiosc.io.dof_map import COMPONENTS

#: (joint, the joints from which some of its rows follow, number of these rows)
Redundant = tuple[str, list[str], int]


@dataclass(frozen=True, eq=False)
class Rows:
    """Homogeneous constraints of one joint."""

    matrix: Sparse  # (m, n), each row a functional of u that is zero
    pivot: IntArray  # (m,) the dof for which each row is solved if possible; -1: any
    label: str  # the joint's name for messages; empty for supports

    @classmethod
    def free(cls, matrix: Sparse, label: str) -> Rows:
        """Rows that may be solved for any of their dofs."""
        return cls(matrix, np.full(matrix.shape[0], -1), label)


@dataclass(frozen=True, eq=False)
class Held:
    """What is held before the constraints of a joint are made."""

    rows: Sequence[Rows]  # of the supports and of earlier joints
    fixed: BoolArray  # (n,) dofs that are zero


@dataclass(frozen=True, eq=False)
class Constraints:
    """All constraints of an assembly; the attributes are the arguments of `eliminate`."""

    rows: Sequence[Rows]
    fixed: BoolArray
    scale: Array
    basis: Sparse | None


@dataclass(frozen=True, eq=False)
class Eliminated:
    """The result of an elimination."""

    T: Sparse  # (n, n), u = T q; the columns of dependent dofs are empty
    dependent: BoolArray  # (n,) which dofs are not in q, those that are fixed included
    redundant: list[Redundant]  # joints with rows that follow from those of other joints
    basis: Sparse | None = None  # the orthogonal change of basis in T, if any
    #: (n, k) motions that satisfy the constraints with prescribed values, if any
    particular: Array | None = None

    def coordinates(self, u: Array) -> Array:
        """q of motions u (n, k) that satisfy the constraints."""
        q = np.array(u if self.basis is None else self.basis.T @ u)
        q[self.dependent] = 0.0
        return q


@dataclass(frozen=True, eq=False)
class Stiffness:
    """Gᵀ k G and Gᵀ m G, which a joint or an attachment adds to K_b and M_b."""

    G: Sparse  # (j, n) functionals of u
    #: k, m: (j, j) stiffness and mass of these
    k: Array
    m: Array
    mass: float = 0.0  # kg
    #: (j, r) orthonormal values of the functionals that are without strain, where they are known
    rigid: Array | None = None
    c: Array | None = None  # (j, j) damping of the functionals
    #: stiffnesses (j, j) and relaxation times [s] of Maxwell branches
    branches: Sequence[tuple[Array, float]] = ()

    @property
    def strains(self) -> Array:
        """Unit combinations of the functionals that a motion without strain leaves at zero.

        Functionals that are zero, as motions out of a plane, are in none of them.
        """
        if self.rigid is not None:
            whole, _ = np.linalg.qr(self.rigid, mode="complete")
            return np.asarray(whole[:, self.rigid.shape[1] :].T)
        some = np.flatnonzero(np.diff(self.G.indptr))
        values, vectors = np.linalg.eigh(self.k[np.ix_(some, some)])
        vectors = vectors[:, values > 1e-12 * max(values[-1], np.finfo(float).tiny)]
        found = np.zeros((vectors.shape[1], len(self.k)))
        found[:, some] = vectors.T
        return found


class Joint(Checked):
    """A joint between parts: linear constraints, springs and masses.

    `name` is what messages call it.
    """

    name: str | None
    #: whether its constraints are made after those of other joints
    late: ClassVar[bool] = False

    def prepare(self, layout: Layout, label: str) -> None:
        """Add the reference points that the joint brings with it to the layout."""

    def constraints(self, layout: Layout, held: Held, label: str) -> list[Rows]:
        """Constraints of the joint."""
        return []

    def elastic(self, layout: Layout, label: str) -> list[Stiffness]:
        """Springs and masses of the joint."""
        return []

    def label(self, number: int) -> str:
        """The joint's name, or its kind and number in the list of joints."""
        return repr(self.name) if self.name else f"joint {number} ({type(self).__name__})"


@dataclass(frozen=True)
class Between(Joint):
    """Base of the joints of two ends."""

    a: End = field(metadata=END)
    b: End = field(metadata=END)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.a == self.b:
            raise InputError(f"a {type(self).__name__} joins {end_text(self.a)} to itself.")


#: Metadata of the field `name` of a joint.
NAME = checked_by(text)


def support_rows(layout: Layout, support: Support) -> Sparse:
    """Functionals that a support holds at zero."""
    names = support.components(["x", "y", "rz"] if layout.plane else COMPONENTS)
    if isinstance(support.where, str) and (
        support.where in layout.points or support.where.split(":", 1)[0] in layout.condensed
    ):
        point = motion(layout, support.where, partly=True)
        if support.fix == "all":
            six = point.components()
            return six[np.flatnonzero(np.diff(six.indptr))]
        lost = [name for name in names if name in DISPLACEMENTS and not point.has(name)]
        if lost:
            raise InputError(
                f"the support {support.label} fixes {', '.join(lost)}, which this site does "
                "not have."
            )
        return point.components(names)
    found = []
    for member, nodes in _nodes(layout, support):
        for kind in (DISPLACEMENTS, ROTATIONS):
            wanted = [kind.index(name) for name in names if name in kind]
            own = layout.at_nodes(member, nodes, kind)
            rows = (3 * np.arange(len(nodes))[:, None] + wanted).ravel().astype(int)
            found.append(own[rows])
    result = scipy.sparse.vstack([layout.nothing(0), *found]).tocsr()
    if not result.nnz:
        raise InputError(
            f"the support {support.label} fixes nothing: no node of the assembly that can "
            f"move along {', '.join(names)} lies there."
        )
    return result


def _nodes(layout: Layout, support: Support) -> list[tuple[Member, IntArray]]:
    if isinstance(support.where, str):
        member, group = group_end(layout, "where", support.where)
        return [(member, member.nodes_of(group))]
    return [
        (member, np.flatnonzero(support.selected(member.nodes)))
        for member in layout.members.values()
    ]


def attachment(layout: Layout, one: PointMass | Spring | Damper) -> list[Stiffness]:
    """What a mass, a grounded spring or a damper adds, at each of its places."""
    values = values_of(one, layout.plane)
    names, diagonal = list(values), np.diag(list(values.values()))
    zero = np.zeros_like(diagonal)
    other = _places(layout, one.to)[0] if isinstance(one, Damper) and one.to is not None else None
    found = []
    for end in _places(layout, one.where):
        lost = end.lacking(names)
        if lost:
            raise InputError(
                f"{type(one).__name__} at {one.where!r} acts on {', '.join(lost)}, which this "
                "point does not have: points of solids have no rotations (act on a group or on a "
                "reference point)."
            )
        G = end.components(names)
        if other is not None:
            G = G - other.components(names)
        if isinstance(one, PointMass):
            found.append(Stiffness(G, zero, diagonal, one.mass))
        elif isinstance(one, Spring):
            found.append(Stiffness(G, diagonal, zero))
        elif one.tau is None:
            found.append(Stiffness(G, zero, zero, c=diagonal))
        else:
            found.append(Stiffness(G, zero, zero, branches=[(diagonal, one.tau)]))
    return found


def superelement(layout: Layout, one: Condensed) -> Stiffness:
    """K and M of a superelement on its own dofs."""
    part = one.part
    own = layout.units(np.arange(one.first, one.first + one.size))
    return Stiffness(own, part.K, part.M, rigid=part.rigid)


def _places(layout: Layout, where: str | Sequence[float]) -> list[Motion]:
    """The points at which an attachment acts."""
    if not isinstance(where, str):
        x = in_space(where)
        name = min(
            layout.members,
            key=lambda name: float(layout.members[name].closest(x[None]).distance[0]),
        )
        return [motion(layout, (name, tuple(x)))]
    part, _, group = where.partition(":")
    if group and part in layout.members:
        member = layout.members[part]
        if group in member.part.mesh.groups and largest(member.part.mesh, group)[0] == 0:
            return [
                motion(layout, (member.name, tuple(member.nodes[node])))
                for node in member.nodes_of(group)
            ]
    return [motion(layout, where, partly=True)]
