"""Static deflections y = A⁻¹b of many sparse loads b: the compliance bᵀy and the inertia yᵀMy.

With P A Pᵀ = L Lᵀ, bᵀy is the square of z = L⁻¹Pb, and z is zero outside the branch of the
elimination tree from the columns of b to the root (Gilbert and Peierls, SIAM J. Sci. Stat. Comput.
9 (1988) 862). Neighbouring sites share most of that branch and are solved as one block: an eighth
of the operations of separate solves, on a bracket of 10⁵ dofs. On such a bracket a patch takes
1.1 ms, MUMPS's solve for sparse right-hand sides 8.5 ms, and the entries of the inverse that MUMPS
computes 62 ms (measured).

The inertia is minus the derivative of the compliance with respect to the shift s of A = K + sM. The
contribution of the known modes follows from them; only that of the truncated modes is computed,
from a second factor, of A + σM. Over ranks every load is solved for.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from typing import TYPE_CHECKING, Protocol

import numpy as np
import scipy.linalg.blas
import scipy.sparse

from antiosc.base._types import Array, IntArray, Matrix
from antiosc.base.progress import counting
from antiosc.fem.linalg import solver_choice
from antiosc.fem.linalg.algebra import multiply, sum_of
from antiosc.fem.linalg.cholmod import Cholesky
from antiosc.fem.linalg.petsc_algebra import csr, lower
from antiosc.fem.linalg.solver import Factorization, Solver
from antiosc.fem.linalg.solver_choice import OnOneRank

if TYPE_CHECKING:
    from mpi4py import MPI

#: Loads that go through the tree together: few enough that they share their branch.
LOADS_PER_WALK = 64
#: Columns of L that are solved for at a time; the triangle of so many is copied.
PANEL = 128
#: Right-hand sides of a block where all is solved for.
SOLVED = 64
#: σ over the last known ω² + s: the secant is off by about this share, rounding by 1e-12 over it.
SHIFT_STEP = 1e-3

log = logging.getLogger(__name__)


class Factored(Protocol):
    """What compliances need of a `Structure`: K, M, communicator, factor of K + sM."""

    K: Matrix
    M: Matrix

    @property
    def comm(self) -> MPI.Comm: ...
    @property
    def shift(self) -> float: ...
    def factorize(self) -> Solver: ...


def deflections(
    structure: Factored, loads: scipy.sparse.csr_matrix, omega: Array, b: Array
) -> tuple[Array, Array]:
    """(bᵀy [m/N], yᵀMy [kg m²/N²]) of y = (K + shift M)⁻¹b for every load, on every rank.

    Parameters
    ----------
    loads : csr_matrix (rows of this rank, P)
        The vectors b as columns.
    omega, b : (J,) and (P, J)
        The lowest frequencies [rad/s] and the values bᵀφ of their modes for each load.
    """
    solver = structure.factorize()
    if not isinstance(solver, Factorization):
        return _by_solves(structure, loads)

    x = omega**2 + structure.shift
    step = SHIFT_STEP * x[-1]
    C, shifted = _twice(structure, solver, loads, step)

    # what the known modes leave of both; as one mode of compliance `rest` and frequency² 1/slow
    truncated = C - b**2 @ (1 / x)
    rest_after = shifted - b**2 @ (1 / (x + step))
    slow = (truncated - rest_after) / (step * np.where(rest_after > 0, rest_after, np.inf))
    return C, b**2 @ (1 / x**2) + np.maximum(truncated, 0.0) * np.clip(slow, 0.0, 1 / x[-1])


def _twice(
    structure: Factored, solver: Factorization, loads: scipy.sparse.csr_matrix, step: float
) -> tuple[Array, Array]:
    """bᵀ(K + sM)⁻¹b (loads,) of every load b: for the structure's shift s, and for s + `step`."""
    A = sum_of(structure.K, structure.shift + step, structure.M)
    if isinstance(solver, OnOneRank):
        first = solver.cholesky
        second = Cholesky(lower(csr(A)), permutation=first.permutation)
        return compliances(first, loads), compliances(second, loads)

    results = np.zeros((2, loads.shape[1]))
    for result, factor in zip(results, (solver, solver_choice.factorize(A)), strict=True):
        for part, B, Y in _solved(factor, loads):
            result[part] = structure.comm.allreduce(np.einsum("ij,ij->j", B, Y))
    return results[0], results[1]


