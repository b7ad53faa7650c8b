"""Norms of displacements and forces scaled by the diagonal of the matrix, D = diag(A).

An entry of a semidefinite matrix is at most √(a_ii a_jj); in ‖√D x‖ and ‖r/√D‖ all dofs have equal
weight. In an unscaled norm one penalty, or one unit, would hide all others.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from antiosc._types import Array, Matrix
from antiosc.fem.linalg.algebra import communicator, diagonal

if TYPE_CHECKING:
    from mpi4py import MPI


def norms(comm: MPI.Comm, X: Array) -> Array:
    """Euclidean norms over all ranks of vectors as columns (rows, k): (k,)."""
    return np.sqrt(np.asarray(comm.allreduce(np.einsum("ij,ij->j", X, X))))


def roots(matrix: Matrix) -> Array:
    """√a_ii on the rows of this rank; for an empty row a typical value."""
    result = np.sqrt(np.maximum(diagonal(matrix), 0.0))
    comm = communicator(matrix)
    if not all(comm.allgather(result.all())):
        everywhere = np.concatenate(comm.allgather(result))
        result[result == 0] = np.median(everywhere[everywhere > 0])
    return result


def force_ratios(matrix: Matrix, X: Array, product: Array) -> Array:
    """‖A x/√D‖ / ‖√D x‖ of each column, `product` being A X: 1e-16 for a null vector."""
    comm, root = communicator(matrix), roots(matrix)[:, None]
    return norms(comm, product / root) / norms(comm, root * X)


def softness(matrix: Matrix, X: Array, product: Array) -> Array:
    """xᵀA x / xᵀD x of each column, `product` being A X: ±1e-16 for a null vector.

    Unlike `force_ratios` it is insensitive, to first order, to errors in x.
    """
    comm, root = communicator(matrix), roots(matrix)[:, None]
    energy = np.asarray(comm.allreduce(np.einsum("ij,ij->j", X, product)))
    return np.asarray(energy / norms(comm, root * X) ** 2)


def frequency(K: Matrix, M: Matrix) -> float:
    """Median of K_ii/M_ii over the dofs with mass, rad²/s²: below the top of the spectrum."""
    k, m = (diagonal(matrix) for matrix in (K, M))
    ratios = communicator(K).allgather(k[m > 0] / m[m > 0])
    return float(np.median(np.concatenate(ratios)))
