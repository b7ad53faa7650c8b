"""Conjugate gradients of PETSc, preconditioned by multigrid.

Smoothed aggregation (PETSc's GAMG) is given the rigid motions. Weak couplings are removed from its
graph, which is squared once; PETSc does this only if options are read, and without it the levels
have four times as many entries.

Quadratic solids have two levels instead; the coarse level has linear elements on the same mesh.
With the interpolation P from it, its matrix is PᵀAP, which contains springs, masses, supports and
any material. Chebyshev's iteration with the diagonal blocks of the nodes smooths the fine level.
The coarse level is factorized; if it is large, a third level of its smoothed aggregates is
factorized instead, and visited twice. Linear elements lock where a part is one element thick or
nearly incompressible: a factor is better there. If products are computed from the cells, smoothing
uses single precision; the product with a coarse correction, which leaves far smaller residuals,
uses double precision.

A solve ends when the energy norm of its error, as the preconditioner B measures it, is
`ITERATION_RESIDUAL` of the energy norm of the solution. Conjugate gradients also estimate the
largest and least eigenvalues of BA; these bound the difference from the true error and enter the
error bound of a model. The relative error of the compliance bᵀA⁻¹b is about the square of the
solve's error, which is orthogonal to the solution in energy; the Krylov recurrence of
anti-oscillators computes products with A anew, and gives a Galerkin model for any vectors. The
errors of Z are listed in benchmarks/speed/large_parts.md.
"""

from __future__ import annotations

import ctypes
from abc import abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from ctypes import c_double, c_float, c_int64, c_void_p
from dataclasses import dataclass
from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.errors import NotConvergedError
from antiosc.base.process import allocation_error
from antiosc.engine import library
from antiosc.fem.linalg.algebra import diagonal
from antiosc.fem.linalg.petsc_algebra import (
    CELLS_KEY,
    CellProduct,
    cell_matrix,
    multiply,
    multiply_linear,
    register_for_release,
    release_dropped,
    set_type_at_exit,
    uses_cells,
    with_entries,
)
from antiosc.fem.linalg.solver import SINGULAR_MESSAGE, Solver

#: PETSC_ERR_MEM
PETSC_NO_MEMORY = 55
#: Least share of couplings in aggregates: 14 iterations of a bracket of 1.65 million dofs for 49.
WEAK_COUPLING = 0.02
#: Relative error of an iterative solve, and the most iterations for it. With 3e-8 the frequencies
#: of 20 Krylov anti-oscillators of the bracket with 108 000 dofs, those that have not converged
#: too, miss 9e-8 after 7.7 s, with 1e-7 1.3e-7 after 7.0 s.
ITERATION_RESIDUAL, MOST_ITERATIONS = 3e-8, 2000
#: Relative error of solves of an eigenproblem; its shapes get errors of the same size.
MODE_RESIDUAL = 1e-11
#: Message for a solve that takes more iterations.
TOO_MANY_ITERATIONS = (
    f"{MOST_ITERATIONS} conjugate gradients did not reach a relative error of "
    f"{ITERATION_RESIDUAL:.0e}: "
    "thin and nearly incompressible parts need too many; take the solver 'direct'."
)
#: Largest backward error of a checked solve.
BACKWARD_ERROR = 1e-6


@dataclass(frozen=True)
class Levels:
    """Functions that return the data of a part for a multigrid method."""

    motions: Callable[[], Array]  # its rigid-body motions (rows of this rank, r)
    #: interpolation from coarse to fine dofs, zero rows for fixed ones; None: none is known
    prolongation: Callable[[], PETSc.Mat | None] = lambda: None


