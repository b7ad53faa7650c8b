"""What takes energy: dashpots, Maxwell branches and layers that relax, as terms of a sum."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from antiosc.base._types import Array, Matrix
from antiosc.fem.linalg.algebra import dot, multiply
from antiosc.models.damping import DampingMatrix, of_factors

if TYPE_CHECKING:
    from mpi4py import MPI

#: Eigenvalues of a projected matrix over the largest that are rounding.
ROUNDING = 1e-14


@dataclass(frozen=True, eq=False)
class Dissipation:
    """One term Gᵀ c G of the damping."""

    G: Matrix = None  # (j, rows of this rank) functionals; None: `matrix` stands for Gᵀ c G
    c: Array | None = None  # (j, j) [N s/m], or of a branch [N/m]
    tau: float | None = None  # relaxation time [s] of a branch; None: dashpots
    matrix: Matrix | None = None  # of all dofs, times `factor`
    factor: float = 1.0

    def projected(self, comm: MPI.Comm, V: Array) -> Array:
        """L (r, k) with L'L = Vᵀ C V, for V (rows of this rank, k)."""
        if self.matrix is None:
            assert self.c is not None
            return np.asarray(_root(self.c) @ comm.allreduce(np.asarray(self.G @ V)))
        return _root(self.factor * dot(comm, V, multiply(self.matrix, V)))


def _root(matrix: Array) -> Array:
    """L with L'L = the semidefinite matrix."""
    diagonal = matrix.diagonal()
    least = max(ROUNDING * float(diagonal.max(initial=0.0)), float(np.finfo(float).tiny))
    scale = np.sqrt(np.maximum(diagonal, least))  # what lies below is rounding
    values, vectors = np.linalg.eigh((matrix + matrix.T) / 2 / np.outer(scale, scale))
    real = values > ROUNDING * values.max(initial=0.0)
    return np.asarray((vectors[:, real] * np.sqrt(values[real])).T * scale)


def ends(terms: Sequence[Dissipation]) -> Array | None:
    """Gᵀ (rows of this rank, k) of all functionals: the forces of dashpots and branches."""
    loads = [np.asarray(one.G.T.toarray()) for one in terms if one.matrix is None]
    return np.hstack(loads) if loads else None


def projected(comm: MPI.Comm, terms: Sequence[Dissipation], V: Array) -> DampingMatrix:
    """All damping of the motions V (rows of this rank, k)."""
    none = np.zeros((0, V.shape[1]))
    found = [(one.projected(comm, V), one.tau) for one in terms]
    viscous = np.vstack([none, *(L for L, tau in found if tau is None)])
    return of_factors(viscous, [(L, tau) for L, tau in found if tau is not None])
