"""Factors of SciPy's matrices by SuperLU."""

from __future__ import annotations

import numpy as np
import scipy.sparse
import scipy.sparse.linalg

from antiosc.base import process
from antiosc.base._types import Array, Matrix
from antiosc.base.errors import NotConvergedError
from antiosc.fem.linalg.solver import SINGULAR, Factorization

#: Rows from which the memory of a factor is forecast.
FORECAST_ROWS = 30_000
#: Bytes of an entry with its row number; SuperLU stores L and U.
ENTRY_BYTES, L_AND_U = 12.0, 2
#: Share of the rows that groups of rows alike may be for a forecast.
LEAST_REDUCTION = 0.6

#: Remedy for matrices that are too large.
REDUCE = "reduce the matrices, take a coarser mesh, or a machine with more memory"

#: How SuperLU orders, for symmetric matrices with pivots on the diagonal.
SYMMETRIC_ORDER: dict[str, object] = {
    "permc_spec": "MMD_AT_PLUS_A",
    "diag_pivot_thresh": 0.0,
    "options": {"SymmetricMode": True, "Equil": False},
}


def factorize(A: Matrix) -> Factorization:
    """The factor of A.

    Raises
    ------
    OutOfMemoryError
        The forecast of the factor does not fit in the free memory.
    """
    rows = A.shape[0]
    if rows >= FORECAST_ROWS:
        need = L_AND_U * ENTRY_BYTES * entries_of_factor(A)
        process.require(need, f"the factor of {rows} dofs", REDUCE)
    return SuperLU(A)


def entries_of_factor(A: Matrix) -> float:
    """Forecast of the entries of L, from the factor of a smaller matrix.

    Rows with the same pattern, such as the dofs of one node, become one row: b rows in one make
    the work b³ times smaller. 0 where no rows are alike, for which there is no forecast.
    """
    A = A.tocsr()
    A.sort_indices()
    rows = A.shape[0]
    weight = np.random.default_rng(1).random(rows)
    # rows of one pattern have the same sum of random numbers
    ones = scipy.sparse.csr_matrix((np.ones(A.nnz), A.indices, A.indptr), A.shape)
    _, first, group = np.unique(ones @ weight, return_index=True, return_inverse=True)
    count = len(first)
    if count > LEAST_REDUCTION * rows:
        return 0.0
    P = scipy.sparse.csr_matrix((np.ones(rows), (np.arange(rows), np.ravel(group))))
    size = np.asarray(P.sum(axis=0)).ravel()
    graph = (P.T @ ones @ P).tocsc()
    graph.data[:] = -1.0
    # a definite matrix with the pattern of the groups
    graph = graph + scipy.sparse.diags(2.0 + np.diff(graph.indptr))
    lu = scipy.sparse.linalg.splu(graph.tocsc(), **SYMMETRIC_ORDER)
    size = size[np.argsort(lu.perm_c)]
    L = lu.L.tocoo()
    return float(size[L.row] @ size[L.col])


class SuperLU(Factorization):
    """A factor P A Pᵀ = L D Lᵀ by SuperLU with pivots on the diagonal.

    The ordering is symmetric, so the signs of D are those of A's eigenvalues (Sylvester): a matrix
    that is not positive definite has a pivot that is not positive, or one off the diagonal.
    """

    def _set_up(self) -> None:
        try:
            self._lu = scipy.sparse.linalg.splu(self.A.tocsc(), **SYMMETRIC_ORDER)
        except RuntimeError as error:  # an empty column of what is left
            raise NotConvergedError(SINGULAR.format(f"SuperLU: {error}")) from error
        except MemoryError as error:
            raise process.allocation_failed(
                f"the factor of {self.A.shape[0]} dofs", error, REDUCE
            ) from error
        if not np.array_equal(self._lu.perm_r, self._lu.perm_c):
            raise NotConvergedError(SINGULAR.format("a pivot is zero"))
        pivots = self._lu.U.diagonal()
        if not (pivots > 0).all():
            row = int(np.flatnonzero(~(pivots > 0))[0])
            raise NotConvergedError(
                SINGULAR.format(f"pivot {row + 1} of {len(pivots)} is {pivots[row]:.1e}")
            )

    @property
    def entries(self) -> float:
        """Number of entries of L and U."""
        return float(self._lu.nnz)

    def solve_block(self, R: Array) -> Array:
        """A⁻¹R for a block of vectors (rows, k)."""
        return np.asarray(self._lu.solve(np.asfortranarray(R)))
