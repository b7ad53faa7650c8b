"""The algebra of `antiosc.fem.linalg.algebra` on SciPy matrices (CSR), which one process holds."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse

from antiosc._types import Array, IntArray, Matrix
from antiosc.fem.mpi import SERIAL, Serial


def communicator(matrix: Matrix) -> Serial:
    """That of one process."""
    return SERIAL


def size(matrix: Matrix) -> int:
    """Number of rows."""
    return int(matrix.shape[0])


def row_range(matrix: Matrix) -> tuple[int, int]:
    """All rows."""
    return 0, int(matrix.shape[0])


def diagonal(matrix: Matrix) -> Array:
    """The diagonal."""
    return np.asarray(matrix.diagonal())


def entries(matrix: Matrix) -> tuple[IntArray, IntArray, Array]:
    """CSR arrays: pointers, columns, values."""
    return matrix.indptr, matrix.indices, matrix.data


def multiply(matrix: Matrix, x: Array) -> Array:
    """matrix · x for a vector or a block of vectors."""
    return np.asarray(matrix @ x)


def by_strains(matrix: Matrix) -> bool:
    """Products are those of the entries."""
    return False


def sum_of(K: Matrix, shift: float, M: Matrix) -> Matrix:
    """K + shift·M; K itself where the shift is zero."""
    return K if shift == 0.0 else (K + shift * M).tocsr()


def skew(matrix: Matrix) -> Matrix:
    """matrixᵀ - matrix."""
    return (matrix.T - matrix).tocsr()


def hold(matrix: Matrix, rows: IntArray, value: float) -> Matrix:
    """The matrix with these rows and columns zero and `value` on the diagonal."""
    free, held = np.ones(matrix.shape[0]), np.zeros(matrix.shape[0])
    free[rows], held[rows] = 0.0, value
    kept = scipy.sparse.diags(free)
    result = (kept @ matrix @ kept + scipy.sparse.diags(held)).tocsr()
    result.eliminate_zeros()
    return result


def gathered(matrix: Matrix, root: int) -> Matrix:
    """The matrix itself."""
    return matrix


def declare_definite(matrix: Matrix) -> None:
    """SciPy matrices have no such mark."""


def free_when_dropped(*_matrices: Any) -> None:
    """Python does that."""
