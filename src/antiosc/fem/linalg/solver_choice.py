"""Solvers of PETSc matrices: their choice by memory, K from its strains.

The size of a Cholesky factor of a compact body grows as n^(4/3). If it does not fit in the free
memory, conjugate gradients are used (`antiosc.fem.linalg.multigrid`): preconditioned by two levels
on quadratic solids, by algebraic multigrid elsewhere. If their matrices do not fit either, an
OutOfMemoryError says so before they are made. From `LARGE` dofs on two levels are also used where
they take less time: a trial solve counts their iterations, and ends at those with which a factor is
faster (`antiosc.fem.linalg.forecast`).

K = SᵀS + rest: the entries of K of a slender beam are dominated by the shear stiffness; the bending
energy is what remains when these entries cancel. Their rounding ε makes a relative error of up to ε
(L/r)² n² of the bending stiffness (r the radius of gyration, n nodes): 1e-6 at L/r = 900 and 800
nodes, all digits at 3e5 and 2000. S, whose rows are the strains at the Gauss points times
√(stiffness · weight), has the square root of K's condition number: Sᵀ(S x) loses ε L/r. The gain is
that of QR over the normal equations in least squares (Golub and Van Loan, *Matrix Computations*,
§5.3).

The factor of the rounded K is the preconditioner of conjugate gradients with that product: one or
two steps up to L/r = 3e4, ten if rounding has removed the bending stiffness from the factor.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache, cached_property, partial

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from antiosc.base import process
from antiosc.base._types import Array, SolverChoice
from antiosc.base.errors import AccuracyError, NotConvergedError
from antiosc.fem.linalg import cholmod
from antiosc.fem.linalg.algebra import by_strains, conjugate_gradients, quotient
from antiosc.fem.linalg.cholmod import (
    Analysis,
    Cholesky,
    NotPositiveDefiniteError,
)
from antiosc.fem.linalg.forecast import (
    BYTES,
    ENTRIES,
    FEWEST,
    Cost,
    LevelSizes,
    Products,
    of_factor,
    seconds_of_factor,
)
from antiosc.fem.linalg.multigrid import Levels, Multigrid, PetscSolver
from antiosc.fem.linalg.petsc_algebra import (
    CELLS,
    PRODUCT,
    by_cells,
    csr,
    dense,
    lower,
    multiply,
    with_entries,
)
from antiosc.fem.linalg.solver import SINGULAR, Factorization, Solver
from antiosc.fem.linalg.two_levels import FACTORED, TwoLevels, coarse_of
from antiosc.fem.platform import on_root, warn

#: Error of a solve in the energy norm at which it ends, relative; of a compliance it is the square.
ENERGY = 1e-11
#: Largest error accepted if rounding, or the largest number of steps, ends the solve.
STALLED, MOST_CG_STEPS = 1e-6, 60
#: Share of its own diagonal by which a matrix is made stiffer that rounding keeps from a factor.
RIDGE = 1e-14
#: Largest ‖A‖‖x‖/‖Ax‖: products by strains leave a mechanism about 1e-32 of the stiffest motion.
SOLUTION_GROWTH_BY_STRAINS = 1e24


def attach(K: PETSc.Mat, S: PETSc.Mat, remainder: PETSc.Mat) -> None:
    """Make `multiply` compute products with K = SᵀS + rest from the strains."""
    transposed = PETSc.Mat()
    S.transpose(transposed)

    def product(x: Array) -> Array:
        return np.asarray(multiply(transposed, multiply(S, x)) + multiply(remainder, x))

    K.setAttr(PRODUCT, product)


class Refined(Solver):
    """Conjugate gradients on A's accurate product, preconditioned by a solver of its stored
    entries.

    Parameters
    ----------
    A : a matrix whose product is by strains
    make : gives a solver of a matrix

    Raises
    ------
    NotConvergedError
        A has no factor.
    """

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
            stiffer.setDiagonal((1 + RIDGE) * self.A.getDiagonal())
            self._inner = self._make(stiffer)

    def solve_block(self, R: Array) -> Array:
        """A⁻¹R for a block of vectors (rows, k).

        Raises AccuracyError where the solver of the entries is too far from A.
        """
        for X, residual_energy, energy in conjugate_gradients(
            R,
            lambda x: multiply(self.A, x),
            self._inner.solve_block,
            self._inner_products,
            MOST_CG_STEPS,
        ):
            if (residual_energy <= ENERGY**2 * energy).all():
                return X
        relative_error = float(np.max(np.sqrt(np.abs(quotient(residual_energy, energy)))))
        if not relative_error <= STALLED:
            raise AccuracyError(
                f"a solve stopped at a relative error of {relative_error:.1e} in energy after "
                f"{MOST_CG_STEPS} steps (limit {STALLED:.0e}): for beams this slender with "
                "elements this short double precision does not resolve the bending stiffness; "
                "use fewer elements, or support loose parts."
            )
        return X

    def force_sizes(self, R: Array) -> Array:
        """√(rᵀA⁻¹r) of each load r: in the Euclidean norm, rounding of x alone would fail the
        check.
        """
        return np.asarray(np.sqrt(np.maximum(self._inner_products(R, self.solve_block(R)), 0.0)))

    def _inner_products(self, x: Array, y: Array) -> Array:
        return np.asarray(self.comm.allreduce(np.einsum("ij,ij->j", x, y)))


#: Per cent by which MUMPS may exceed its forecast of the memory (20 if not told): entries that
#: gather on one rank exceed it at times.
WORKSPACE = 60


class OnOneRank(Factorization):
    """Cholesky factor of a matrix on one rank, by CHOLMOD.

    Parameters
    ----------
    analysis : analysis of A from `analysed`, if there is one; it becomes the factor.
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
        """Number of entries of the factor."""
        return float(self.cholesky.supernodes.values.size)

    def solve_block(self, R: Array) -> Array:
        """A⁻¹R for a block of vectors (rows, k); a block costs far less than single vectors."""
        return self.cholesky.solve(R)


