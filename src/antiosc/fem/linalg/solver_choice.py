"""Solvers of PETSc matrices: their choice by memory and time, and products of K by strains.

The size of a Cholesky factor of a compact body grows as n^(4/3). If it does not fit in the free
memory, conjugate gradients are used (`antiosc.fem.linalg.iterative`): preconditioned by two levels
on quadratic solids, by algebraic multigrid elsewhere. If their matrices do not fit either, an
OutOfMemoryError says so before they are made. From `LEAST_TIMED_DOFS` dofs on, two levels are also
used if they take less time: a trial solve counts their iterations, and stops at the number with
which a factor is faster (`antiosc.fem.linalg.solver`).

K = SᵀS + rest: shear stiffness dominates the entries of K of a slender beam; the bending energy is
the small remainder when they cancel. Their rounding ε causes a relative error of the bending
stiffness of up to ε (L/r)² n² (r the radius of gyration, n nodes). The error of k0 is 4e-8 at L/r =
350 and 100 nodes, 3e-6 at 900 and 400; all digits are lost at 3e5 and 2000. The rows of S are the
strains at the Gauss points times √(stiffness · weight). S has the square root of K's condition
number, so that Sᵀ(S x) loses only ε L/r, as QR does compared with normal equations in least squares
(Golub and Van Loan, *Matrix Computations*, §5.3). Conjugate gradients use this product, and the
factor of the rounded K as their preconditioner: one or two steps up to L/r = 3e4, ten if rounding
has removed the bending stiffness from the factor.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from antiosc.base import process
from antiosc.base._types import Array, SolverChoice
from antiosc.base.errors import AccuracyError, NotConvergedError
from antiosc.fem.linalg import cholmod
from antiosc.fem.linalg.algebra import column_products, conjugate_gradients, quotient, uses_strains
from antiosc.fem.linalg.cholmod import Cholesky, NotPositiveDefiniteError
from antiosc.fem.linalg.iterative import Levels, Multigrid, PetscSolver, TwoLevels, coarse_matrix
from antiosc.fem.linalg.petsc_algebra import (
    CELLS_KEY,
    PRODUCT_KEY,
    csr,
    dense_block,
    lower_triangle,
    multiply,
    uses_cells,
    with_entries,
)
from antiosc.fem.linalg.solver import (
    FACTOR_ENTRY_BYTES,
    FEWEST_ITERATIONS,
    QUADRATIC_OVER_LINEAR,
    SINGULAR_MESSAGE,
    STORED_PRODUCTS,
    Cost,
    Factorization,
    LevelSizes,
    ProductCost,
    Solver,
    cost_of_factor,
    seconds_of_factor,
)
from antiosc.fem.platform import on_root, warn

#: Error of a solve in the energy norm at which it ends, relative; of a compliance it is the square.
ENERGY_ERROR = 1e-11
#: Largest error accepted if rounding, or the largest number of steps, ends the solve.
STALLED_ERROR, MOST_CG_STEPS = 1e-6, 60
#: Share of its own diagonal by which a matrix is made stiffer that rounding keeps from a factor.
RIDGE_SHARE = 1e-14
#: Largest ‖A‖‖x‖/‖Ax‖: products by strains leave a mechanism about 1e-32 of the stiffest motion.
SOLUTION_GROWTH_BY_STRAINS = 1e24

log = logging.getLogger(__name__)


def use_strain_product(K: PETSc.Mat, S: PETSc.Mat, remainder: PETSc.Mat) -> None:
    """Make `multiply` compute K x as Sᵀ(S x) + `remainder` x; S x: weighted strains."""
    transposed = PETSc.Mat()
    S.transpose(transposed)

    def product(x: Array) -> Array:
        return np.asarray(multiply(transposed, multiply(S, x)) + multiply(remainder, x))

    K.setAttr(PRODUCT_KEY, product)


class SolverByStrains(Solver):
    """Conjugate gradients with A x computed from strains; preconditioner: the solver `make(A)`."""

    growth = SOLUTION_GROWTH_BY_STRAINS

    def __init__(self, A: PETSc.Mat, make: Callable[[PETSc.Mat], Solver]) -> None:
        self._make = make
        super().__init__(A)

    @property
    def entries(self) -> float:
        """Number of entries of the factor; 0 for an iterative solver."""
        return float(getattr(self._inner, "entries", 0.0))

    def _set_up(self) -> None:
        try:
            self._inner = self._make(self.A)
        except NotConvergedError:
            stiffer = self.A.copy()
            stiffer.setOption(PETSc.Mat.Option.NEW_NONZERO_ALLOCATION_ERR, False)  # empty rows
            stiffer.setDiagonal((1 + RIDGE_SHARE) * self.A.getDiagonal())
            self._inner = self._make(stiffer)

    def solve_block(self, R: Array) -> Array:
        """A⁻¹R for a block of vectors (rows, k); AccuracyError if the steps do not converge."""
        product = partial(multiply, self.A)
        inner = partial(column_products, self.comm)
        steps = conjugate_gradients(R, product, self._inner.solve_block, inner, MOST_CG_STEPS)
        for X, residual_energy, energy in steps:
            if (residual_energy <= ENERGY_ERROR**2 * energy).all():
                return X

        relative_error = float(np.max(np.sqrt(np.abs(quotient(residual_energy, energy)))))
        if not relative_error <= STALLED_ERROR:
            raise AccuracyError(
                f"a solve stopped at a relative error of {relative_error:.1e} in energy after "
                f"{MOST_CG_STEPS} steps (limit {STALLED_ERROR:.0e}): for beams this slender use "
                "fewer elements, or support loose parts."
            )
        return X

    def force_sizes(self, R: Array) -> Array:
        """Energy norms √(rᵀA⁻¹r) (k,) of loads R; rounding would fail checks by Euclidean norms."""
        squares = column_products(self.comm, R, self.solve_block(R))
        return np.asarray(np.sqrt(np.maximum(squares, 0.0)))


#: Per cent by which MUMPS may exceed its forecast of the memory, as entries gather on one rank.
MUMPS_MARGIN = 60


class CholmodFactor(Factorization):
    """Cholesky factor of a one-rank matrix by CHOLMOD, from its symbolic `analysis` if given."""

    def __init__(self, A: PETSc.Mat, analysis: Cholesky | None = None) -> None:
        self._analysis = analysis
        super().__init__(A)

    def _set_up(self) -> None:
        try:
            self.cholesky = (self._analysis or analysis_of(self.A)).factorized()
        except NotPositiveDefiniteError as error:
            raise NotConvergedError(SINGULAR_MESSAGE.format(error)) from error
        finally:
            self._analysis = None  # its copy of A is not used any more

    @property
    def entries(self) -> float:
        """Number of entries of the factor."""
        return float(self.cholesky.entries)

    def solve_block(self, R: Array) -> Array:
        """A⁻¹R for a block of vectors (rows, k); a block costs far less than single vectors."""
        return self.cholesky.solve(R)


def analysis_of(A: PETSc.Mat) -> Cholesky:
    """The symbolic factor of a matrix on one rank."""
    return Cholesky(lower_triangle(csr(A)), A.getBlockSize())


class MumpsFactor(PetscSolver, Factorization):
    """Cholesky factor distributed over the ranks by MUMPS, with an ordering of its choice."""

    def _set_up(self) -> None:
        row, least = self.A.getDiagonal().min()
        if least <= 0:  # MUMPS would take an empty row for a large one
            reason = f"{least:.1e} on the diagonal of row {row}"
            raise NotConvergedError(SINGULAR_MESSAGE.format(reason))
        super()._set_up()

        # MUMPS factors an indefinite matrix too, and counts its negative pivots.
        negative = self._ksp.getPC().getFactorMatrix().getMumpsInfog(12)
        if negative:
            raise NotConvergedError(SINGULAR_MESSAGE.format(f"{negative} negative pivots"))

    def _configure(self) -> None:
        self._ksp.setType(PETSc.KSP.Type.PREONLY)
        pc = self._ksp.getPC()
        pc.setType(PETSc.PC.Type.CHOLESKY)
        pc.setFactorSolverType("mumps")
        PETSc.Options()[f"{self._ksp.getOptionsPrefix()}mat_mumps_icntl_14"] = MUMPS_MARGIN
        self._ksp.setFromOptions()

    @property
    def entries(self) -> float:
        """Number of entries of the factor on all ranks."""
        count = self._ksp.getPC().getFactorMatrix().getMumpsInfog(29)
        return float(count if count >= 0 else -1e6 * count)  # large ones in millions, negative

    def solve_block(self, R: Array) -> Array:
        """A⁻¹R for a block of vectors (rows, k); a block costs far less than single vectors."""
        if R.shape[1] < 2:
            return super().solve_block(R)
        B, X = dense_block(self.A, R), dense_block(self.A, np.zeros(R.shape, order="F"))
        self._ksp.getPC().getFactorMatrix().matSolve(B, X)
        result = np.array(X.getDenseArray())
        X.destroy()
        B.destroy()
        return result


def entries_by_mumps(A: PETSc.Mat) -> float:
    """Estimated entries of MUMPS's factor, from one dof of each node; 0 for block size 1."""
    block = A.getBlockSize()
    if block == 1:
        return 0.0
    A = with_entries(A)
    first, last = A.getOwnershipRange()
    rows = PETSc.IS().createStride((last - first) // block, first, block, comm=A.getComm())
    return block**2 * MumpsFactor(A.createSubMatrix(rows, rows)).entries


#: Bytes for each entry of A of an analysis of its factor: copies of A.
ANALYSIS_BYTES = 20.0
#: Remedy if neither a factor nor two levels fit in memory.
SMALLER_MESH_REMEDY = "use a coarser mesh or elements of order 1, or a machine with more memory"
#: Entries of a factor over rows^(4/3), for the most compact bodies: cubes of quadratic tetrahedra.
COMPACT_FILL = 35.0
#: Dofs from which times are compared too. Below, a factor takes less than a second.
LEAST_TIMED_DOFS = 30_000


def solver_for(A: PETSc.Mat, choice: SolverChoice, levels: Levels, columns: float = 1.0) -> Solver:
    """The solver of A by `choice` ("auto": by forecasts) for `columns` loads at once (inf: "auto"
    takes a factor if it fits in memory); OutOfMemoryError if none fits."""
    levels = replace(levels, prolongation=cache(levels.prolongation))
    if uses_strains(A):
        return SolverByStrains(A, lambda matrix: _chosen_solver(matrix, choice, levels, columns))
    return _chosen_solver(A, choice, levels, columns)


def _chosen_solver(A: PETSc.Mat, choice: SolverChoice, levels: Levels, columns: float) -> Solver:
    """As `solver_for`, for the entries of A: products by strains are left to the caller."""
    if choice == "iterative":
        return _iterative_solver(A, levels)

    rows = A.getSize()[0]
    free = on_root(A.getComm().tompi4py(), process.free_memory)
    direct_only = choice == "direct" or columns == math.inf
    fits = FACTOR_ENTRY_BYTES * COMPACT_FILL * rows ** (4 / 3) <= process.MEMORY_SHARE * free
    if fits and (direct_only or rows < LEAST_TIMED_DOFS):
        return factorize(A)

    analysis = 0.0 if uses_cells(A) else ANALYSIS_BYTES * assembled_entries(A)
    process.require_memory(analysis, f"any solver of {rows} dofs", SMALLER_MESH_REMEDY, free)
    forecast = forecast_of(A, levels.prolongation() if uses_cells(A) else None)
    need = FACTOR_ENTRY_BYTES * forecast.entries
    if need <= process.MEMORY_SHARE * free:
        faster = None if direct_only else _two_levels_if_faster(A, forecast, levels, columns)
        return faster or factorize(A, forecast.take_analysis(A))

    noun = f"the factor of {rows} dofs"
    if choice == "direct":
        process.require_memory(
            need, noun, "take the solver 'iterative', a coarser mesh, or elements of order 1", free
        )
    del forecast  # its analysis has copies of A
    solver = _iterative_solver(A, levels)
    warn(
        A.getComm().tompi4py(),
        f"{process.shortage_text(noun, need, free)}: {solver.method} are used{solver.pace}; with a "
        "coarser mesh or elements of order 1 a factor may fit.",
    )
    return solver


def _two_levels_if_faster(
    A: PETSc.Mat, forecast: Forecast, levels: Levels, columns: float
) -> Multigrid | None:
    """A two-level solver if a trial solve shows it to be faster than the factor, else None."""
    sizes = _sizes_of(A, forecast.entries)
    seconds = seconds_of_factor(forecast.entries, columns)
    iteration_limit = sizes.iterations_within(seconds, columns)
    if iteration_limit < FEWEST_ITERATIONS or levels.prolongation() is None:
        return None

    try:
        solver = _iterative_solver(A, levels, forecast)
        iterations = solver.trial_iterations(iteration_limit)
    except NotConvergedError:  # a factor tells why, or serves
        return None
    solver.cost, solver.columns = sizes.cost(iterations, columns), columns
    return solver


def _iterative_solver(A: PETSc.Mat, levels: Levels, forecast: Forecast | None = None) -> Multigrid:
    """The iterative solver; OutOfMemoryError, before it is made, if its matrices do not fit."""
    free = on_root(A.getComm().tompi4py(), process.free_memory)
    prolongation = levels.prolongation()
    solver: Multigrid

    if prolongation is None:
        sizes = _fitting_sizes(A, 0.0, free)
        solver = Multigrid(with_entries(A), levels.motions())
    else:
        if forecast is None or forecast.matrix is A:
            forecast = forecast_of(A, prolongation)
        sizes = _fitting_sizes(A, forecast.entries, free)
        solver = _two_levels(A, levels.motions, prolongation, forecast, sizes.coarse > 0)

    solver.cost = Cost(sizes.bytes)
    return solver


def _fitting_sizes(A: PETSc.Mat, factor: float, free: float) -> LevelSizes:
    """Sizes of a two-level solver of A; OutOfMemoryError if it does not fit in `free` bytes."""
    sizes = _sizes_of(A, factor)
    noun = f"the iterative solver of {A.getSize()[0]} dofs"
    process.require_memory(sizes.bytes, noun, SMALLER_MESH_REMEDY, free)
    return sizes


def _two_levels(
    A: PETSc.Mat,
    motions: Callable[[], Array],
    prolongation: PETSc.Mat,
    forecast: Forecast,
    factored: bool,
) -> TwoLevels:
    """Two-level solver of A; the coarse matrix of `forecast` is aggregated unless `factored`."""
    if not factored:
        forecast.analysis = None  # it has a copy of the coarse matrix

    def inverse(matrix: PETSc.Mat) -> Callable[[Array], Array]:
        factor = factorize(matrix, forecast.take_analysis(matrix))
        return lambda b: factor.solve_block(b[:, None])[:, 0]

    return TwoLevels(A, motions, prolongation, inverse, forecast.matrix, factored)


def _sizes_of(A: PETSc.Mat, factor: float) -> LevelSizes:
    """Sizes of a two-level solver of A; a factor of A would have `factor` entries."""
    return LevelSizes(assembled_entries(A), _products_of(A), factor)


def _products_of(A: PETSc.Mat) -> ProductCost:
    """Cost of products with A per entry: by stored entries, or cell by cell."""
    cost: ProductCost = A.getAttr(CELLS_KEY).cells.products if uses_cells(A) else STORED_PRODUCTS
    return cost


def assembled_entries(A: PETSc.Mat) -> float:
    """Number of entries of A on all ranks, as if assembled if A is multiplied cell by cell."""
    if uses_cells(A):
        return _products_of(A).row * float(A.getSize()[0])
    return float(A.getInfo(PETSc.Mat.InfoType.GLOBAL_SUM)["nz_used"])


@dataclass(eq=False)
class Forecast:
    """Forecast of a matrix's factor, and the symbolic analysis that gave it."""

    entries: float  # of the factor of the given matrix on all ranks; 0: MUMPS gave no estimate
    matrix: PETSc.Mat  # that is analysed: the given one, or that of linear elements
    analysis: Cholesky | None = None  # of that matrix, on one rank

    def take_analysis(self, matrix: PETSc.Mat) -> Cholesky | None:
        """Return the analysis of `matrix` and forget it; None if there is none."""
        if matrix is not self.matrix:
            return None
        analysis, self.analysis = self.analysis, None
        return analysis


def forecast_of(A: PETSc.Mat, prolongation: PETSc.Mat | None = None) -> Forecast:
    """Forecast of the factor of A, from that of PᵀAP if the `prolongation` P is given."""
    matrix = A if prolongation is None else coarse_matrix(A, prolongation)
    finer = 1.0 if prolongation is None else QUADRATIC_OVER_LINEAR
    comm = A.getComm().tompi4py()
    if comm.size > 1 or cholmod_refused(comm):
        return Forecast(finer * entries_by_mumps(matrix), matrix)
    analysis = analysis_of(matrix)
    return Forecast(finer * float(analysis.entries), matrix, analysis)


def factorize(A: PETSc.Mat, analysis: Cholesky | None = None) -> Factorization:
    """The Cholesky factor of A: on one rank by CHOLMOD, from `analysis` if given; else by MUMPS."""
    comm = A.getComm().tompi4py()
    by_mumps = comm.size > 1 or cholmod_refused(comm)
    result: Factorization = MumpsFactor(with_entries(A)) if by_mumps else CholmodFactor(A, analysis)
    result.cost = cost_of_factor(result.entries, 1.0)
    return result


def cholmod_refused(comm: MPI.Comm) -> bool:
    """Whether CHOLMOD cannot be called directly on some rank."""
    return any(comm.allgather(bool(cholmod.refusal())))
