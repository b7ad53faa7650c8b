"""Base of all joints of an assembly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from antiosc._types import Array, BoolArray
from antiosc.checks import text
from antiosc.declared import Checked, checked_by
from antiosc.errors import InputError
from antiosc.fem.assembly.constraint_rows import Rows
from antiosc.fem.assembly.ends import END, End, end_text
from antiosc.fem.assembly.layout import Layout, Sparse


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
    """

    G: Sparse
    k: Array
    m: Array
    mass: float = 0.0
    rigid: Array | None = None
    c: Array | None = None

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