def analysed(A: PETSc.Mat) -> Analysis:
    """The symbolic factor of a matrix on one rank."""
    return Analysis(lower(csr(A)), A.getBlockSize())


class Distributed(PetscSolver, Factorization):
    """Cholesky factor distributed over the ranks by MUMPS, with an ordering of its choice."""

    def _set_up(self) -> None:
        super()._set_up()

        # MUMPS factors an indefinite matrix too, and counts its negative pivots.
        negative = self._ksp.getPC().getFactorMatrix().getMumpsInfog(12)
        if negative:
            raise NotConvergedError(SINGULAR.format(f"{negative} negative pivots"))

    def _configure(self) -> None:
        self._ksp.setType(PETSc.KSP.Type.PREONLY)
        pc = self._ksp.getPC()
        pc.setType(PETSc.PC.Type.CHOLESKY)
        pc.setFactorSolverType("mumps")
        PETSc.Options()[f"{self._ksp.getOptionsPrefix()}mat_mumps_icntl_14"] = WORKSPACE
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
        B, X = dense(self.A, R), dense(self.A, np.zeros(R.shape, order="F"))
        self._ksp.getPC().getFactorMatrix().matSolve(B, X)
        result = np.array(X.getDenseArray())
        X.destroy()
        B.destroy()
        return result