class PetscSolver(Solver):
    """Base of solvers that use PETSc."""

    def _set_up(self) -> None:
        self._ksp = PETSc.KSP().create(self.A.getComm())
        register_for_release(self._ksp)
        self._ksp.setOperators(self.A)
        self._ksp.setOptionsPrefix(f"antiosc_{id(self)}_")

        try:
            self._configure()
            self._ksp.setUp()
        except PETSc.Error as error:
            if error.ierr == PETSC_NO_MEMORY:
                raise allocation_error(f"the solver of {self.A.getSize()[0]} dofs") from error
            raise NotConvergedError(SINGULAR_MESSAGE.format(f"PETSc error {error.ierr}")) from error

        self._b, self._x = self.A.createVecs()

    @abstractmethod
    def _configure(self) -> None:
        """Set the type of the PETSc solver."""

    def _solve_vector(self, r: PETSc.Vec, x: PETSc.Vec) -> None:
        """Set x to A⁻¹r; NotConvergedError if PETSc does not converge."""
        self._ksp.solve(r, x)
        reason = self._ksp.getConvergedReason()
        if reason == PETSc.KSP.ConvergedReason.DIVERGED_MAX_IT:
            raise NotConvergedError(TOO_MANY_ITERATIONS)
        if reason < 0:
            raise NotConvergedError(SINGULAR_MESSAGE.format(f"PETSc reason {reason}"))

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
    #: text on the time of its solves relative to those of a factor
    pace = ", whose solves take ten times as long or more"

    @property
    def description(self) -> str:
        """Text: name of the solver, relative error of its solves, and forecast."""
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
        self._ksp.setTolerances(rtol=ITERATION_RESIDUAL, max_it=MOST_ITERATIONS)
        self._precondition(self._ksp.getPC())

    def _precondition(self, pc: PETSc.PC) -> None:
        set_aggregation(pc)

    def trial_iterations(self, most: int) -> int:
        """Iterations of a solve for a random load; NotConvergedError above `most`."""
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
        """Context of solves to the relative error `MODE_RESIDUAL`."""
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


def set_aggregation(pc: PETSc.PC) -> None:
    """Set a preconditioner, which has its own options prefix, to smoothed aggregation."""
    options = PETSc.Options(pc.getOptionsPrefix())
    options["pc_gamg_threshold"] = WEAK_COUPLING
    pc.setType(PETSc.PC.Type.GAMG)
    pc.setFromOptions()
    del options["pc_gamg_threshold"]


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


#: Visits of the aggregates in place of a factor: 14 iterations for 12 of the bracket (one: 18).
AGGREGATED_CYCLES = 2


class TwoLevels(Multigrid):
    """Conjugate gradients with a two-level preconditioner. `motions()` returns rigid-body motions
    (rows, r), `inverse(A)` gives b -> A⁻¹b; `coarse`, PᵀAP, is aggregated unless `factored`."""

    method = "conjugate gradients with two levels"
    pace = ", which are slow where a part is thin or nearly incompressible"

    def __init__(
        self,
        A: PETSc.Mat,
        motions: Callable[[], Array],
        prolongation: PETSc.Mat,
        inverse: Callable[[PETSc.Mat], Callable[[Array], Array]],
        coarse: PETSc.Mat,
        factored: bool,
    ) -> None:
        self._P, self._motions, self._inverse = prolongation, motions, inverse
        self._coarse, self._factored = coarse, factored
        super().__init__(A)

    def _precondition(self, pc: PETSc.PC) -> None:
        coarse = self._coarse
        if self._factored:
            solve = self._inverse(coarse)
        else:
            set_near_null_space(coarse, at_vertices(self._P, self._motions()))
            T, aggregates = aggregation(coarse)
            level = linear_coarse_matrix(self.A, self._P) if uses_cells(self.A) else coarse
            solve = Cycle(level, T, self._inverse(aggregates), AGGREGATED_CYCLES)
            del T, aggregates, level

        fine = self.A
        if uses_cells(fine):  # with fewer points of quadrature
            product = fine.getAttr(CELLS_KEY)
            fine = cell_matrix(product.cells.simplified(), product.k, product.m)

        # an analysis in the inverse became the factor in double precision
        del coarse, self._coarse, self._inverse
        release_dropped(self.A.getComm().tompi4py())
        self._cycle = pc  # what becomes another type stays as long as the solver
        self._cycle.setType(PETSc.PC.Type.PYTHON)
        self._cycle.setPythonContext(Cycle(fine, self._P, solve))
        set_type_at_exit(self._cycle, PETSc.PC.Type.NONE)


