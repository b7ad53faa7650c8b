"""Joints: rows of constraints C u = 0, and terms Gᵀ k G of springs and masses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import scipy.linalg
import scipy.sparse

from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.checks import Checked, checked_by, text
from antiosc.base.errors import InputError
from antiosc.fem.assembly.ends import END, End, end_text
from antiosc.fem.assembly.layout import Layout, Sparse
from antiosc.fem.structure.meshed import Member


@dataclass(frozen=True, eq=False)
class Rows:
    """Homogeneous linear constraints of one joint."""

    matrix: Sparse  # (m, n), each row a functional of u that is zero
    pivot: IntArray  # (m,) the dof for which each row is solved if possible; -1: any
    label: str  # the joint's name for messages; empty for supports

    @classmethod
    def free(cls, matrix: Sparse, label: str) -> Rows:
        """Rows without a preferred pivot: each may be solved for any of its dofs."""
        return cls(matrix, np.full(matrix.shape[0], -1), label)


def following(
    layout: Layout,
    member: Member,
    nodes: IntArray,
    motions: Sequence[tuple[tuple[str, ...], Sparse]],
    label: str,
) -> Rows:
    """Constraints by which dofs of P nodes follow motions [(components, (3P, n))]."""
    rows, pivots = [], []
    for names, motion in motions:
        for name, of_component in layout.of_components(member, names, motion):
            pivots.append(layout.dofs(member, nodes, name))
            rows.append(layout.units(pivots[-1]) - of_component)
    matrix = scipy.sparse.vstack(rows).tocsr()
    matrix.eliminate_zeros()
    return Rows(matrix, np.concatenate(pivots), label)


@dataclass(frozen=True, eq=False)
class Constraints:
    """Constraints of an assembly; the attributes are arguments of `eliminate`."""

    rows: Sequence[Rows]  # of the supports first, then of the joints
    fixed: BoolArray  # (n,) dofs that are zero
    scale: Array  # (n,) typical size of each dof


@dataclass(frozen=True, eq=False)
class Eliminated:
    """Motions u = T q that meet all constraints."""

    T: Sparse  # (n, n), u = T q; the columns of dependent dofs are empty
    dependent: BoolArray  # (n,) which dofs are not in q, those that are fixed included
    redundant: Mapping[str, int]  # joint -> number of its rows that follow from others
    #: (n, k) motions that satisfy the constraints with prescribed values, if any
    particular: Array | None = None

    def coordinates(self, u: Array) -> Array:
        """Independent coordinates q of admissible motions u (n, k)."""
        q = np.array(u)
        q[self.dependent] = 0.0
        return q


@dataclass(frozen=True, eq=False)
class Stiffness:
    """Stiffness k and mass m of functionals G: Gᵀ k G is added to K_b, Gᵀ m G to M_b."""

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
    name: str = ""  # of the joint or attachment
    point: Array | None = None  # (3,) of an attachment, m

    @property
    def strains(self) -> Array:
        """Unit combinations (r, functionals) of the functionals that vanish in strain-free motions.

        Functionals without entries, such as motions out of a plane, take no part.
        """
        if self.rigid is not None:
            basis, _ = np.linalg.qr(self.rigid, mode="complete")
            return np.asarray(basis[:, self.rigid.shape[1] :].T)
        nonzero_rows = np.flatnonzero(np.diff(self.G.indptr))
        values, vectors = np.linalg.eigh(self.k[np.ix_(nonzero_rows, nonzero_rows)])
        vectors = vectors[:, values > 1e-12 * max(values[-1], np.finfo(float).tiny)]
        strains = np.zeros((vectors.shape[1], len(self.k)))
        strains[:, nonzero_rows] = vectors.T
        return strains


class Joint(Checked):
    """A joint between parts: linear constraints, springs and masses.

    `name` is its name in messages.
    """

    name: str | None
    #: whether its constraints are made after those of other joints
    late: ClassVar[bool] = False

    def prepare(self, layout: Layout, label: str) -> None:
        """Add the reference points of the joint to the layout."""

    def constraints(self, layout: Layout, held: Constraints, label: str) -> list[Rows]:
        """The linear constraints C u = 0 of the joint."""
        return []

    def elastic(self, layout: Layout, label: str) -> list[Stiffness]:
        """The springs and masses of the joint."""
        return []

    def label(self, number: int) -> str:
        """The joint's name, or its class and its number in the list of joints."""
        if self.name:
            return repr(self.name)
        return f"joint {number} ({type(self).__name__})"


@dataclass(frozen=True)
class TwoEnds(Joint):
    """Base of joints between two ends."""

    a: End = field(metadata=END)
    b: End = field(metadata=END)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.a == self.b:
            raise InputError(f"a {type(self).__name__} joins {end_text(self.a)} to itself.")


#: Metadata of the field `name` of a joint.
NAME = checked_by(text)
