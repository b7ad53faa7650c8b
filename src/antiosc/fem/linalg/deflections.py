"""Static deflections y = A⁻¹b of many sparse loads b: the compliance bᵀy and the inertia yᵀMy.

With P A Pᵀ = L Lᵀ, bᵀy is the square of z = L⁻¹Pb, and z is zero outside the branch of the
elimination tree from the columns of b to the root (Gilbert and Peierls, SIAM J. Sci. Stat. Comput.
9 (1988) 862). Neighbouring sites share most of that branch and are solved as one block, which takes
an eighth of the operations of separate solves on a bracket of 10⁵ dofs. There a patch takes 1.1 ms;
MUMPS takes 8.5 ms by sparse right-hand sides, 62 ms by entries of the inverse (measured). Each
block is computed by one thread; the cores share the blocks.

The inertia is minus the derivative of the compliance with respect to the shift s of A = K + sM. The
known modes give their contribution directly; the contribution of the truncated modes is computed
with a factor of A + σM. On several ranks one solve is made for every load.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Protocol

import numpy as np
import scipy.linalg.blas
import scipy.sparse
from mpi4py import MPI

from antiosc.base._types import Array, Matrix
from antiosc.base.process import free_threads
from antiosc.base.progress import counting
from antiosc.fem.linalg.algebra import column_products, multiply, sum_of
from antiosc.fem.linalg.cholmod import Cholesky
from antiosc.fem.linalg.petsc_algebra import csr, lower_triangle
from antiosc.fem.linalg.solver import Factorization, Solver
from antiosc.fem.linalg.solver_choice import CholmodFactor, factorize

#: Loads that go through the tree together.
LOADS_PER_WALK = 256
#: Columns of L that are solved for at a time; the triangle of so many is copied.
PANEL_COLUMNS = 128
#: Right-hand sides of a block where all is solved for.
LOADS_PER_SOLVE = 64
#: σ over the last known ω² + s: the secant is off by about this share, rounding by 1e-12 over it.
SHIFT_STEP = 1e-3

#: Zᵀ = (L⁻¹Z)ᵀ without a copy, of arguments 1, L, Zᵀ
solve_in_place = partial(scipy.linalg.blas.dtrsm, side=1, lower=1, trans_a=1, overwrite_b=1)

log = logging.getLogger(__name__)


class FactoredStructure(Protocol):
    """The attributes of a `Structure` that compliances need."""

    K: Matrix
    M: Matrix

    @property
    def comm(self) -> MPI.Comm: ...
    @property
    def shift(self) -> float: ...  # s [rad²/s²] of the matrix K + sM
    def factorize(self) -> Solver: ...  # of K + sM


def deflections(
    structure: FactoredStructure, loads: scipy.sparse.csr_matrix, omega: Array, b: Array
) -> tuple[Array, Array]:
    """(fᵀy [m/N], yᵀMy [kg m²/N²]) on every rank, y = (K + shift M)⁻¹f, for each column f of
    `loads` (rows, P). `omega` (J,) [rad/s] and `b` (P, J): known modes and their modal loads."""
    solver = structure.factorize()
    if not isinstance(solver, Factorization):
        return _deflections_by_solves(structure, loads)

    x = omega**2 + structure.shift
    step = SHIFT_STEP * x[-1]
    C, shifted = _compliances_at_two_shifts(structure, solver, loads, step)

    # compliances of the truncated modes, as one mode of compliance `truncated`, frequency² 1/slow
    truncated = C - b**2 @ (1 / x)
    rest_after = shifted - b**2 @ (1 / (x + step))
    slow = (truncated - rest_after) / (step * np.where(rest_after > 0, rest_after, np.inf))
    return C, b**2 @ (1 / x**2) + np.maximum(truncated, 0.0) * np.clip(slow, 0.0, 1 / x[-1])


def _compliances_at_two_shifts(
    structure: FactoredStructure, solver: Factorization, loads: scipy.sparse.csr_matrix, step: float
) -> tuple[Array, Array]:
    """bᵀ(K + sM)⁻¹b (P,) of every load b at the structure's shift s, and at s + `step`."""
    if isinstance(solver, CholmodFactor):
        first = solver.cholesky
        A = csr(structure.K) + (structure.shift + step) * csr(structure.M)
        second = Cholesky(lower_triangle(A), permutation=first.permutation).factorized()
        return compliances(first, loads), compliances(second, loads)

    A = sum_of(structure.K, structure.shift + step, structure.M)
    results = np.zeros((2, loads.shape[1]))
    for result, factor in zip(results, (solver, factorize(A)), strict=True):
        for part, B, Y in _blocks_of_solutions(factor, loads):
            result[part] = column_products(structure.comm, B, Y)
    return results[0], results[1]


def _deflections_by_solves(
    structure: FactoredStructure, loads: scipy.sparse.csr_matrix
) -> tuple[Array, Array]:
    """(bᵀy, yᵀMy) of every load b, by one solve y = (K + shift M)⁻¹b each."""
    C, G = np.zeros((2, loads.shape[1]))
    for part, B, Y in _blocks_of_solutions(structure.factorize(), loads):
        C[part] = column_products(structure.comm, B, Y)
        G[part] = column_products(structure.comm, Y, multiply(structure.M, Y))
    return C, G


