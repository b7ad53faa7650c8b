"""Solvers of PETSc matrices: the memory that a factor needs, and what is taken for larger models.

The size of a Cholesky factor of a compact body grows as n^(4/3). If it does not fit in the free
memory, conjugate gradients with algebraic multigrid are used, which take about a hundred times as
long for each solve. If their matrices do not fit either, an OutOfMemoryError says so before they
are made.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from antiosc.base import process
from antiosc.base._types import Array
from antiosc.base.errors import NotConvergedError
from antiosc.base.process import ran_out
from antiosc.fem.linalg import cholmod
from antiosc.fem.linalg.algebra import by_strains
from antiosc.fem.linalg.cholmod import Analysis, Cholesky, NotPositiveDefiniteError
from antiosc.fem.linalg.petsc_algebra import csr, dense, lower, watch
from antiosc.fem.linalg.solver import SINGULAR, Choice, Factorization, Solver
from antiosc.fem.linalg.strains import Refined
from antiosc.fem.linalg.substructures import Substructures, interface
from antiosc.fem.platform.mpi import on_root, warn

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
        told = self._ksp.getPC().getFactorMatrix().getMumpsInfog(29)
        return float(told if told >= 0 else -1e6 * told)  # large ones in millions, negative

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


#: Bytes per entry of the factor, and of the matrices and work arrays beside it.
BYTES = 8 * 1.3
#: Bytes of the multigrid for each entry of A: its levels, and the products while they are made
#: (87 at 113 000 dofs of quadratic tetrahedra, more than 97 at 2.3 million).
MULTIGRID = 110.0
#: Bytes for each entry of A of an analysis of its factor: copies of A.
ANALYSIS = 20.0
#: Remedy where neither fits.
SMALLER_MESH = "use a coarser mesh or order=1, or a machine with more memory"
#: Entries of a factor over rows^(4/3), for the most compact bodies: cubes of quadratic tetrahedra.
COMPACT = 35.0
#: Most rows of an interface between ranks that are kept as a dense matrix, 0.3 GB on each rank.
INTERFACE = 6_000
#: Relative residual of an iterative solve, and the most iterations for it.
ITERATION_RESIDUAL, ITERATIONS = 1e-12, 2000


class Multigrid(PetscSolver):
    """Conjugate gradients, preconditioned by smoothed aggregation that knows the rigid motions."""

    def __init__(self, A: PETSc.Mat, motions: Array) -> None:
        basis = []
        for column in motions.T:
            x = A.createVecRight()
            x.setArray(column)
            basis.append(x)
        if basis:
            for k, x in enumerate(basis):  # PETSc wants them orthonormal
                for other in basis[:k]:
                    x.axpy(-x.dot(other), other)
                x.normalize()
            A.setNearNullSpace(PETSc.NullSpace().create(vectors=basis, comm=A.getComm()))
        super().__init__(A)

    def _choose(self) -> None:
        self._ksp.setType(PETSc.KSP.Type.CG)
        self._ksp.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)
        self._ksp.setTolerances(rtol=ITERATION_RESIDUAL, max_it=ITERATIONS)
        self._ksp.getPC().setType(PETSc.PC.Type.GAMG)


def solver_for(A: PETSc.Mat, choice: Choice, motions: Callable[[], Array]) -> Solver:
    """The solver of A that `choice` names; "auto": direct if its factor fits in memory.

    `motions` gives rigid-body motions (rows of this rank, r) for the multigrid. Where A's product
    is by strains the solver of its entries is refined to that accuracy.
    """
    if by_strains(A):
        return Refined(A, lambda matrix: _of_entries(matrix, choice, motions))
    return _of_entries(A, choice, motions)


def _of_entries(A: PETSc.Mat, choice: Choice, motions: Callable[[], Array]) -> Solver:
    rows = A.getSize()[0]
    free = on_root(A.getComm().tompi4py(), process.free_memory)
    if choice == "iterative":
        return _iterative(A, motions)
    if BYTES * COMPACT * rows ** (4 / 3) <= process.MEMORY_SHARE * free:
        return factorize(A)
    process.require(ANALYSIS * _entries(A), f"any solver of {rows} dofs", SMALLER_MESH, free)
    plan = Plan(A)
    need = BYTES * plan.entries
    if need <= process.MEMORY_SHARE * free:
        return plan.factorize()
    what = f"the factor of {rows} dofs"
    if choice == "direct":
        process.require(need, what, "take solver='iterative', a coarser mesh, or order=1", free)
    del plan  # its analysis has copies of A
    solver = _iterative(A, motions)
    warn(
        A.getComm().tompi4py(),
        f"{process.shortage(what, need, free)}: an iterative solver is used (conjugate gradients "
        "with multigrid), which takes about a hundred times as long for each solve; a coarser mesh "
        "or order=1 may fit.",
    )
    return solver


def _iterative(A: PETSc.Mat, motions: Callable[[], Array]) -> Solver:
    """The iterative solver, or OutOfMemoryError before its matrices are made."""
    process.give_back()
    free = on_root(A.getComm().tompi4py(), process.free_memory)
    what = f"the iterative solver of {A.getSize()[0]} dofs"
    process.require(MULTIGRID * _entries(A), what, SMALLER_MESH, free)
    return Multigrid(A, motions())


def _entries(A: PETSc.Mat) -> float:
    """Entries of A, of all ranks together."""
    return float(A.getInfo(PETSc.Mat.InfoType.GLOBAL_SUM)["nz_used"])


class Plan:
    """What a factor of A will need, found by an analysis that the factorization goes on with."""

    def __init__(self, A: PETSc.Mat) -> None:
        comm = A.getComm().tompi4py()
        self.A = A
        self._analysis: Analysis | None = None
        if comm.size == 1 and not cholmod_refused(comm):
            self._analysis = analysed(A)

    @property
    def entries(self) -> float:
        """Entries of the factor, of all ranks together; 0 where there is no forecast."""
        if self._analysis is not None:
            return float(self._analysis.entries)
        return forecast(self.A)

    def factorize(self) -> Factorization:
        """The factor; once, since the analysis becomes it."""
        analysis, self._analysis = self._analysis, None
        return factorize(self.A, analysis)


def factorize(A: PETSc.Mat, analysis: Analysis | None = None) -> Factorization:
    """The Cholesky factor of A by the fastest method for the number of ranks.

    `analysis`: what is known of A from before, on one rank.
    """
    comm = A.getComm().tompi4py()
    refused = cholmod_refused(comm)
    if comm.size == 1:
        return ByPetsc(A) if refused else OnOneRank(A, analysis)
    if refused:
        return Distributed(A)
    rows = interface(A)
    return Substructures(A, rows) if len(rows) <= INTERFACE else Distributed(A)


def cholmod_refused(comm: MPI.Comm) -> bool:
    """Whether CHOLMOD cannot be called directly on some rank."""
    return any(comm.allgather(bool(cholmod.refusal())))
