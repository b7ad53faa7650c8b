"""What a joint adds to an assembly: linear constraints C u = 0, springs and masses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.checks import text
from antiosc.base.declared import Checked, checked_by
from antiosc.base.errors import InputError
from antiosc.fem.assembly.ends import END, End, end_text
from antiosc.fem.assembly.layout import Layout, Sparse

#: (joint, the joints from which some of its rows follow, number of these rows)
Redundant = tuple[str, list[str], int]


@dataclass(frozen=True, eq=False)
class Rows:
    """Homogeneous constraints of one joint.

    Attributes
    ----------
    matrix : (m, n), each row a functional of u that is zero.
    pivot : (m,) the dof for which each row is solved if possible; -1: any.
    label : the joint's name for messages; empty for supports.
    """

    matrix: Sparse
    pivot: IntArray
    label: str

    @classmethod
    def free(cls, matrix: Sparse, label: str) -> Rows:
        """Rows that may be solved for any of their dofs."""
        return cls(matrix, np.full(matrix.shape[0], -1), label)


@dataclass(frozen=True, eq=False)
class Constraints:
    """All constraints of an assembly; the attributes are the arguments of `eliminate`."""

    rows: Sequence[Rows]
    fixed: BoolArray
    scale: Array
    basis: Sparse | None


@dataclass(frozen=True, eq=False)
class Eliminated:
    """The result of an elimination.

    Attributes
    ----------
    T : (n, n), u = T q; the columns of dependent dofs are empty.
    dependent : (n,) which dofs are not in q, those that are fixed included.
    redundant : joints with rows that follow from those of other joints.
    basis : the orthogonal change of basis in T, if any.
    particular : (n, k) motions that satisfy the constraints with prescribed values, if any.
    """

    T: Sparse
    dependent: BoolArray
    redundant: list[Redundant]
    basis: Sparse | None = None
    particular: Array | None = None

    def coordinates(self, u: Array) -> Array:
        """q of motions u (n, k) that satisfy the constraints."""
        q = np.array(u if self.basis is None else self.basis.T @ u)
        q[self.dependent] = 0.0
        return q


@dataclass(frozen=True, eq=False)
class Stiffness:
    """Gᵀ k G and Gᵀ m G, which a joint or an attachment adds to K_b and M_b.

    Attributes
    ----------
    G : (j, n) functionals of u.
    k, m : (j, j) stiffness and mass of these.
    mass : kg.
    rigid : (j, r) orthonormal values of the functionals that are without strain, where they are
        known.
    c : (j, j) damping of the functionals.
    branches : stiffnesses (j, j) and relaxation times [s] of Maxwell branches.
    """

    G: Sparse
    k: Array
    m: Array
    mass: float = 0.0
    rigid: Array | None = None
    c: Array | None = None
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

    def constraints(
        self,
        layout: Layout,
        before: Sequence[Rows],
        fixed: BoolArray,
        label: str,
    ) -> list[Rows]:
        """Constraints of the joint.

        `before` are those of the supports and of earlier joints, `fixed` the dofs that are zero.
        """
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
