"""PETSc matrices and direct solves on plain arrays.

Vectors are NumPy arrays of the rows this rank owns, blocks of vectors are (rows, columns); inner
products sum over the ranks. Every solve is checked, because PETSc reports no failure by itself.
"""

from __future__ import annotations

import logging
import time
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy.sparse
from mpi4py import MPI
from petsc4py import PETSc

from antiosc._types import Array
from antiosc.errors import AccuracyError, NotConvergedError, OutOfMemoryError
from antiosc.fem.linalg.cholmod import Analysis, Cholesky, NotPositiveDefiniteError
from antiosc.fem.linalg.forecast import Forecast, best_ordering, count
from antiosc.fem.linalg.scaling import norms, roots
from antiosc.threads import one_thread

#: Largest ‖Ax - r‖ / (‖A‖‖x‖ + ‖r‖) that a direct solve may leave; sound ones leave about 1e-16.
BACKWARD_ERROR = 1e-10
#: Largest ‖A‖‖x‖/‖Ax‖: rounding makes a mechanism as stiff as 1e-16 of the stiffest motion.
SOLUTION_GROWTH = 1e14

#: Vectors from which a product of matrices is faster than one by one.
BLOCK_PRODUCT_FROM = 4
#: PETSC_ERR_MEM
PETSC_NO_MEMORY = 55
#: PETSc attribute of a matrix: a product that is more accurate than its entries give (callable).
PRODUCT = "antiosc_product"

log = logging.getLogger(__name__)


def dot(comm: MPI.Comm, x: Array, y: Array) -> Any:
    """xᵀy over all ranks; x and y are vectors or blocks of vectors."""
    return comm.allreduce(x.T @ y)


def norm(comm: MPI.Comm, x: Array) -> float:
    """Euclidean norm over all ranks."""
    return float(np.sqrt(dot(comm, x, x)))


def multiply(matrix: PETSc.Mat, x: Array) -> Array:
    """matrix · x for a vector or a block of vectors."""
    accurate = matrix.getAttr(PRODUCT)
    if accurate is not None:
        return np.asarray(accurate(x))
    if x.ndim == 2 and x.shape[1] >= BLOCK_PRODUCT_FROM:
        block = _dense(matrix, x)
        product = matrix.matMult(block)
        result = np.array(product.getDenseArray())
        product.destroy()
        block.destroy()
        return result
    source, target = matrix.createVecs()
    result = np.empty((target.getLocalSize(), *x.shape[1:]))
    columns = x[:, None] if x.ndim == 1 else x
    out = result[:, None] if x.ndim == 1 else result
    for k in range(columns.shape[1]):
        source.setArray(columns[:, k])
        matrix.mult(source, target)
        out[:, k] = target.array_r
    source.destroy()
    target.destroy()
    return result


def by_strains(matrix: PETSc.Mat) -> bool:
    """Whether products with the matrix are taken by its strains (`antiosc.fem.linalg.strains`)."""
    return matrix.getAttr(PRODUCT) is not None


def _dense(matrix: PETSc.Mat, x: Array) -> PETSc.Mat:
    """A block of vectors (rows of this rank, k) as a PETSc matrix that `matrix` can meet."""
    size = ((x.shape[0], matrix.getSize()[1]), (None, x.shape[1]))
    block = PETSc.Mat().createDense(size, array=np.asfortranarray(x), comm=matrix.getComm())
    block.setUp()
    block.assemble()
    return block


def csr(matrix: PETSc.Mat) -> scipy.sparse.csr_matrix:
    """The matrix of a one-rank communicator as a SciPy matrix."""
    pointers, indices, values = matrix.getValuesCSR()
    return scipy.sparse.csr_matrix((values, indices, pointers), shape=matrix.getSize())


def lower(A: scipy.sparse.csr_matrix) -> scipy.sparse.csr_matrix:
    """The lower triangle, the diagonal included; half the memory."""
    rows = np.repeat(np.arange(A.shape[0], dtype=A.indices.dtype), np.diff(A.indptr))
    within = A.indices <= rows
    counts = np.bincount(rows[within], minlength=A.shape[0])
    pointers = np.append(0, np.cumsum(counts)).astype(A.indptr.dtype)
    return scipy.sparse.csr_matrix((A.data[within], A.indices[within], pointers), shape=A.shape)


