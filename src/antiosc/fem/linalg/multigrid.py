"""Conjugate gradients of PETSc, and their preconditioning by algebraic multigrid.

Smoothed aggregation (PETSc's GAMG) knows the rigid motions. Its graph is squared once, which PETSc
does only if options are read: without it the levels have four times as many entries. Quadratic
solids have two levels (`two_levels`) instead.

A solve ends where the energy norm of its error is `ITERATION_RESIDUAL` of that of the solution, as
the preconditioner B measures it; the largest and least eigenvalues of BA, which conjugate gradients
find beside the solution, bound the difference from the true error, and are used in the error bound
of a model. The compliance bᵀA⁻¹b has about the square of it as its relative error, for the error of
conjugate gradients is orthogonal to the solution in energy; the Krylov recurrence of
anti-oscillators takes products with A anew, and is a Galerkin model for any vectors. The errors of
Z are listed in benchmarks/speed/large_parts.md.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from petsc4py import PETSc

from antiosc.base._types import Array
from antiosc.base.errors import NotConvergedError
from antiosc.base.process import allocation_failed
from antiosc.fem.linalg.algebra import diagonal
from antiosc.fem.linalg.petsc_algebra import watch
from antiosc.fem.linalg.solver import SINGULAR, Solver

#: PETSC_ERR_MEM
PETSC_NO_MEMORY = 55
#: Relative error of an iterative solve, and the most iterations for it. It takes 9 iterations to
#: 1e-6 and 11 to 1e-7; Z between the first antiresonances then misses 2e-6 or 2e-7.
ITERATION_RESIDUAL, ITERATIONS = 1e-7, 2000
#: The same for the solves of an eigenproblem, whose shapes have an error of the size of theirs.
MODE_RESIDUAL = 1e-11
#: Message for more.
TOO_MANY = (
    f"{ITERATIONS} conjugate gradients did not reach a relative error of {ITERATION_RESIDUAL:.0e}: "
    "thin and nearly incompressible parts need too many; take the solver 'direct'."
)
#: Largest backward error of a checked solve.
BACKWARD_ERROR = 1e-6


@dataclass(frozen=True)
class Levels:
    """Functions that give the data of a part for a multigrid.

    motions : its rigid-body motions (rows of this rank, r).
    coarser : the interpolation P from the coarse dofs to the fine ones, with zero rows for fixed
        dofs; None if no coarse space is known.
    """

    motions: Callable[[], Array]
    coarser: Callable[[], PETSc.Mat | None] = lambda: None


class PetscSolver(Solver):
    """Base of solvers by PETSc."""

    def _set_up(self) -> None:
        self._ksp = PETSc.KSP().create(self.A.getComm())
        watch(self._ksp)
        self._ksp.setOperators(self.A)
        self._ksp.setOptionsPrefix(f"antiosc_{id(self)}_")
        try:
            self._configure()
            self._ksp.setUp()
        except PETSc.Error as error:
            if error.ierr == PETSC_NO_MEMORY:
                raise allocation_failed(f"the solver of {self.A.getSize()[0]} dofs") from error
            raise NotConvergedError(SINGULAR.format(f"PETSc error {error.ierr}")) from error
        self._b, self._x = self.A.createVecs()

    @abstractmethod
    def _configure(self) -> None:
        """Set the type of the PETSc solver."""

    def _solve_vector(self, r: PETSc.Vec, x: PETSc.Vec) -> None:
        self._ksp.solve(r, x)
        reason = self._ksp.getConvergedReason()
        if reason == PETSc.KSP.ConvergedReason.DIVERGED_MAX_IT:
            raise NotConvergedError(TOO_MANY)
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


class Multigrid(PetscSolver):
    """Conjugate gradients with smoothed aggregation that preserves the rigid motions."""

    backward_error = BACKWARD_ERROR
    method = "conjugate gradients with multigrid"
    #: what its solves take beside those of a factor
    pace = ", whose solves take ten times as long or more"

    @property
    def description(self) -> str:
        """Name of the solver, the error at which its solves end, and the forecast."""
        text = f"{self.method}, relative error of solves {ITERATION_RESIDUAL:.0e}"
        return text if self.cost is None else f"{text}; {self.cost}"

    def __init__(self, A: PETSc.Mat, motions: Array | None = None) -> None:
        if motions is not None:
            set_near_null_space(A, motions)
        super().__init__(A)

    def _configure(self) -> None:
        self._ksp.setType(PETSc.KSP.Type.CG)
        self._ksp.setNormType(PETSc.KSP.NormType.NATURAL)
        self._ksp.setComputeEigenvalues(True)
        self._ksp.setTolerances(rtol=ITERATION_RESIDUAL, max_it=ITERATIONS)
        self._precondition(self._ksp.getPC())
        self._ksp.setFromOptions()

    def _precondition(self, pc: PETSc.PC) -> None:
        pc.setType(PETSc.PC.Type.GAMG)

    def trial(self, most: int) -> int:
        """Iterations of a solve for a random load; NotConvergedError above `most`.

        The load on fixed dofs, which have 1 on the diagonal, is negligible.
        """
        noise = np.random.default_rng(self.comm.rank).standard_normal(self.A.getLocalSize()[0])
        old_limit = self._ksp.max_it
        self._ksp.max_it = most
        try:
            self.solve(diagonal(self.A) * noise)
        finally:
            self._ksp.max_it = old_limit
        return int(self._ksp.getIterationNumber())

    @contextmanager
    def accurately(self) -> Iterator[None]:
        """Context in which solves end at `MODE_RESIDUAL`."""
        old_rtol = self._ksp.rtol
        self._ksp.rtol = MODE_RESIDUAL
        try:
            yield
        finally:
            self._ksp.rtol = old_rtol

    def _solve_vector(self, r: PETSc.Vec, x: PETSc.Vec) -> None:
        super()._solve_vector(r, x)
        eigenvalues = self._ksp.computeEigenvalues().real
        if eigenvalues.min(initial=np.inf) > 0.0:
            condition = eigenvalues.max() / eigenvalues.min()
            self.error = max(self.error, self._ksp.rtol * float(np.sqrt(condition)))


def set_near_null_space(A: PETSc.Mat, motions: Array) -> None:
    """Set the orthonormalised motions (rows of this rank, r) as PETSc's near null space of A."""
    basis: list[PETSc.Vec] = []
    for column in motions.T:
        x = A.createVecRight()
        x.setArray(column)
        for vector in basis:
            x.axpy(-x.dot(vector), vector)
        if x.norm() > 0.0:
            x.normalize()
            basis.append(x)
    if basis:
        A.setNearNullSpace(PETSc.NullSpace().create(vectors=basis, comm=A.getComm()))
