"""Operations on matrices and vectors for extraction, by two back-ends: PETSc, and SciPy only.

Vectors are NumPy arrays of the rows this rank owns, blocks of vectors are (rows, columns); inner
products sum over the ranks. Matrices are PETSc matrices, distributed over the ranks by rows, or
SciPy matrices in one process; each function here passes PETSc matrices to `petsc_algebra`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from types import ModuleType
from typing import TYPE_CHECKING, cast

import numpy as np
import scipy.sparse

from antiosc.base._types import Array, IntArray, Matrix
from antiosc.fem.platform import SERIAL

if TYPE_CHECKING:
    from mpi4py import MPI


def dot(comm: MPI.Comm, x: Array, y: Array) -> Array:
    """xᵀy over all ranks; x and y are vectors or blocks of vectors."""
    return comm.allreduce(x.T @ y)


def norm(comm: MPI.Comm, x: Array) -> float:
    """Euclidean norm over all ranks."""
    return float(np.sqrt(dot(comm, x, x)))


def is_scipy(matrix: Matrix) -> bool:
    """Whether the matrix is a SciPy matrix."""
    return bool(scipy.sparse.issparse(matrix))


def _petsc() -> ModuleType:
    from antiosc.fem.linalg import petsc_algebra  # needs PETSc

    return petsc_algebra


def communicator(matrix: Matrix) -> MPI.Comm:
    """The communicator that shares the matrix; `SERIAL` for a SciPy matrix."""
    return cast("MPI.Comm", SERIAL if is_scipy(matrix) else matrix.getComm().tompi4py())


def size(matrix: Matrix) -> int:
    """Number of rows on all ranks."""
    return int(matrix.shape[0] if is_scipy(matrix) else matrix.getSize()[0])


def row_range(matrix: Matrix) -> tuple[int, int]:
    """(first row, last row + 1) of this rank."""
    first, last = (0, matrix.shape[0]) if is_scipy(matrix) else matrix.getOwnershipRange()
    return int(first), int(last)


def rows(matrix: Matrix) -> int:
    """Number of rows of this rank."""
    first, last = row_range(matrix)
    return last - first


def diagonal(matrix: Matrix) -> Array:
    """The diagonal entries on the rows of this rank."""
    return np.array(matrix.diagonal() if is_scipy(matrix) else matrix.getDiagonal().array_r)


def entries(matrix: Matrix) -> tuple[IntArray, IntArray, Array]:
    """The rows of this rank as CSR arrays: pointers, global columns, values."""
    if is_scipy(matrix):
        return matrix.indptr, matrix.indices, matrix.data
    pointers, columns, values = _petsc().with_entries(matrix).getValuesCSR()
    return pointers, columns, values


def multiply(matrix: Matrix, x: Array) -> Array:
    """matrix · x for a vector or a block of vectors."""
    return np.asarray(matrix @ x if is_scipy(matrix) else _petsc().multiply(matrix, x))


def uses_strains(matrix: Matrix) -> bool:
    """Whether K x is computed from strains S x as Sᵀ(S x) + rest x; see `solver_choice`."""
    return not is_scipy(matrix) and bool(_petsc().uses_strains(matrix))


def sum_of(K: Matrix, shift: float, M: Matrix) -> Matrix:
    """K + shift·M; K itself where the shift is zero."""
    if is_scipy(K):
        if shift == 0.0:
            return K
        return (K + shift * M).tocsr()
    return _petsc().sum_of(K, shift, M)


def skew(matrix: Matrix) -> Matrix:
    """matrixᵀ - matrix."""
    if is_scipy(matrix):
        return (matrix.T - matrix).tocsr()
    return _petsc().skew(matrix)


def fix_rows(matrix: Matrix, rows: IntArray, value: float) -> Matrix:
    """The matrix with these global rows and columns zero and `value` on the diagonal; a PETSc
    matrix is changed in place."""
    if not is_scipy(matrix):
        return _petsc().fix_rows(matrix, rows, value)

    free = np.ones(matrix.shape[0])
    constrained = np.zeros(matrix.shape[0])
    free[rows], constrained[rows] = 0.0, value
    projector = scipy.sparse.diags(free)
    result = (projector @ matrix @ projector + scipy.sparse.diags(constrained)).tocsr()
    result.eliminate_zeros()

    return result


def gathered(matrix: Matrix, root: int) -> scipy.sparse.csr_matrix | None:
    """The whole matrix as a SciPy matrix on rank `root`; None elsewhere."""
    if is_scipy(matrix):
        return matrix
    return _petsc().gathered(matrix, root)


def free_when_dropped(*matrices: Matrix) -> None:
    """Free the memory of PETSc matrices once no rank uses them. Collective."""
    if not is_scipy(matrices[0]):
        _petsc().free_when_dropped(*matrices)


def declare_definite(matrix: Matrix) -> None:
    """Mark the matrix for PETSc as symmetric and positive definite."""
    if not is_scipy(matrix):
        _petsc().declare_definite(matrix)


def quotient(a: Array, b: Array) -> Array:
    """a / b elementwise, with 0 where b is 0."""
    return np.divide(a, b, out=np.zeros_like(a), where=b != 0)


def conjugate_gradients(
    R: Array,
    product: Callable[[Array], Array],
    inverse: Callable[[Array], Array],
    inner: Callable[[Array, Array], Array],
    most: int,
) -> Iterator[tuple[Array, Array, Array]]:
    """Solve A X = R (rows, k) by conjugate gradients: yield (X, rᵀB r (k,), xᵀA x (k,)) first
    and after each of `most` steps, the array X anew; r: residual; B: preconditioner `inverse`;
    `inner` gives xᵀy (k,) of columns."""
    X = np.zeros(R.shape)
    r = np.array(R)
    energy = np.zeros(R.shape[1])
    p = inverse(r)
    residual_products = inner(r, p)
    yield X, residual_products, energy

    for _ in range(most):
        Ap = product(p)
        step = quotient(residual_products, inner(p, Ap))
        X += step * p
        energy += step * residual_products
        r -= step * Ap
        z = inverse(r)
        residual_products, previous = inner(r, z), residual_products
        yield X, residual_products, energy
        p = z + quotient(residual_products, previous) * p


# -- Norms of displacements and forces scaled by the diagonal of the matrix, D = diag(A).
#
# An entry of a semidefinite matrix is at most √(a_ii a_jj); in ‖√D x‖ and ‖r/√D‖ all dofs have
# equal weight. In an unscaled norm one penalty, or one unit, would hide all others.


def column_products(comm: MPI.Comm, X: Array, Y: Array) -> Array:
    """xᵀy (k,) over all ranks of the columns x of X and y of Y (rows, k)."""
    return np.asarray(comm.allreduce(np.einsum("ij,ij->j", X, Y)))


def norms(comm: MPI.Comm, X: Array) -> Array:
    """Euclidean norms (k,) over all ranks of the columns of X (rows, k)."""
    return np.sqrt(column_products(comm, X, X))


def diagonal_roots(matrix: Matrix) -> Array:
    """√a_ii (rows of this rank,); zeros (a_ii <= 0) are replaced by the median of the others."""
    result = np.sqrt(np.maximum(diagonal(matrix), 0.0))
    comm = communicator(matrix)
    if not all(comm.allgather(result.all())):
        everywhere = np.concatenate(comm.allgather(result))
        result[result == 0] = np.median(everywhere[everywhere > 0])
    return result


def force_ratios(matrix: Matrix, X: Array) -> Array:
    """‖Ax/√D‖/‖√D x‖ (k,) of columns x, D = diag A; about 1e-16 for null vectors."""
    comm = communicator(matrix)
    root = diagonal_roots(matrix)[:, None]
    return norms(comm, multiply(matrix, X) / root) / norms(comm, root * X)


def energy_ratios(matrix: Matrix, X: Array) -> Array:
    """xᵀA x / xᵀD x (k,) of columns x, D = diag A; about ±1e-16 for near null vectors."""
    comm = communicator(matrix)
    energy = column_products(comm, X, multiply(matrix, X))
    return energy / norms(comm, diagonal_roots(matrix)[:, None] * X) ** 2


def typical_eigenvalue(K: Matrix, M: Matrix) -> float:
    """A typical ω² [rad²/s²], below the highest: the median of K_ii/M_ii over dofs with mass."""
    k, m = (diagonal(matrix) for matrix in (K, M))
    ratios = communicator(K).allgather(k[m > 0] / m[m > 0])
    return float(np.median(np.concatenate(ratios)))
