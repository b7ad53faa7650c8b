"""New sizes of cells that bring an error down to what is asked with few cells.

A cell of size h and error η² has the error s^(2p) η² if its size becomes s h, and 1/s^d cells
stand in its place (p the order of the elements, d the dimension). Of all sizes with the same total
error those with s = λ (η²)^(-1/(q + d)), q = 2p, take the fewest cells (Ladevèze, Coffignal and
Pelle, 1986). But the largest errors are those at inner edges, where q is that of the singularity,
whatever p is: 1.09 at a right angle (Williams, J. Appl. Mech. 19 (1952) 526). In space, where such
edges hold many cells, sizes for q = 1 leave 0.7 of the error on a stiffened panel with as many
cells as for q = 3, and as much of it on parts without such edges; in the plane they are corners.
"""

from __future__ import annotations

from math import exp

import numpy as np
from mpi4py import MPI
from scipy.optimize import brentq

from antiosc.base._types import Array
from antiosc.fem.mesh.mesh import Mesh
from antiosc.fem.platform import compat

#: Least and largest change of a size at once: what is coarse already does not become much coarser,
#: for its errors would grow by more than is expected.
FINEST, COARSEST = 0.15, 1.3
#: q by dimension: power of the size by which the energy of errors falls where it is largest.
POWER = {1: 4.0, 2: 2.0, 3: 1.0}
#: log λ is sought within this of that of cells with the mean error.
WIDEST = 50.0


def ratios(comm: MPI.Comm, energies: Array, goal: float, order: int, dim: int) -> Array:
    """New over old size of each cell of this rank (cells,).

    Parameters
    ----------
    energies : (cells,) errors η² of the cells of this rank.
    goal : wanted total over the present one; less is not reached with sizes above `FINEST`.
    order, dim : of the elements, of the mesh.
    """
    total, count = comm.allreduce(np.array([energies.sum(), float(len(energies))]))
    if total == 0:
        return np.ones(len(energies))
    share = np.maximum(energies / (total / count), np.finfo(float).tiny)
    wanted = share ** (-1 / (POWER[dim] + dim))

    def sizes(scale: float) -> Array:
        return np.asarray(np.clip(exp(scale) * wanted, FINEST, COARSEST))

    def beyond(scale: float) -> float:
        left = float(np.sum(sizes(scale) ** (2 * order) * energies))
        return float(comm.allreduce(left)) / total - goal

    if beyond(-WIDEST) >= 0:
        return sizes(-WIDEST)
    if beyond(WIDEST) <= 0:
        return sizes(WIDEST)
    return sizes(brentq(beyond, -WIDEST, WIDEST, xtol=1e-12, rtol=1e-14))


def growth(comm: MPI.Comm, ratio: Array, dim: int) -> float:
    """Number of cells with these ratios over the present one."""
    new, old = comm.allreduce(np.array([np.sum(ratio ** -float(dim)), float(len(ratio))]))
    return float(new / old)


def edge_lengths(mesh: Mesh) -> Array:
    """Mean length [m] of the edges of each cell that this rank owns, (cells,)."""
    nodes = compat.geometry_nodes(mesh.dolfinx)[: compat.cell_map(mesh.dolfinx).size_local]
    corners = mesh.dolfinx.geometry.x[nodes[:, : len(mesh.geometry.corners)]]
    count = corners.shape[1]
    one, other = np.triu_indices(count, 1)  # of a simplex all pairs of corners are edges
    return np.asarray(np.linalg.norm(corners[:, one] - corners[:, other], axis=2).mean(axis=1))
