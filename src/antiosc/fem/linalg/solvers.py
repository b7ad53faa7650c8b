"""Direct solves with PETSc matrices.

Every solve is checked, because PETSc reports no failure by itself.
"""

from __future__ import annotations

from abc import abstractmethod

import numpy as np
from petsc4py import PETSc

from antiosc.base._types import Array
from antiosc.base.errors import NotConvergedError
from antiosc.base.memory import ran_out
from antiosc.fem.linalg.cholmod import Analysis, Cholesky, NotPositiveDefiniteError
from antiosc.fem.linalg.petsc_algebra import csr, dense, lower, watch
from antiosc.fem.linalg.solver import SINGULAR, Factorization, Solver

#: PETSC_ERR_MEM
PETSC_NO_MEMORY = 55
#: Per cent by which MUMPS may exceed its forecast of the memory (20 if not told): entries that
#: gather on one rank exceed it at times.
WORKSPACE = 60


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
        watch(self._ksp)
        self._ksp.setOperators(self.A)
        self._ksp.setOptionsPrefix(f"antiosc_{id(self)}_")
        try:
            self._choose()
            self._ksp.setUp()
        except PETSc.Error as error:
            if error.ierr == PETSC_NO_MEMORY:
                raise ran_out(f"the solver of {self.A.getSize()[0]} dofs") from error
            raise NotConvergedError(SINGULAR.format(f"PETSc error {error.ierr}")) from error
        self._b, self._x = self.A.createVecs()

    @abstractmethod
    def _choose(self) -> None:
        """Set the type of the PETSc solver."""

    def _solve_vector(self, r: PETSc.Vec, x: PETSc.Vec) -> None:
        self._ksp.solve(r, x)
        reason = self._ksp.getConvergedReason()
        if reason < 0:
            raise NotConvergedError(SINGULAR.format(f"PETSc reason {reason}"))

    def solve_block(self, R: Array) -> Array:
        """A⁻¹R for a block of vectors (rows, k), one by one."""
        X = np.empty(R.shape, order="F")
        for k in range(R.shape[1]):
            self._b.setArray(R[:, k])
            self._solve_vector(self._b, self._x)
            X[:, k] = self._x.array_r
        return X


class Distributed(PetscSolver, Factorization):
    """Cholesky factor over many ranks by MUMPS, with the ordering that it chooses."""

    def _choose(self) -> None:
        self._ksp.setType(PETSc.KSP.Type.PREONLY)
        pc = self._ksp.getPC()
        pc.setType(PETSc.PC.Type.CHOLESKY)
        pc.setFactorSolverType("mumps")
        PETSc.Options()[f"{self._ksp.getOptionsPrefix()}mat_mumps_icntl_14"] = WORKSPACE
        self._ksp.setFromOptions()

    @property
    def entries(self) -> float:
        """Entries of the factor, of all ranks together."""
        return count(self._ksp.getPC().getFactorMatrix().getMumpsInfog(29))

    def solve_block(self, R: Array) -> Array:
        """A⁻¹R for a block of vectors (rows, k): many at once cost a fraction of one by one."""
        if R.shape[1] < 2:
            return super().solve_block(R)
        B, X = dense(self.A, R), dense(self.A, np.zeros(R.shape, order="F"))
        self._ksp.getPC().getFactorMatrix().matSolve(B, X)
        result = np.array(X.getDenseArray())
        X.destroy()
        B.destroy()
        return result


def forecast(A: PETSc.Mat) -> float:
    """Entries that MUMPS's factor of A will have; 0 where A is not blocked by nodes.

    MUMPS tells how large a factor is when it has made it: it is asked for that of one displacement
    component, every b-th row, at 1/b² of the entries and 1/b³ of the operations.
    """
    block = A.getBlockSize()
    if block == 1:
        return 0.0
    first, last = A.getOwnershipRange()
    rows = PETSc.IS().createStride((last - first) // block, first, block, comm=A.getComm())
    return block**2 * Distributed(A.createSubMatrix(rows, rows)).entries


def count(entries: int) -> float:
    """A number of entries as MUMPS gives it: large ones in millions, negative."""
    return float(entries) if entries >= 0 else -1e6 * entries


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
