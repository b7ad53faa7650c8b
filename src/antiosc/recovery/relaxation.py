"""Stress of materials that relax, from the strain and the strains of the springs of the branches.

With the long-term stiffness C, the shares g of the Maxwell branches and the strains z in their
dashpots,

    σ = C (ε + Σ g (ε - z)),      τ z' = ε - z,

and section forces likewise. Columns of such a quantity, one for each shape, are followed by g times
the same columns for each branch: they are multiplied by the amplitudes of the shapes in the
displacement, then in the springs of the branches.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from antiosc.base._types import Array, IntArray
from antiosc.base.errors import InputError
from antiosc.fem.structure import Dissipation
from antiosc.fem.structure.structure import Structure

if TYPE_CHECKING:
    from antiosc.fem.structure.meshed import Member

#: Quantities that follow from the stiffness of the material.
OF_STIFFNESS = ("stress", "section_forces")


def branches_of_materials(structure: Structure, count: int) -> list[int]:
    """Indices of the branches of the structure's materials among the `count` branches of a model.

    InputError for a model that does not have the branches of the structure.
    """
    terms = _branches(structure)
    branches = [number for number, term in enumerate(terms) if term.owner is not None]
    if branches and len(terms) != count:
        raise InputError(other_damping("the stress"))
    return branches


def other_damping(what: str) -> str:
    """Message that the damping of a model is not that of the structure."""
    return (
        f"the damping of the model is not that of the structure, so that {what} is unknown: take"
        " the model as `extract` returns it, with the dampers and branches of the structure."
    )


def shares_of(structure: Structure, quantity: str, member: Member) -> Array | None:
    """Factors (materials, 1 + branches) of the stress columns: 1, then the share of each branch.

    The result is None where no material relaxes, or the quantity does not depend on the stiffness.
    """
    terms = [term for term in _branches(structure) if term.owner is not None]
    if quantity not in OF_STIFFNESS or not terms:
        return None
    return np.array(
        [
            [1.0, *(term.factor * (term.owner == (member.name, owner)) for term in terms)]
            for owner in member.part.owners
        ]
    )


def with_branches(columns: Array, shares: Array | None, material: IntArray) -> Array:
    """Columns (P, …, B) at points of these materials (P,), followed by those of the branches."""
    if shares is None:
        return columns
    share = shares[material].reshape(len(columns), *[1] * (columns.ndim - 2), -1, 1)
    return np.asarray((columns[..., None, :] * share).reshape(*columns.shape[:-1], -1))


def _branches(structure: Structure) -> Sequence[Dissipation]:
    return [term for term in structure.matrices.dissipation() if term.tau is not None]
