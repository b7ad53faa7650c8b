"""`Equation`: a linear equation between displacements and rotations, given by hand (MPC)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy.sparse

from antiosc._types import BoolArray
from antiosc.checks import number, shown, store
from antiosc.errors import InputError
from antiosc.fem.assembly.constraint_rows import Rows
from antiosc.fem.assembly.ends import End, checked_end, end_text, motion
from antiosc.fem.assembly.joint import NAME, Joint
from antiosc.fem.assembly.layout import Layout
from antiosc.fem.structure.member import DISPLACEMENTS, ROTATIONS


@dataclass(frozen=True)
class Equation(Joint):
    """Σ coefficient · component = 0 of displacements (m) and rotations (rad).

    Parameters
    ----------
    terms : sequence of (end, component, coefficient)
        `end` as for `Weld`; `component` is "x", "y", "z", "rx", "ry" or "rz" in the axes of the
        assembly.
    name : str, optional
        What messages call the equation.
    """

    terms: Sequence[tuple[End, str, float]]
    name: str | None = field(default=None, metadata=NAME)

    def __post_init__(self) -> None:
        if not isinstance(self.terms, Sequence) or isinstance(self.terms, str) or not self.terms:
            raise InputError(
                f"terms must list (end, component, coefficient); got {shown(self.terms)}."
            )
        terms = tuple(_checked(term) for term in self.terms)
        if not any(coefficient for _, _, coefficient in terms):
            raise InputError("an Equation needs a coefficient that is not 0.")
        store(self, terms=terms)
        super().__post_init__()

    def constraints(
        self, layout: Layout, before: Sequence[Rows], fixed: BoolArray, label: str
    ) -> list[Rows]:
        """The one row of the equation."""
        total = layout.nothing(1)
        for end, component, coefficient in self.terms:
            own = motion(layout, end, partly=True)
            six = scipy.sparse.vstack([own.displacements, own.rotations]).tocsr()
            row = six[(DISPLACEMENTS + ROTATIONS).index(component)]
            if not row.nnz or (component in DISPLACEMENTS and not own.has(component)):
                raise InputError(
                    f"{label}: {end_text(end)} has no component {component!r}; points of solids "
                    "have no rotations, plane parts move along x and y, a site of a model along "
                    "its direction."
                )
            total = total + coefficient * row
        total = total.tocsr()
        total.eliminate_zeros()
        if not total.nnz:
            raise InputError(f"{label} says 0 = 0: its terms cancel.")
        return [Rows(total, np.full(1, -1), label)]


def _checked(term: Any) -> tuple[End, str, float]:
    if not isinstance(term, tuple | list) or len(term) != 3:
        raise InputError(
            f"a term must be (end, component, coefficient), as (('plate', (0, 0, 0)), 'z', 1.0); "
            f"got {shown(term)}."
        )
    end, component, coefficient = term
    if not isinstance(component, str) or component not in DISPLACEMENTS + ROTATIONS:
        raise InputError(
            f"a component must be one of {', '.join(DISPLACEMENTS + ROTATIONS)}; "
            f"got {shown(component)}."
        )
    return checked_end("end", end), component, number("a coefficient", coefficient)
