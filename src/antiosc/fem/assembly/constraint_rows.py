"""Linear constraints C u = 0 of an assembly, and what an elimination makes of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from antiosc._types import Array, BoolArray, IntArray
from antiosc.fem.assembly.layout import Sparse

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
