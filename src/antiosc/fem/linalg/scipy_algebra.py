"""The algebra of `antiosc.fem.linalg.algebra` on SciPy matrices (CSR), which one process holds."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse

from antiosc._types import Array, IntArray
from antiosc.fem.communicator import SERIAL, Serial


def communicator(matrix: Any) -> Serial:
    """That of one process."""
    return SERIAL


def size(matrix: Any) -> int:
    """Number of rows."""
    return int(matrix.shape[0])


def row_range(matrix: Any) -> tuple[int, int]:
    """All rows."""
    return 0, int(matrix.shape[0])


def diagonal(matrix: Any) -> Array:
    """The diagonal."""
    return np.asarray(matrix.diagonal())


def entries(matrix: Any) -> tuple[IntArray, IntArray, Array]:
    """CSR arrays: pointers, columns, values."""
    return matrix.indptr, matrix.indices, matrix.data


def multiply(matrix: Any, x: Array) -> Array:
    """matrix · x for a vector or a block of vectors."""
    return np.asarray(matrix @ x)


def by_strains(matrix: Any) -> bool:
    """Products are those of the entries."""
    return False


def sum_of(K: Any, shift: float, M: Any) -> Any:
    """K + shift·M; K itself where the shift is zero."""
    return K if shift == 0.0 else (K + shift * M).tocsr()


def skew(matrix: Any) -> Any:
    """matrixᵀ - matrix."""
    return (matrix.T - matrix).tocsr()


def hold(matrix: Any, rows: IntArray, value: float) -> Any:
    """The matrix with these rows and columns zero and `value` on the diagonal."""
    free, held = np.ones(matrix.shape[0]), np.zeros(matrix.shape[0])
    free[rows], held[rows] = 0.0, value
    kept = scipy.sparse.diags(free)
    result = (kept @ matrix @ kept + scipy.sparse.diags(held)).tocsr()
    result.eliminate_zeros()
    return result


def gathered(matrix: Any, root: int) -> Any:
    """The matrix itself."""
    return matrix


def declare_definite(matrix: Any) -> None:
    """SciPy matrices have no such mark."""


def free_when_dropped(*_matrices: Any) -> None:
    """Python does that."""
