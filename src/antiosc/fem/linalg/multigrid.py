"""Conjugate gradients of PETSc, preconditioned by two levels or by algebraic multigrid.

**Two levels.** On quadratic solids the coarse level is the linear elements of the same mesh. With P
the interpolation from them, its matrix is PᵀAP: springs, masses, supports and any material are in
it. On the fine level two steps of Chebyshev's iteration act, with the diagonal blocks of the nodes.
The coarse level is factored, or, where it is large, one cycle of smoothed aggregation takes its
place. Linear elements lock where a part is one element thick or nearly incompressible: more
iterations (benchmarks/large_parts.py), and a factor, whose fill is small in a thin part, is better.

**Elsewhere** smoothed aggregation (PETSc's GAMG) that knows the rigid motions. Its graph is squared
once, which PETSc does only if options are read: without it the levels have four times as many
entries.

A solve with two levels ends where the energy norm of its error is `ITERATION_RESIDUAL` of that of
the solution, as the preconditioner measures it, one with multigrid where the residual is that share
of the load. The compliance bᵀA⁻¹b then has about the square of it as its relative error, for the
error of conjugate gradients is orthogonal to the solution in energy; the Krylov recurrence of
anti-oscillators takes products with A anew, and is a Galerkin model for any vectors. What is left
of Z stands in benchmarks/speed/multigrid.md and large_parts.md.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from petsc4py import PETSc

from antiosc.base._types import Array, BoolArray
from antiosc.base.errors import NotConvergedError
from antiosc.base.process import allocation_failed
from antiosc.fem.linalg.petsc_algebra import CELLS, becomes, by_cells, node_blocks, watch
from antiosc.fem.linalg.solver import SINGULAR, Solver

#: PETSC_ERR_MEM
PETSC_NO_MEMORY = 55
#: Relative error of an iterative solve, and the most iterations for it.
ITERATION_RESIDUAL, ITERATIONS = 1e-8, 2000
#: Message for more.
TOO_MANY = (
    f"{ITERATIONS} conjugate gradients did not reach a relative error of {ITERATION_RESIDUAL:.0e}: "
    "thin and nearly incompressible parts need too many; take solver='direct'."
)
#: Largest backward error of a checked solve over that.
SLACK = 100.0
#: Rows of the coarse level up to which it is factored.
FACTORED = 150_000


@dataclass(frozen=True)
class Levels:
    """What a multigrid needs of a part.

    motions : gives its rigid-body motions (rows of this rank, r).
    coarser : gives P, the fine dofs of the coarse ones, fixed ones zero; None where no coarse
        space is known.
    """

    motions: Callable[[], Array]
    coarser: Callable[[], PETSc.Mat | None] = lambda: None


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
                raise allocation_failed(f"the solver of {self.A.getSize()[0]} dofs") from error
            raise NotConvergedError(SINGULAR.format(f"PETSc error {error.ierr}")) from error
        self._b, self._x = self.A.createVecs()

    @abstractmethod
    def _choose(self) -> None:
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
    """Conjugate gradients, preconditioned by smoothed aggregation that knows the rigid motions."""

    backward_error = SLACK * ITERATION_RESIDUAL
    method, ends_by = "conjugate gradients with multigrid", PETSc.KSP.NormType.UNPRECONDITIONED

    @property
    def told(self) -> str:
        """What it is, with the error at which its solves end."""
        return f"{self.method}, relative error of solves {ITERATION_RESIDUAL:.0e}"

    def __init__(self, A: PETSc.Mat, motions: Array) -> None:
        know(A, motions)
        super().__init__(A)

    def _choose(self) -> None:
        self._ksp.setType(PETSc.KSP.Type.CG)
        self._ksp.setNormType(self.ends_by)
        self._ksp.setTolerances(rtol=ITERATION_RESIDUAL, max_it=ITERATIONS)
        self._precondition(self._ksp.getPC())
        self._ksp.setFromOptions()

    def _precondition(self, pc: PETSc.PC) -> None:
        pc.setType(PETSc.PC.Type.GAMG)


class TwoLevels(Multigrid):
    """Conjugate gradients, preconditioned by two levels.

    Parameters
    ----------
    motions : rigid-body motions (rows of this rank, r)
    coarser : P of `Levels`
    factorize : gives a direct solver of the coarse matrix
    """

    method, ends_by = "conjugate gradients with two levels", PETSc.KSP.NormType.NATURAL

    def __init__(
        self,
        A: PETSc.Mat,
        motions: Array,
        coarser: PETSc.Mat,
        factorize: Callable[[PETSc.Mat], Solver],
    ) -> None:
        self._P, self._motions, self._factorize = coarser, motions, factorize
        super().__init__(A, motions)

    def _precondition(self, pc: PETSc.PC) -> None:
        P = self._P
        self._coarse = coarse_of(self.A, P)
        if by_cells(self.A):
            self._ksp.setOperators(self.A, node_blocks(self.A))
        pc.setType(PETSc.PC.Type.MG)
        pc.setMGLevels(2)
        pc.setUseAmat(True)  # the other has diagonal blocks alone where products are by cells
        pc.setMGInterpolation(1, P)
        smoother = pc.getMGSmoother(1)
        smoother.setType(PETSc.KSP.Type.CHEBYSHEV)
        smoother.setTolerances(max_it=2)
        smoother.getPC().setType(PETSc.PC.Type.PBJACOBI)
        coarse = pc.getMGCoarseSolve()
        coarse.setType(PETSc.KSP.Type.PREONLY)
        coarse.setOperators(self._coarse)
        if self._coarse.getSize()[0] <= FACTORED:
            self._inverse = coarse.getPC()
            self._inverse.setType(PETSc.PC.Type.PYTHON)
            self._inverse.setPythonContext(Inverse(self._factorize(self._coarse)))
            becomes(self._inverse, PETSc.PC.Type.NONE)
        else:
            know(self._coarse, at_vertices(P, self._motions))
            coarse.getPC().setType(PETSc.PC.Type.GAMG)


class Inverse:
    """A solver as a preconditioner of PETSc's."""

    def __init__(self, solver: Solver) -> None:
        self._solver = solver

    def apply(self, _: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """y = A⁻¹x."""
        y.setArray(self._solver.solve(x.array_r))


def know(A: PETSc.Mat, motions: Array) -> None:
    """Tell PETSc's multigrid of A which motions are soft; it wants them orthonormal."""
    basis: list[PETSc.Vec] = []
    for column in motions.T:
        x = A.createVecRight()
        x.setArray(column)
        for other in basis:
            x.axpy(-x.dot(other), other)
        if x.norm() > 0.0:
            x.normalize()
            basis.append(x)
    if basis:
        A.setNearNullSpace(PETSc.NullSpace().create(vectors=basis, comm=A.getComm()))


#: Entry of a row of P from which on its node is one of the coarse nodes.
VERTEX = 0.99
#: Sum of entries of P from which on a coarse dof moves fixed ones: more than rounding.
TOUCHED = 0.01


def vertices(P: PETSc.Mat) -> BoolArray:
    """Whether each row of P (of this rank) is that of a coarse node."""
    pointers, _, values = P.getValuesCSR()
    rows = np.repeat(np.arange(len(pointers) - 1), np.diff(pointers))
    result = np.zeros(len(pointers) - 1, dtype=bool)
    result[rows[values > VERTEX]] = True
    return result


def at_vertices(P: PETSc.Mat, motions: Array) -> Array:
    """Motions of the fine dofs (rows of this rank, r) at the coarse ones."""
    coarse, fine = P.createVecs()
    result = np.empty((coarse.getLocalSize(), motions.shape[1]))
    at = vertices(P)
    for k, column in enumerate(motions.T):
        fine.setArray(np.where(at, column, 0.0))
        P.multTranspose(fine, coarse)
        result[:, k] = coarse.array_r
    return result


def without(P: PETSc.Mat, fixed: BoolArray) -> PETSc.Mat:
    """P (changed in place) of the coarse dofs that move no fixed one (of this rank, a mask)."""
    coarse, fine = P.createVecs()
    fine.setArray(np.where(fixed, 1.0, 0.0))
    P.multTranspose(fine, coarse)
    coarse.setArray(np.where(coarse.array_r > TOUCHED, 0.0, 1.0))
    fine.setArray(np.where(fixed, 0.0, 1.0))
    P.diagonalScale(fine, coarse)
    return P


def coarse_of(A: PETSc.Mat, P: PETSc.Mat) -> PETSc.Mat:
    """PᵀAP, with 1 on the diagonal where a column of P is empty."""
    product = A.getAttr(CELLS)
    coarse = product.cells.coarse(product.k, product.m, P) if by_cells(A) else A.ptap(P)
    watch(coarse)
    coarse.setBlockSize(P.getBlockSizes()[1])
    sums, ones = P.createVecs()
    ones.set(1.0)
    P.multTranspose(ones, sums)
    first, _ = coarse.getOwnershipRange()
    held = first + np.flatnonzero(sums.array_r == 0.0)
    coarse.zeroRowsColumns(held.astype(PETSc.IntType), diag=1.0)
    return coarse