class Cycle:
    """A multigrid cycle that approximates A⁻¹. P interpolates from the next level, of which
    `coarse` is an approximate inverse, applied `corrections` times between smoothings."""

    def __init__(
        self, A: PETSc.Mat, P: PETSc.Mat, coarse: Callable[[Array], Array], corrections: int = 1
    ) -> None:
        self._A, self._P, self._coarse, self._corrections = A, P, coarse, corrections
        self._comm = A.getComm().tompi4py()
        self._load, self._fine = P.createVecs()
        self._smooth = Smoother(A)

    def apply(self, _: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Set y ≈ A⁻¹x. x is scaled first: single-precision numbers below 1e-38 are slow."""
        load = x.array_r
        size = self._comm.allreduce(float(np.abs(load).max(initial=0.0)), MPI.MAX) or 1.0
        y.setArray(size * self(load / size))

    def __call__(self, load: Array) -> Array:
        """Approximate A⁻¹ load."""
        result, residual = self._smooth(load)

        for left in reversed(range(self._corrections)):
            self._fine.setArray(residual)
            self._P.multTranspose(self._fine, self._load)
            self._load.setArray(self._coarse(self._load.array_r))
            self._P.mult(self._load, self._fine)
            correction = self._fine.array_r
            result = result + correction
            residual = residual - multiply_linear(self._A, correction)
            smoothed, residual = self._smooth(residual, last=left == 0)
            result += smoothed

        return result


#: Options by which GAMG makes no solvers of its levels.
ONLY_AGGREGATES = {
    "pc_mg_levels": 2,
    "mg_coarse_pc_type": "none",
    "mg_levels_ksp_type": "richardson",
    "mg_levels_pc_type": "none",
}


def aggregation(A: PETSc.Mat) -> tuple[PETSc.Mat, PETSc.Mat]:
    """(P, PᵀAP) of smoothed aggregation, for a matrix A with a near null space."""
    pc = PETSc.PC().create(A.getComm())
    register_for_release(pc)
    pc.setOptionsPrefix(f"antiosc_{id(pc)}_")
    pc.setOperators(A)
    options = PETSc.Options(pc.getOptionsPrefix())
    for name, value in ONLY_AGGREGATES.items():
        options[name] = value
    set_aggregation(pc)
    pc.setUp()
    for name in ONLY_AGGREGATES:
        del options[name]

    P = pc.getMGInterpolation(1)
    register_for_release(P)
    # products by groups of equal rows take 1.8 times as long (PETSc 3.18)
    P.setOption(PETSc.Mat.Option.USE_INODES, False)
    P.assemble()
    # a copy does not hold A, P and the work of their product
    product = pc.getMGCoarseSolve().getOperators()[0]
    register_for_release(product)
    return P, _with_ones(product.copy(), P)


#: Entry of a row of P from which on its node is one of the coarse nodes.
VERTEX_WEIGHT = 0.99
#: Sum of entries of P from which on a coarse dof moves fixed ones: more than rounding.
FIXED_WEIGHT = 0.01


def at_vertices(P: PETSc.Mat, motions: Array) -> Array:
    """`motions` (rows, r) of the fine dofs, sampled at the coarse dofs: (coarse rows, r)."""
    coarse, fine = P.createVecs()
    result = np.empty((coarse.getLocalSize(), motions.shape[1]))

    pointers, _, values = P.getValuesCSR()
    rows = np.repeat(np.arange(len(pointers) - 1), np.diff(pointers))
    vertex_rows = np.bincount(rows, values > VERTEX_WEIGHT, len(pointers) - 1) > 0

    for k, column in enumerate(motions.T):
        fine.setArray(np.where(vertex_rows, column, 0.0))
        P.multTranspose(fine, coarse)
        result[:, k] = coarse.array_r

    return result


def without_fixed(P: PETSc.Mat, fixed: BoolArray) -> PETSc.Mat:
    """P, changed in place to zero in the rows of `fixed` fine dofs and in the columns of coarse
    dofs that move them; `fixed`: mask (rows of this rank,)."""
    coarse, fine = P.createVecs()
    fine.setArray(np.where(fixed, 1.0, 0.0))
    P.multTranspose(fine, coarse)
    coarse.setArray(np.where(coarse.array_r > FIXED_WEIGHT, 0.0, 1.0))
    fine.setArray(np.where(fixed, 0.0, 1.0))
    P.diagonalScale(fine, coarse)
    return P


def coarse_matrix(A: PETSc.Mat, P: PETSc.Mat) -> PETSc.Mat:
    """The coarse matrix PᵀAP, with 1 on the diagonal where a column of P is empty."""
    if uses_cells(A):
        return _with_ones(with_entries(linear_coarse_matrix(A, P)), P)
    product = A.ptap(P)
    register_for_release(product)
    return _with_ones(product.copy(), P)  # which does not hold A and P


def _with_ones(coarse: PETSc.Mat, P: PETSc.Mat) -> PETSc.Mat:
    """`coarse`, changed in place to 1 on the diagonal where a column of P is empty."""
    register_for_release(coarse)
    coarse.setBlockSize(P.getBlockSizes()[1])
    first, _ = coarse.getOwnershipRange()
    coarse.zeroRowsColumns((first + empty_columns(P)).astype(PETSc.IntType), diag=1.0)
    return coarse


def linear_coarse_matrix(A: PETSc.Mat, P: PETSc.Mat) -> PETSc.Mat:
    """Coarse matrix, from linear elements, of a matrix A that is multiplied cell by cell."""
    product = A.getAttr(CELLS_KEY)
    return cell_matrix(product.cells.coarse(P, empty_columns(P)), product.k, product.m)


def empty_columns(P: PETSc.Mat) -> IntArray:
    """The columns of P of this rank without entries."""
    sums, weights = P.createVecs()  # random ones: entries of a column can cancel
    weights.setArray(np.random.default_rng(0).random(weights.getLocalSize()))
    P.multTranspose(weights, sums)
    return np.flatnonzero(sums.array_r == 0.0)


# -- Smoothing: Chebyshev's iteration, from the largest eigenvalue of D⁻¹A down to a tenth of it.

#: Steps before and after the coarse level, and the least share of the largest eigenvalue smoothed.
CHEBYSHEV_STEPS, LOWEST_SMOOTHED = 2, 0.1
#: Steps of the power method for that eigenvalue, and a factor on its result.
POWER_STEPS, EIGENVALUE_MARGIN = 15, 1.1

#: The functions of the library, which `antiosc.engine.library` has checked, by precision.
_library = ctypes.CDLL(str(library.LIBRARY_FILE))
kernels: dict[Any, Any] = {
    np.float64: _library.afe_smooth_double,
    np.float32: _library.afe_smooth_float,
}
for _kernel, _real in zip(kernels.values(), (c_double, c_float), strict=True):
    _kernel.restype = None
    _kernel.argtypes = c_int64, c_int64, c_void_p, c_void_p, _real, _real, c_void_p, c_void_p


class Smoother:
    """Chebyshev's iteration for A, in single precision if A is multiplied cell by cell."""

    def __init__(self, A: PETSc.Mat) -> None:
        self._A = A
        self._product: CellProduct | None = A.getAttr(CELLS_KEY)
        self._real: Any = np.float32 if self._product else np.float64
        b = A.getBlockSize()
        if self._product:
            blocks = self._product.cells.blocks(self._product.k, self._product.m)
            inverse = np.linalg.inv(blocks.reshape(-1, b, b))
        else:
            inverse = np.ascontiguousarray(A.invertBlockDiagonal()).reshape(-1, b, b)
        self._inverse = inverse.astype(self._real)
        self._rows = A.getLocalSize()[0]
        self._residual, self._step, self._total = (self._vector() for _ in range(3))

        largest = EIGENVALUE_MARGIN * self._largest(A.getComm().tompi4py())
        middle, half = ((1 + sign * LOWEST_SMOOTHED) / 2 * largest for sign in (1, -1))

        #: factors of the last step and of D⁻¹ times the residual in each step
        self._factors = [(0.0, 1 / middle)]
        rho = half / middle
        for _ in range(CHEBYSHEV_STEPS - 1):
            next_rho = 1 / (2 * middle / half - rho)
            self._factors.append((next_rho * rho, 2 * next_rho / half))
            rho = next_rho

    def __call__(self, load: Array, last: bool = False) -> tuple[Array, Array]:
        """(x ≈ A⁻¹ load, residual load − A x), arrays that the next call overwrites; `last`: the
        residual, no longer needed, is not updated."""
        self._residual[: self._rows] = load
        for keep, gain in self._factors:
            if keep:
                self._subtract_product()
            self._advance(keep, gain)
        if not last:
            self._subtract_product()

        return self._total[: self._rows], self._residual[: self._rows]

    def _vector(self) -> Array:
        """A zero vector on the rows of this rank, with ghosts for products by cells."""
        if self._product:
            return self._product.cells.vector(self._real)
        return np.zeros(self._rows)

    def _subtract_product(self) -> None:
        """Subtract A times the step from the residual."""
        if self._product:
            k, m = -self._product.k, -self._product.m
            self._product.cells.add(k, m, self._step, self._residual)
        else:
            self._residual -= multiply(self._A, self._step)

    def _advance(self, keep: float, gain: float) -> None:
        """Set the step to keep · last step + gain · D⁻¹ residual, and add it to the solution."""
        count, size, _ = self._inverse.shape
        inverse, residual, step, total = (
            library.address(array)
            for array in (self._inverse, self._residual, self._step, self._total)
        )
        kernels[self._real](count, size, inverse, residual, keep, gain, step, total)

    def _largest(self, comm: MPI.Comm) -> float:
        """Estimate of the largest eigenvalue of D⁻¹A."""
        self._step[: self._rows] = np.random.default_rng(0).standard_normal(self._rows)
        for _ in range(POWER_STEPS):
            self._residual[:] = 0.0
            self._subtract_product()
            self._advance(0.0, -1.0)
            x = self._step[: self._rows]
            size = float(np.sqrt(comm.allreduce(float(x @ x))))
            x /= size

        return size