def gathered(matrix: PETSc.Mat, root: int) -> scipy.sparse.csr_matrix | None:
    """The whole of a distributed matrix as a SciPy matrix on rank `root`; None elsewhere."""
    comm = matrix.getComm().tompi4py()
    own = [np.ascontiguousarray(part) for part in matrix.getValuesCSR()]
    own[0] = np.diff(own[0])  # entries of each row
    parts: list[Any] = []
    for part in own:
        counts = comm.gather(len(part), root=root)
        whole = np.empty(sum(counts), part.dtype) if comm.rank == root else None
        comm.Gatherv(part, (whole, counts), root=root)
        parts.append(whole)
    if comm.rank != root:
        return None
    sizes, columns, values = parts
    return scipy.sparse.csr_matrix(
        (values, columns, np.concatenate([[0], np.cumsum(sizes)])), shape=matrix.getSize()
    )


def sum_of(K: PETSc.Mat, shift: float, M: PETSc.Mat) -> PETSc.Mat:
    """K + shift·M; K itself where the shift is zero."""
    if shift == 0.0:
        return K
    A = K.copy()
    A.axpy(shift, M, structure=PETSc.Mat.Structure.UNKNOWN_NONZERO_PATTERN)
    accurate = K.getAttr(PRODUCT)
    if accurate is not None:
        A.setAttr(PRODUCT, lambda x: accurate(x) + shift * multiply(M, x))
    return A


class Solver(ABC):
    """A⁻¹ of a symmetric positive definite matrix, for many right-hand sides."""

    #: largest ‖A‖‖x‖/‖Ax‖ of a checked solve
    growth: float = SOLUTION_GROWTH

    def __init__(self, A: PETSc.Mat) -> None:
        started = time.perf_counter()
        self.A = A
        self.comm: MPI.Comm = A.getComm().tompi4py()
        A.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        A.setOption(PETSc.Mat.Option.SPD, True)
        with one_thread():  # but for factors that are worth more
            self._set_up()
        seconds = time.perf_counter() - started
        log.info("%s of %d dofs: %.1f s", type(self).__name__, A.getSize()[0], seconds)

    @abstractmethod
    def _set_up(self) -> None:
        """Make ready for solves."""

    @abstractmethod
    def solve_block(self, R: Array) -> Array:
        """A⁻¹R for a block of vectors (rows, k), with the solver's own check only."""

    def solve(self, r: Array) -> Array:
        """A⁻¹r for one vector."""
        return self.solve_block(r[:, None])[:, 0]

    def solve_vector(self, r: PETSc.Vec, x: PETSc.Vec) -> None:
        """The same on PETSc vectors, in place."""
        x.setArray(self.solve(r.array_r))

    def solve_checked(self, r: Array) -> Array:
        """A⁻¹r (a vector or a block) with a check of the residual, which detects a singular
        matrix."""
        R = r[:, None] if r.ndim == 1 else r
        X = self.solve_block(R)
        root = roots(self.A)[:, None]
        load = norms(self.comm, R / root)
        size = norms(self.comm, root * X) + load
        rest = norms(self.comm, (multiply(self.A, X) - R) / root)
        growth = (size / np.maximum(load, np.finfo(float).tiny)).max()
        if not growth <= self.growth:
            raise AccuracyError(SINGULAR.format(f"‖A‖‖x‖/‖Ax‖ = {growth:.0e}"))
        if not (rest <= BACKWARD_ERROR * size).all():
            error = (rest / size).max()
            raise AccuracyError(
                SINGULAR.format(f"backward error {error:.1e}, limit {BACKWARD_ERROR:.0e}")
            )
        return X[:, 0] if r.ndim == 1 else X

    def force_sizes(self, R: Array) -> Array:
        """Norms of forces, vectors as columns, in which residuals are compared."""
        return norms(self.comm, R)


class Factorization(Solver):
    """A Cholesky factor: `OnOneRank`, `ByPetsc`, `Distributed`, or by `fem.substructures`."""

    @property
    @abstractmethod
    def entries(self) -> float:
        """Entries of the factor, of all ranks together."""


class OnOneRank(Factorization):
    """Cholesky factor of a matrix on one rank, by CHOLMOD.

    Parameters
    ----------
    analysis : of A, from `analysed`, where it was made before; it becomes the factor.
    """

    def __init__(self, A: PETSc.Mat, analysis: Analysis | None = None) -> None:
        self._analysis = analysis
        super().__init__(A)

    def _set_up(self) -> None:
        try:
            self.cholesky = Cholesky(self._analysis or analysed(self.A))
        except NotPositiveDefiniteError as error:
            raise NotConvergedError(SINGULAR.format(error)) from error
        finally:
            self._analysis = None  # its copy of A is not used any more

    @property
    def entries(self) -> float:
        """Entries of the factor."""
        return float(self.cholesky.supernodes.values.size)

    def solve_block(self, R: Array) -> Array:
        """A⁻¹R for a block of vectors (rows, k): many at once cost a fraction of one by one."""
        return self.cholesky.solve(R)


