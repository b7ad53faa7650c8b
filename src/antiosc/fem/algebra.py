"""PETSc matrices and direct solves on plain arrays.

Vectors are NumPy arrays of the rows this rank owns, blocks of vectors are (rows, columns); inner
products sum over the ranks. Every solve is checked: PETSc itself stays silent when one fails.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import scipy.sparse
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from antiosc.errors import AccuracyError, InputError, NotConvergedError

Array = NDArray[np.float64]

#: Largest ‖Ax - r‖ / (‖A‖‖x‖ + ‖r‖) that a direct solve may leave; sound ones leave about 1e-16.
BACKWARD_ERROR = 1e-10
#: Largest ‖A‖‖x‖/‖Ax‖: rounding makes a mechanism as stiff as 1e-16 of the stiffest motion.
GROWTH = 1e14


def dot(comm: MPI.Comm, x: Array, y: Array) -> Any:
    """xᵀy over all ranks; x and y are vectors or blocks of vectors."""
    return comm.allreduce(x.T @ y)


def norm(comm: MPI.Comm, x: Array) -> float:
    """Euclidean norm over all ranks."""
    return float(np.sqrt(dot(comm, x, x)))


def multiply(matrix: PETSc.Mat, x: Array) -> Array:
    """matrix · x for a vector or a block of vectors."""
    source, target = matrix.createVecs()
    result = np.empty_like(x)
    columns = x[:, None] if x.ndim == 1 else x
    out = result[:, None] if x.ndim == 1 else result
    for k in range(columns.shape[1]):
        source.setArray(columns[:, k])
        matrix.mult(source, target)
        out[:, k] = target.array_r
    source.destroy()
    target.destroy()
    return result


def as_petsc(name: str, matrix: Any) -> PETSc.Mat:
    """A square, finite PETSc matrix of a SciPy sparse, dense or PETSc one."""
    if not isinstance(matrix, PETSc.Mat):
        try:
            csr = scipy.sparse.csr_matrix(matrix, dtype=float)
        except (TypeError, ValueError) as error:
            raise InputError(
                f"{name} must be a SciPy sparse, dense or PETSc matrix; "
                f"got {type(matrix).__name__}."
            ) from error
        csr.sum_duplicates()
        csr.sort_indices()
        matrix = PETSc.Mat().createAIJ(
            csr.shape, csr=(csr.indptr, csr.indices, csr.data), comm=PETSc.COMM_SELF
        )
        matrix.assemble()
    rows, columns = matrix.getSize()
    if rows != columns or not rows:
        raise InputError(f"{name} must be square; got {rows} rows and {columns} columns.")
    # not the row-sum norm: PETSc's maximum passes over NaN
    if not np.isfinite(matrix.norm(PETSc.NormType.NORM_FROBENIUS)):
        raise InputError(f"{name} holds NaN or infinite entries; antiosc needs finite matrices.")
    return matrix


def csr(matrix: PETSc.Mat) -> scipy.sparse.csr_matrix:
    """The matrix of a one-rank communicator as a SciPy one."""
    pointers, indices, values = matrix.getValuesCSR()
    return scipy.sparse.csr_matrix((values, indices, pointers), shape=matrix.getSize())


def sum_of(K: PETSc.Mat, shift: float, M: PETSc.Mat) -> PETSc.Mat:
    """K + shift·M; K itself where the shift is zero."""
    if shift == 0.0:
        return K
    A = K.copy()
    A.axpy(shift, M, structure=PETSc.Mat.Structure.UNKNOWN_NONZERO_PATTERN)
    return A


class Factorization:
    """Cholesky factor of a symmetric positive definite matrix, used for many solves.

    CHOLMOD on one rank (its supernodal solves are three times faster than MUMPS's defaults),
    MUMPS on several.
    """

    def __init__(self, A: PETSc.Mat) -> None:
        started = time.perf_counter()
        self.A = A
        self.comm: MPI.Comm = A.getComm().tompi4py()
        A.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        A.setOption(PETSc.Mat.Option.SPD, True)
        self._ksp = PETSc.KSP().create(A.getComm())
        self._ksp.setOperators(A)
        self._ksp.setType(PETSc.KSP.Type.PREONLY)
        pc = self._ksp.getPC()
        pc.setType(PETSc.PC.Type.CHOLESKY)
        pc.setFactorSolverType("cholmod" if self.comm.size == 1 else "mumps")
        prefix = f"antiosc_{id(self)}_"
        self._ksp.setOptionsPrefix(prefix)
        if self.comm.size > 1:
            # AMF: the fewest operations on thin bodies, close to the best on compact ones.
            PETSc.Options()[prefix + "mat_mumps_icntl_7"] = 2
            self._ksp.setFromOptions()
        try:
            self._ksp.setUp()
        except PETSc.Error as error:
            raise NotConvergedError(_SINGULAR.format(f"PETSc error {error.ierr}")) from error
        self._b, self._x = A.createVecs()
        self._scale = A.norm(PETSc.NormType.NORM_INFINITY)
        self.seconds = time.perf_counter() - started

    def solve(self, r: Array) -> Array:
        """A⁻¹r for one vector, unchecked but for PETSc's own verdict."""
        self._b.setArray(r)
        self.solve_vector(self._b, self._x)
        return np.array(self._x.array_r)

    def solve_block(self, R: Array) -> Array:
        """A⁻¹R for a block of vectors (rows, k): many at once cost a fraction of one by one."""
        rows, columns = R.shape
        if columns < 2:
            return self.solve(R[:, 0])[:, None] if columns else R.copy()
        size = ((rows, self.A.getSize()[0]), (None, columns))
        X = PETSc.Mat().createDense(size, comm=self.A.getComm())
        B = PETSc.Mat().createDense(size, array=np.asfortranarray(R), comm=self.A.getComm())
        for matrix in (X, B):
            matrix.setUp()
            matrix.assemble()
        self._ksp.getPC().getFactorMatrix().matSolve(B, X)
        result = np.array(X.getDenseArray())
        X.destroy()
        B.destroy()
        return result

    def solve_vector(self, r: PETSc.Vec, x: PETSc.Vec) -> None:
        """The same on PETSc vectors, in place."""
        self._ksp.solve(r, x)
        reason = self._ksp.getConvergedReason()
        if reason < 0:
            raise NotConvergedError(_SINGULAR.format(f"PETSc reason {reason}"))

    def solve_checked(self, r: Array) -> Array:
        """A⁻¹r (a vector or a block), its residual measured: a singular matrix is not unseen."""
        R = r[:, None] if r.ndim == 1 else r
        X = self.solve_block(R)
        left = multiply(self.A, X) - R
        for x, rest, load in zip(X.T, left.T, R.T, strict=True):
            size = self._scale * norm(self.comm, x) + norm(self.comm, load)
            growth = size / max(norm(self.comm, load), np.finfo(float).tiny)
            if not growth <= GROWTH:
                raise AccuracyError(_SINGULAR.format(f"‖A‖‖x‖/‖Ax‖ = {growth:.0e}"))
            if not norm(self.comm, rest) <= BACKWARD_ERROR * size:
                raise AccuracyError(
                    _SINGULAR.format(
                        f"backward error {norm(self.comm, rest) / size:.1e}, "
                        f"limit {BACKWARD_ERROR:.0e}"
                    )
                )
        return X[:, 0] if r.ndim == 1 else X


_SINGULAR = (
    "the stiffness matrix cannot be factored ({}): some part can still move freely, as at a hinge "
    "where pieces meet in one point or line; join or support it."
)
