"""New sizes of cells that bring an error down to what is asked with the fewest cells.

A cell of size h and error η² has the error s^(2p) η² if its size becomes s h, and 1/s^d cells
stand in its place (p the order of the elements, d the dimension). Of all sizes with the same total
error those with s = λ (η²)^(-1/(2p + d)) take the fewest cells (Ladevèze, Coffignal and Pelle,
1986): the new cells have equal errors.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from antiosc._types import Array
from antiosc.fem import compat
from antiosc.fem.mesh.mesh import Mesh

#: Least and largest change of a size at once.
FINEST, COARSEST = 0.15, 2.0


def ratios(comm: MPI.Comm, energies: Array, goal: float, order: int, dim: int) -> Array:
    """New over old size of each cell of this rank (cells,).

    Parameters
    ----------
    energies : (cells,) errors η² of the cells of this rank.
    goal : wanted total over the present one.
    order, dim : of the elements, of the mesh.
    """
    exponent = 1 / (2 * order + dim)
    total, powers = comm.allreduce(np.array([energies.sum(), np.sum(energies ** (dim * exponent))]))
    if total == 0:
        return np.ones(len(energies))
    scale = (goal * total / powers) ** (1 / (2 * order))
    tiny = np.finfo(float).tiny
    return np.clip(scale * np.maximum(energies, tiny) ** -exponent, FINEST, COARSEST)


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