def analysed(A: PETSc.Mat) -> Analysis:
    """The symbolic factor of a matrix on one rank."""
    return Analysis(lower(csr(A)), A.getBlockSize())


class PetscSolver(Solver):
    """A solver of PETSc's."""

    def _set_up(self) -> None:
        self._ksp = PETSc.KSP().create(self.A.getComm())
        self._ksp.setOperators(self.A)
        self._ksp.setOptionsPrefix(f"antiosc_{id(self)}_")
        try:
            self._choose()
            self._ksp.setUp()
        except PETSc.Error as error:
            if error.ierr == PETSC_NO_MEMORY:
                raise OutOfMemoryError(
                    f"there is not enough memory for a solve with {self.A.getSize()[0]} rows: use "
                    "solver='iterative', a coarser mesh or order=1."
                ) from error
            raise NotConvergedError(SINGULAR.format(f"PETSc error {error.ierr}")) from error
        self._b, self._x = self.A.createVecs()

    @abstractmethod
    def _choose(self) -> None:
        """Set the type of the PETSc solver."""

    def solve_vector(self, r: PETSc.Vec, x: PETSc.Vec) -> None:
        """A⁻¹r on PETSc vectors, in place."""
        self._ksp.solve(r, x)
        reason = self._ksp.getConvergedReason()
        if reason < 0:
            raise NotConvergedError(SINGULAR.format(f"PETSc reason {reason}"))

    def solve_block(self, R: Array) -> Array:
        """A⁻¹R for a block of vectors (rows, k), one by one."""
        X = np.empty(R.shape, order="F")
        for k in range(R.shape[1]):
            self._b.setArray(R[:, k])
            self.solve_vector(self._b, self._x)
            X[:, k] = self._x.array_r
        return X


class Distributed(PetscSolver, Factorization):
    """Cholesky factor over many ranks by MUMPS, with the ordering that needs fewer operations.

    Parameters
    ----------
    found : forecasts of A, where they were made before.
    """

    def __init__(self, A: PETSc.Mat, found: Sequence[Forecast] = ()) -> None:
        self._forecasts = found
        super().__init__(A)

    def _choose(self) -> None:
        self._ksp.setType(PETSc.KSP.Type.PREONLY)
        pc = self._ksp.getPC()
        pc.setType(PETSc.PC.Type.CHOLESKY)
        pc.setFactorSolverType("mumps")
        prefix = self._ksp.getOptionsPrefix()
        PETSc.Options()[prefix + "mat_mumps_icntl_7"] = best_ordering(self.A, self._forecasts)
        self._ksp.setFromOptions()

    @property
    def entries(self) -> float:
        """Entries of the factor, of all ranks together."""
        return count(self._ksp.getPC().getFactorMatrix().getMumpsInfog(29))

    def solve_block(self, R: Array) -> Array:
        """A⁻¹R for a block of vectors (rows, k): many at once cost a fraction of one by one."""
        if R.shape[1] < 2:
            return super().solve_block(R)
        B, X = _dense(self.A, R), _dense(self.A, np.zeros(R.shape, order="F"))
        self._ksp.getPC().getFactorMatrix().matSolve(B, X)
        result = np.array(X.getDenseArray())
        X.destroy()
        B.destroy()
        return result


class ByPetsc(PetscSolver, Factorization):
    """Cholesky factor on one rank by CHOLMOD through PETSc, where `cholmod.refusal` says why."""

    def _choose(self) -> None:
        self._ksp.setType(PETSc.KSP.Type.PREONLY)
        pc = self._ksp.getPC()
        pc.setType(PETSc.PC.Type.CHOLESKY)
        if PETSc.Sys.hasExternalPackage("cholmod") or PETSc.Sys.hasExternalPackage("suitesparse"):
            pc.setFactorSolverType("cholmod")  # PETSc's own Cholesky fills in far more

    @property
    def entries(self) -> float:
        """Entries of the factor."""
        return float(self._ksp.getPC().getFactorMatrix().getInfo()["nz_used"])


#: Message for a matrix without a Cholesky factor.
SINGULAR = (
    "the stiffness matrix cannot be factored ({}): some part can move freely, for instance at a "
    "hinge, a single common point or line (join it along a face, or support it), or a part is too "
    "slender for double precision (use fewer elements)."
)