def _blocks_of_solutions(
    solver: Solver, loads: scipy.sparse.csr_matrix
) -> Iterator[tuple[slice, Array, Array]]:
    """Yield (slice of loads, these loads B as dense columns, A⁻¹B), block by block."""
    count = loads.shape[1]

    with counting("sites of the map", count) as report:
        for first in range(0, count, LOADS_PER_SOLVE):
            part = slice(first, first + LOADS_PER_SOLVE)
            B = loads[:, part].toarray()
            yield part, B, solver.solve_block(B)
            report(min(first + LOADS_PER_SOLVE, count))
            log.info("%d of %d sites solved for", min(first + LOADS_PER_SOLVE, count), count)


def compliances(factor: Cholesky, loads: scipy.sparse.spmatrix) -> Array:
    """bᵀA⁻¹b (P,) of every column b of `loads` (n, P), A being factored."""
    substitution = ForwardSubstitution(factor)
    B = scipy.sparse.csc_matrix(loads)
    loaded = np.flatnonzero(np.diff(B.indptr))

    # columns in postorder: neighbours in the tree follow one another
    first = np.minimum.reduceat(substitution.position[B.indices], B.indptr[loaded])
    order = loaded[np.argsort(first, kind="stable")]
    blocks = [order[k : k + LOADS_PER_WALK] for k in range(0, len(order), LOADS_PER_WALK)]

    result = np.zeros(B.shape[1])
    done = 0
    with (
        counting("sites of the map", len(order)) as report,
        ThreadPoolExecutor(free_threads()) as pool,
    ):
        found = pool.map(substitution.compliances, (B[:, sites] for sites in blocks))
        for sites, values in zip(blocks, found, strict=True):
            result[sites] = values
            done += len(sites)
            report(done)

    return result


class ForwardSubstitution:
    """Forward substitution of sparse loads along a factor's elimination tree."""

    def __init__(self, factor: Cholesky) -> None:
        self._L = L = factor.supernodes
        #: (n,) row of P A Pᵀ for each row of A
        self.position = np.empty_like(factor.permutation)
        self.position[factor.permutation] = np.arange(len(self.position))

        self._columns = np.diff(L.start)
        self._supernode = np.repeat(np.arange(len(self._columns)), self._columns)

        # of each supernode in the elimination tree; -1: a root
        self._parent = np.full(len(self._columns), -1)
        below = np.diff(L.row) > self._columns
        self._parent[below] = self._supernode[L.rows[(L.row[:-1] + self._columns)[below]]]

    def compliances(self, loads: scipy.sparse.csc_matrix) -> Array:
        """bᵀA⁻¹b (k,) of every column b of `loads` (n, k)."""
        L, parent = self._L, self._parent
        part = loads.tocoo()
        rows = self.position[part.row]

        # the loaded supernodes and all their ancestors, children before parents
        visited: set[int] = set()
        for s in np.unique(self._supernode[rows]).tolist():
            while s >= 0 and s not in visited:
                visited.add(s)
                s = int(parent[s])
        branch = sorted(visited)

        # loads of a subtree follow one another; the last entries are those above a root
        begin = np.full(len(parent) + 1, loads.shape[1])
        end = np.zeros(len(parent) + 1, dtype=int)
        np.minimum.at(begin, self._supernode[rows], part.col)
        np.maximum.at(end, self._supernode[rows], part.col + 1)
        for s in branch:
            begin[parent[s]] = min(begin[parent[s]], begin[s])
            end[parent[s]] = max(end[parent[s]], end[s])

        in_branch = np.flatnonzero(np.isin(self._supernode, branch))
        compact = np.empty_like(self.position)
        compact[in_branch] = np.arange(len(in_branch))
        W = np.zeros((len(in_branch), loads.shape[1]))
        W[compact[rows], part.col] = part.data

        result = np.zeros(loads.shape[1])
        for s in branch:
            Z = W[:, begin[s] : end[s]]
            row_numbers = compact[L.rows[L.row[s] : L.row[s + 1]]]
            width = self._columns[s]
            z = self._eliminated(s, Z[row_numbers])
            result[begin[s] : end[s]] += np.einsum("ij,ij->j", z[:width], z[:width])
            Z[row_numbers[width:]] = z[width:]

        return result

    def _eliminated(self, s: int, z: Array) -> Array:
        """`z` (rows of supernode s, k), changed in place: own rows solved, those below updated."""
        height, width = len(z), self._columns[s]
        first = self._L.value[s]
        block = self._L.values[first : first + height * width].reshape(width, height).T

        for c in range(0, width, PANEL_COLUMNS):
            d = min(c + PANEL_COLUMNS, width)
            solve_in_place(1.0, block[c:d, c:d], z[c:d].T)
            z[d:] -= block[d:, c:d] @ z[c:d]

        return z