def _by_solves(structure: Factored, loads: scipy.sparse.csr_matrix) -> tuple[Array, Array]:
    """(bᵀy, yᵀMy) of every load, with one solve for each."""
    C, G = np.zeros((2, loads.shape[1]))
    for part, B, Y in _solved(structure.factorize(), loads):
        C[part] = structure.comm.allreduce(np.einsum("ij,ij->j", B, Y))
        G[part] = structure.comm.allreduce(np.einsum("ij,ij->j", Y, multiply(structure.M, Y)))
    return C, G


def _solved(solver: Solver, loads: scipy.sparse.csr_matrix) -> Iterator[tuple[slice, Array, Array]]:
    """Yield (numbers of some loads, these as columns, A⁻¹ times these)."""
    count = loads.shape[1]
    with counting("sites of the map", count, solver.comm.rank) as report:
        for first in range(0, count, SOLVED):
            part = slice(first, first + SOLVED)
            B = loads[:, part].toarray()
            yield part, B, solver.solve_block(B)
            report(min(first + SOLVED, count))
            log.info("%d of %d sites solved for", min(first + SOLVED, count), count)


def compliances(factor: Cholesky, loads: scipy.sparse.spmatrix) -> Array:
    """bᵀA⁻¹b of every column of `loads` (n, P): (P,)."""
    L = factor.supernodes
    permutation = factor.permutation
    position = np.empty_like(permutation)
    position[permutation] = np.arange(len(position))
    B = scipy.sparse.csc_matrix(loads)
    columns = np.diff(L.start)
    supernode = np.repeat(np.arange(len(columns)), columns)
    parent = _parents(L.row, L.rows, columns, supernode)
    loaded_rows = np.flatnonzero(np.diff(B.indptr))
    # columns in postorder: neighbours in the tree follow one another
    first = np.array(
        [position[B.indices[B.indptr[k] : B.indptr[k + 1]]].min() for k in loaded_rows], int
    )
    order = loaded_rows[np.argsort(first, kind="stable")]
    result = np.zeros(B.shape[1])
    W = np.zeros((len(position), LOADS_PER_WALK))
    with counting("sites of the map", len(order)) as report:
        for start in range(0, len(order), LOADS_PER_WALK):
            sites = order[start : start + LOADS_PER_WALK]
            part = B[:, sites].tocoo()
            rows = position[part.row]
            W[rows, part.col] = part.data
            Z = W[:, : len(sites)]
            for s in _branch(np.unique(supernode[rows]), parent):
                row_numbers = L.rows[L.row[s] : L.row[s + 1]]
                height = len(row_numbers)
                width = columns[s]
                block = L.values[L.value[s] : L.value[s] + height * width].reshape(width, height).T
                z = Z[row_numbers]
                for c in range(0, width, PANEL):
                    d = min(c + PANEL, width)
                    z[c:d] = scipy.linalg.blas.dtrsm(1.0, block[c:d, c:d], z[c:d], lower=1)
                    z[d:] -= block[d:, c:d] @ z[c:d]
                result[sites] += np.einsum("ij,ij->j", z[:width], z[:width])
                Z[row_numbers[width:]] = z[width:]
                Z[L.start[s] : L.start[s + 1]] = 0.0
            report(min(start + LOADS_PER_WALK, len(order)))
    return result


def _parents(row: IntArray, rows: IntArray, columns: IntArray, supernode: IntArray) -> IntArray:
    """Parent (supernodes,) of each supernode in the elimination tree; -1 for a root."""
    below = np.diff(row) > columns
    parent = np.full(len(columns), -1)
    parent[below] = supernode[rows[(row[:-1] + columns)[below]]]
    return parent


def _branch(supernodes: IntArray, parent: IntArray) -> list[int]:
    """The given supernodes and all their ancestors, children before parents."""
    visited: set[int] = set()
    for leaf in supernodes:
        s = int(leaf)
        while s >= 0 and s not in visited:
            visited.add(s)
            s = int(parent[s])
    return sorted(visited)
