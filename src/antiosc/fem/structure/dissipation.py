"""What takes energy from a structure: dashpots, Maxwell branches, and layers that relax.

Each term is C = Gᵀ c G of functionals G of the dofs, or a matrix over all dofs. With a relaxation
time tau it is the stiffness of springs in series with dashpots tau C; without one it is that of
dashpots alone (`antiosc.models.damping_matrix`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from antiosc.base._types import Array, Matrix
from antiosc.fem.linalg.algebra import dot, multiply
from antiosc.models.damping_matrix import DampingMatrix, of_factors

#: Eigenvalues of a projected matrix over the largest that are rounding.
ROUNDING = 1e-14


@dataclass(frozen=True, eq=False)
class Dissipation:
    """One term.

    Attributes
    ----------
    G : (j, rows of this rank) functionals; None: `matrix` stands for Gᵀ c G.
    c : (j, j) [N s/m], or of a branch [N/m].
    tau : relaxation time [s] of a branch; None: dashpots.
    matrix : of all dofs, times `factor`.
    """

    G: Any = None
    c: Array | None = None
    tau: float | None = None
    matrix: Matrix | None = None
    factor: float = 1.0

    def projected(self, comm: Any, V: Array) -> Array:
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


def projected(comm: Any, terms: Sequence[Dissipation], V: Array) -> DampingMatrix:
    """All damping of the motions V (rows of this rank, k)."""
    none = np.zeros((0, V.shape[1]))
    found = [(one.projected(comm, V), one.tau) for one in terms]
    viscous = np.vstack([none, *(L for L, tau in found if tau is None)])
    return of_factors(viscous, [(L, tau) for L, tau in found if tau is not None])
