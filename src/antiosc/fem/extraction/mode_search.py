"""`Search`: what a Krylov eigensolver of a library has to find, for SLEPc and for ARPACK."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from antiosc.base._types import Array
from antiosc.fem.extraction.site_shapes import SiteShapes
from antiosc.fem.linalg.algebra import dot, multiply
from antiosc.fem.structure.structure import Structure

if TYPE_CHECKING:
    from mpi4py import MPI

#: Tolerance on the eigenvalues 1/(ω² + s); the residuals are measured again afterwards.
RESIDUAL = 1e-11
#: Number of additional modes that are computed and dropped: of a repeated frequency the search may
#: have found only one of the shapes.
GUARD = 4


class Pin:
    """The constraint of the sites."""

    def __init__(self, held: SiteShapes) -> None:
        self.load, self.y = held.load, held.y
        self._inverse = np.linalg.inv(held.bAb)

    def constrained(self, comm: MPI.Comm, x: Array) -> Array:
        """x − Y (BᵀY)⁻¹Bᵀx, which vanishes at the sites."""
        return np.asarray(x - self.y @ (self._inverse @ dot(comm, self.load, x)))


@dataclass(frozen=True)
class Search:
    """The lowest modes of a structure beside those that are known."""

    structure: Structure
    #: the sites that are constrained; None for natural modes
    pin: Pin | None
    #: M-orthonormal shapes that are deflated (rows of this rank, k)
    known: Array
    #: number of modes to find, and the number that there is
    wanted: int
    limit: int

    @property
    def computed(self) -> int:
        """Number of modes to compute."""
        return min(self.wanted + GUARD, self.limit)

    def inverse(self, r: Array) -> Array:
        """A⁻¹r − Y (BᵀY)⁻¹BᵀA⁻¹r; A⁻¹r for natural modes."""
        x = self.structure.factorize().solve(r)
        if self.pin is None:
            return x
        return self.pin.constrained(self.structure.comm, x)

    def start(self) -> Array:
        """A random vector in the range of A⁻¹M."""
        structure = self.structure
        random = np.random.default_rng(structure.comm.rank).standard_normal(structure.rows)
        return structure.factorize().solve(multiply(structure.M, random))