def forecast(A: PETSc.Mat) -> float:
    """Forecast of the entries of MUMPS's factor of A; 0 if A has no node blocks.

    MUMPS gives the size of a factor only after the factorization. It therefore factors the rows of
    one displacement component, every b-th row, with 1/b² of the entries and 1/b³ of the operations.
    """
    block = A.getBlockSize()
    if block == 1:
        return 0.0
    A = with_entries(A)
    first, last = A.getOwnershipRange()
    rows = PETSc.IS().createStride((last - first) // block, first, block, comm=A.getComm())
    return block**2 * Distributed(A.createSubMatrix(rows, rows)).entries


class ByPetsc(PetscSolver, Factorization):
    """Cholesky factor on one rank by CHOLMOD through PETSc, if it cannot be called directly."""

    def _configure(self) -> None:
        self._ksp.setType(PETSc.KSP.Type.PREONLY)
        pc = self._ksp.getPC()
        pc.setType(PETSc.PC.Type.CHOLESKY)
        if PETSc.Sys.hasExternalPackage("cholmod") or PETSc.Sys.hasExternalPackage("suitesparse"):
            pc.setFactorSolverType("cholmod")  # PETSc's own Cholesky fills in far more

    @property
    def entries(self) -> float:
        """Number of entries of the factor."""
        return float(self._ksp.getPC().getFactorMatrix().getInfo()["nz_used"])


#: Bytes for each entry of A of an analysis of its factor: copies of A.
ANALYSIS = 20.0
#: Remedy where neither fits.
SMALLER_MESH = "use a coarser mesh or elements of order 1, or a machine with more memory"
#: Entries of a factor over rows^(4/3), for the most compact bodies: cubes of quadratic tetrahedra.
COMPACT = 35.0
#: Dofs from which times are compared too. Below, a factor takes less than a second.
LARGE = 30_000


def solver_for(A: PETSc.Mat, choice: SolverChoice, levels: Levels, columns: float = 1.0) -> Solver:
    """The solver of A named by `choice`; "auto": by forecasts of memory and time.

    `levels` has the data of the part for a multigrid. `columns` is the number of right-hand sides
    of one call; inf requires a direct factor. If products with A are computed from strains,
    solutions with the factor of its entries are refined to their accuracy.
    """
    levels = replace(levels, coarser=cache(levels.coarser))
    if by_strains(A):
        return Refined(A, lambda matrix: _of_entries(matrix, choice, levels, columns))
    return _of_entries(A, choice, levels, columns)


def _of_entries(A: PETSc.Mat, choice: SolverChoice, levels: Levels, columns: float) -> Solver:
    rows = A.getSize()[0]
    free = on_root(A.getComm().tompi4py(), process.free_memory)
    if choice == "iterative":
        return _iterative(A, levels)
    direct_only = choice == "direct" or columns == math.inf
    fits = BYTES * COMPACT * rows ** (4 / 3) <= process.MEMORY_SHARE * free
    if fits and (direct_only or rows < LARGE):
        return factorize(A)
    analysis = 0.0 if by_cells(A) else ANALYSIS * stored(A)
    process.require(analysis, f"any solver of {rows} dofs", SMALLER_MESH, free)
    coarser = levels.coarser() if by_cells(A) else None
    plan = Plan(A) if coarser is None else PlanByLinear(A, coarser)
    entries = plan.entries
    need = BYTES * entries
    if need <= process.MEMORY_SHARE * free:
        faster = None if direct_only else _faster(A, plan, entries, levels, columns)
        return plan.factorize() if faster is None else faster
    noun = f"the factor of {rows} dofs"
    if choice == "direct":
        process.require(
            need, noun, "take the solver 'iterative', a coarser mesh, or elements of order 1", free
        )
    del plan  # its analysis has copies of A
    solver = _iterative(A, levels)
    warn(
        A.getComm().tompi4py(),
        f"{process.shortage(noun, need, free)}: {solver.method} are used{solver.pace}; with a "
        "coarser mesh or elements of order 1 a factor may fit.",
    )
    return solver


def _faster(
    A: PETSc.Mat, plan: Plan, entries: float, levels: Levels, columns: float
) -> Multigrid | None:
    """A two-level solver if a trial solve shows that it takes less time than the factor; otherwise
    None.
    """
    sizes = sizes_of(A, entries)
    iteration_limit = sizes.iterations_within(seconds_of_factor(entries, columns), columns)
    if iteration_limit < FEWEST or levels.coarser() is None:
        return None
    try:
        solver = _iterative(A, levels, plan)
        iterations = solver.trial(iteration_limit)
    except NotConvergedError:  # a factor tells why, or serves
        return None
    solver.cost, solver.columns = sizes.cost(iterations, columns), columns
    return solver


def foreseen(A: PETSc.Mat, coarser: Callable[[], PETSc.Mat | None]) -> str:
    """The forecast for a factor of A as text, and whether two levels may replace it."""
    entries = Plan(A).entries
    if not entries:
        return "not forecast"
    cost = of_factor(entries, 1.0)
    text = f"{entries:.3g} entries, {cost}"
    sizes = sizes_of(A, entries)
    iteration_limit = sizes.iterations_within(seconds_of_factor(entries, 1.0), 1.0)
    if A.getSize()[0] < LARGE or iteration_limit < FEWEST or coarser() is None:
        return text
    return f"{text}; two levels instead if a trial solve takes at most {iteration_limit} iterations"


def _iterative(A: PETSc.Mat, levels: Levels, plan: Plan | None = None) -> Multigrid:
    """The iterative solver; OutOfMemoryError before its matrices are made.

    `plan`: the forecast of the factor; a `PlanByLinear` already has the matrix of the coarse level.
    """
    free = on_root(A.getComm().tompi4py(), process.free_memory)
    coarser = levels.coarser()
    factored = coarser is not None and coarser.getSize()[1] <= FACTORED
    if plan is None and factored and by_cells(A) and A.getComm().getSize() == 1:
        plan = PlanByLinear(A, coarser)
    sizes = sizes_of(A, plan.entries if plan and factored else 0.0)
    noun = f"the iterative solver of {A.getSize()[0]} dofs"
    process.require(sizes.bytes, noun, SMALLER_MESH, free)
    solver: Multigrid
    if coarser is None:
        solver = Multigrid(with_entries(A), levels.motions())
    elif isinstance(plan, PlanByLinear):
        inverse = partial(preconditioner, analysis=plan.taken)
        solver = TwoLevels(A, levels.motions, coarser, inverse, plan.A)
    else:
        solver = TwoLevels(A, levels.motions, coarser, preconditioner)
    solver.cost = Cost(sizes.bytes)
    return solver


def preconditioner(
    A: PETSc.Mat, analysis: Callable[[], Analysis | None] = lambda: None
) -> Callable[[Array], Array]:
    """A⁻¹ on the coarse level; `analysis` hands over the symbolic factor."""
    factor = factorize(A, analysis())
    return lambda b: factor.solve_block(b[:, None])[:, 0]


def sizes_of(A: PETSc.Mat, factor: float) -> LevelSizes:
    """Sizes of a two-level solver of A whose factor would have `factor` entries."""
    return LevelSizes(stored(A), products_of(A), factor)


def products_of(A: PETSc.Mat) -> Products:
    """Cost of products with A per entry: by stored entries, or cell by cell."""
    cost: Products = A.getAttr(CELLS).cells.products if by_cells(A) else ENTRIES
    return cost


def stored(A: PETSc.Mat) -> float:
    """Number of entries of A on all ranks; for a cell-by-cell matrix, of the assembled one."""
    if by_cells(A):
        return products_of(A).row * float(A.getSize()[0])
    return float(A.getInfo(PETSc.Mat.InfoType.GLOBAL_SUM)["nz_used"])


class Plan:
    """Forecast for the factor of A, from a symbolic analysis that the factorization reuses."""

    def __init__(self, A: PETSc.Mat) -> None:
        comm = A.getComm().tompi4py()
        self.A = A
        self._analysis: Analysis | None = None
        if comm.size == 1 and not cholmod_refused(comm):
            self._analysis = analysed(A)

    @cached_property
    def entries(self) -> float:
        """Forecast of the factor's entries on all ranks; 0 if there is none."""
        return self._own_entries

    @property
    def _own_entries(self) -> float:
        if self._analysis is not None:
            return float(self._analysis.entries)
        return forecast(self.A)

    def taken(self) -> Analysis | None:
        """The symbolic analysis of A, handed over: call once, since a factor consumes it; None
        without one.
        """
        analysis, self._analysis = self._analysis, None
        return analysis

    def factorize(self) -> Factorization:
        """The factor; to be called once."""
        return factorize(self.A, self.taken())


class PlanByLinear(Plan):
    """Forecast for the factor of quadratic elements from the analysis of linear ones on the same
    cells.

    This analysis takes a tenth of the memory.
    """

    def __init__(self, A: PETSc.Mat, coarser: PETSc.Mat) -> None:
        super().__init__(coarse_of(A, coarser))
        self._fine = A

    @cached_property
    def entries(self) -> float:
        """Forecast of the factor's entries on all ranks; 0 if there is none."""
        return products_of(self._fine).finer * self._own_entries

    def factorize(self) -> Factorization:
        """The factor."""
        self._analysis = None
        return factorize(self._fine)


def factorize(A: PETSc.Mat, analysis: Analysis | None = None) -> Factorization:
    """The Cholesky factor of A by the fastest method for the number of ranks.

    `analysis`: the symbolic factor of A, if it is known, on one rank.
    """
    result = _factored(A, analysis)
    result.cost = of_factor(result.entries, 1.0)
    return result


def _factored(A: PETSc.Mat, analysis: Analysis | None) -> Factorization:
    comm = A.getComm().tompi4py()
    refused = cholmod_refused(comm)
    if comm.size == 1 and not refused:
        return OnOneRank(A, analysis)

    A = with_entries(A)
    if comm.size == 1:
        return ByPetsc(A)
    return Distributed(A)


def cholmod_refused(comm: MPI.Comm) -> bool:
    """Whether CHOLMOD cannot be called directly on some rank."""
    return any(comm.allgather(bool(cholmod.refusal())))
