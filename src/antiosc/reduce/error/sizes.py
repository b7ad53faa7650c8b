"""Required sizes of cells.

If the size of a cell with error η² becomes s h, its error becomes s^(2p) η², and 1/s^d cells
replace it (p the order of the elements, d the dimension). Among all sizes with the same total error
those with s = λ (η²)^(-1/(q + d)), q = 2p, take the fewest cells (Ladevèze, Coffignal and Pelle,
1986). But the largest errors are those at inner edges, where q is that of the singularity, whatever
p is: 1.09 at a right angle (Williams, J. Appl. Mech. 19 (1952) 526). In space, where such edges
hold many cells, sizes for q = 1 leave 0.7 of the error on a stiffened panel with as many cells as
for q = 3, and the same error on parts without such edges. In the plane the singularities are
corners.
"""

from __future__ import annotations

from math import exp

import numpy as np
from mpi4py import MPI

from antiosc.base._types import Array

#: Least ratio of sizes in one step.
FINEST = 0.15
#: Largest ratio of sizes in one step: coarse cells do not become much coarser, since their errors
#: would grow by more than expected.
COARSEST = 1.3
#: q by dimension: power of the size by which the energy of errors falls where it is largest.
POWER = {1: 4.0, 2: 2.0, 3: 1.0}
#: The search for log λ covers this range about the value for cells with the mean error.
WIDEST = 50.0


def ratios(comm: MPI.Comm, energies: Array, goal: float, order: int, dim: int) -> Array:
    """New size over old size of each cell of this rank (cells,).

    Parameters
    ----------
    energies : (cells,) errors η² of the cells of this rank.
    goal : required total error over the present one; not reached if it needs sizes below `FINEST`.
    order, dim : order of the elements, dimension of the mesh.
    """
    from scipy.optimize import brentq  # loaded where it is used: it takes long

    total, count = comm.allreduce(np.array([energies.sum(), float(len(energies))]))
    if total == 0:
        return np.ones(len(energies))
    share = np.maximum(energies / (total / count), np.finfo(float).tiny)
    optimal = share ** (-1 / (POWER[dim] + dim))

    def sizes(scale: float) -> Array:
        """Ratios of new to old cell sizes for the logarithm `scale` of λ (see the module)."""
        return np.asarray(np.clip(exp(scale) * optimal, FINEST, COARSEST))

    def error_excess(scale: float) -> float:
        total_error = float(np.sum(sizes(scale) ** (2 * order) * energies))
        return float(comm.allreduce(total_error)) / total - goal

    if error_excess(-WIDEST) >= 0:
        return sizes(-WIDEST)
    if error_excess(WIDEST) <= 0:
        return sizes(WIDEST)
    return sizes(brentq(error_excess, -WIDEST, WIDEST, xtol=1e-12, rtol=1e-14))


def growth(comm: MPI.Comm, ratio: Array, dim: int) -> float:
    """Ratio of the number of cells after a change of sizes by `ratio` to the present number."""
    n_new, n_old = comm.allreduce(np.array([np.sum(ratio ** -float(dim)), float(len(ratio))]))
    return float(n_new / n_old)
