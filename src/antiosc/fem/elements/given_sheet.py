"""`GivenSheet`: a shell by its stiffnesses, as decks of other programs state them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import sqrt

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base._types import Array
from antiosc.base.checks import array, number, positive
from antiosc.base.declared import checked_by
from antiosc.base.errors import InputError
from antiosc.fem.elements.material_axes import DIRECTION, Direction
from antiosc.fem.elements.plate_section import PlateSection
from antiosc.fem.elements.shell import Sheet


def _definite(name: str, value: ArrayLike, size: int) -> Array:
    """A stiffness as a symmetric, positive definite matrix, or InputError."""
    m = array(name, value, (size, size))
    symmetric = np.abs(m - m.T).max() <= 1e-9 * np.abs(m).max()
    if not symmetric or not np.linalg.eigvalsh(m).min() > 1e-12 * np.abs(m).max():
        raise InputError(
            f"the stiffness {name} of a shell must be symmetric and positive definite."
        )
    return np.asarray((m + m.T) / 2)


@dataclass(frozen=True, eq=False)
class GivenSheet(Sheet):
    """A plate or shell with a bending stiffness that does not follow from its membrane stiffness.

    Parameters
    ----------
    A, D : array_like (3, 3)
        Forces of (ε1, ε2, γ12), N/m, and moments of (κ1, κ2, 2κ12), N m.
    S : array_like (2, 2)
        Shear forces of (γ13, γ23), N/m.
    mass, inertia : float
        Per area, kg/m² and kg.
    thickness : float
        For sites, m.
    axis, top, offset
        As of `Laminate`.

    Raises
    ------
    InputError
        Stiffnesses that are not symmetric and positive definite.
    """

    A: ArrayLike = field(metadata=checked_by(_definite, 3))
    D: ArrayLike = field(metadata=checked_by(_definite, 3))
    S: ArrayLike = field(metadata=checked_by(_definite, 2))
    mass: float = field(metadata=checked_by(positive))
    inertia: float = field(metadata=checked_by(positive))
    thickness: float = field(metadata=checked_by(positive))
    axis: Direction = field(default=(1.0, 0.0, 0.0), metadata=DIRECTION)
    top: Direction | None = field(default=None, metadata=DIRECTION)
    offset: float = field(default=0.0, metadata=checked_by(number, "m"))

    @cached_property
    def section(self) -> PlateSection:
        """Stiffness and mass per area of the surface of the mesh."""
        A = np.asarray(self.A)
        return PlateSection(
            thickness=self.thickness,
            A=A,
            B=np.zeros((3, 3)),
            D=np.asarray(self.D),
            S=np.asarray(self.S),
            drilling=float(A[2, 2]),
            I0=self.mass,
            I1=0.0,
            I2=self.inertia,
        ).shifted(self.offset)

    def bar_speed(self) -> float:
        """√(E/ρ), m/s, along the stiffer direction."""
        return sqrt(float((1 / np.diag(np.linalg.inv(np.asarray(self.A))))[:2].max()) / self.mass)

    def constants(self) -> tuple[float, float, float]:
        """InputError: it has no material."""
        raise InputError(
            "advise needs an isotropic material; got a shell that is given by its stiffnesses: "
            "give the dimensions, and equivalent E, nu, rho of the part."
        )


@dataclass(frozen=True, eq=False)
class Nearest:
    """A direction in each cell: the given one (n, 3) of the nearest place (n, 3)."""

    places: ArrayLike
    directions: Sequence[Sequence[float]]

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """Directions (3, n) at points (3, n)."""
        from scipy.spatial import cKDTree

        nearest = cKDTree(np.asarray(self.places)).query(x.T)[1]
        return np.asarray(self.directions)[nearest].T
