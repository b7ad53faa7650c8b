"""`Search`: what a Krylov eigensolver of a library has to find, for SLEPc and for ARPACK."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from antiosc._types import Array
from antiosc.fem.extraction.static_mode import StaticMode
from antiosc.fem.linalg.algebra import dot, multiply
from antiosc.fem.structure.structure import Structure

#: Tolerance on the eigenvalues 1/(ω² + s); the residuals are measured again afterwards.
TOLERANCE = 1e-11
#: Number of additional modes that are computed and dropped: of a repeated frequency the search may
#: have found only one of the shapes.
GUARD = 4


@dataclass(frozen=True)
class Search:
    """The lowest modes of a structure beside those that are known."""

    structure: Structure
    #: (b, static mode) of the site that is constrained; None for natural modes
    pin: tuple[Array, StaticMode] | None
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
        """A⁻¹r − y (bᵀA⁻¹r)/(bᵀy); A⁻¹r for natural modes."""
        x = self.structure.factorize().solve(r)
        if self.pin is None:
            return x
        b, static = self.pin
        return np.asarray(x - dot(self.structure.comm, b, x) / static.bAb * static.y)

    def start(self) -> Array:
        """A random vector in the range of A⁻¹M."""
        structure = self.structure
        random = np.random.default_rng(structure.comm.rank).standard_normal(structure.rows)
        return structure.factorize().solve(multiply(structure.M, random))
