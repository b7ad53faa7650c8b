"""Solvers of PETSc matrices: their choice by memory, factors over ranks, K from its strains.

The size of a Cholesky factor of a compact body grows as n^(4/3). If it does not fit in the free
memory, conjugate gradients are used (`antiosc.fem.linalg.multigrid`): preconditioned by two levels
on quadratic solids, by algebraic multigrid elsewhere. If their matrices do not fit either, an
OutOfMemoryError says so before they are made. From `LARGE` dofs on two levels are also used where
they take less time: a trial solve counts their iterations, and ends at those with which a factor is
faster (`antiosc.fem.linalg.forecast`).

A factor over several ranks: the interface Γ is the smallest set of nodes that separates the parts
of the ranks. Each rank factors its interior and Γ by CHOLMOD, Γ last: with L_Γ the block of Γ in
the factor of

    [A_II  A_IΓ]
    [A_ΓI  A_ΓΓ]    L_Γ L_Γᵀ = A_ΓΓ - A_ΓI A_II⁻¹ A_IΓ,

and the Schur complement of the whole is S = A_ΓΓ + Σ (L_Γ L_Γᵀ - A_ΓΓ) over the ranks: a small
dense matrix on every rank. A solve consists of a forward substitution on each rank, one sum over
the ranks, a dense solve, and a backward substitution (Przemieniecki, AIAA J. 1 (1963) 138).

On two ranks MUMPS takes 1.8 to 3 times as long for the factor of a bracket, 4 to 10 times as long
for a solve and 4 to 7 times as long for 16, in half of the memory
(measured).

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
from contextlib import suppress
from copy import copy
from dataclasses import replace
from functools import cache, cached_property, partial

import numpy as np
import scipy.linalg
import scipy.sparse
from mpi4py import MPI
from petsc4py import PETSc
from scipy.sparse.csgraph import breadth_first_order, maximum_bipartite_matching

from antiosc.base import process
from antiosc.base._types import Array, IntArray, SolverChoice
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
    watch,
    with_entries,
)
from antiosc.fem.linalg.rounded_factor import RoundedFactor
from antiosc.fem.linalg.solver import SINGULAR, Factorization, Solver
from antiosc.fem.linalg.two_levels import FACTORED, TwoLevels, coarse_of
from antiosc.fem.platform import agree, on_root, warn

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


class Substructures(Factorization):
    """Cholesky factor of a matrix whose rows are spread over the ranks.

    Parameters
    ----------
    interface : global rows of Γ, ascending, from `interface`
    single : whether it is a factor in single precision, which solves for vectors only.
    """

    def __init__(self, A: PETSc.Mat, interface: IntArray, single: bool = False) -> None:
        self._interface = interface
        self._real = np.float32 if single else np.float64
        self._factor: Cholesky | RoundedFactor
        self._holder: PETSc.IS | None = None
        super().__init__(A)

    def _set_up(self) -> None:
        A, comm = self.A, self.comm
        first, last = A.getOwnershipRange()
        pointers, columns, values = A.getValuesCSR()
        local = scipy.sparse.csr_matrix(
            (values, columns, pointers), shape=(last - first, A.getSize()[0])
        )
        # places in Γ of the rows of this rank in it, and those rows
        self._at = np.flatnonzero((self._interface >= first) & (self._interface < last))
        self._mine = self._interface[self._at] - first
        is_inner = np.ones(last - first, dtype=bool)
        is_inner[self._mine] = False
        self._inner = np.flatnonzero(is_inner)
        interface_block = self._between(local[self._mine])
        # Γ as far as this rank's interior meets it stands in front: CHOLMOD reads columns that
        # come before the diagonal.
        rows = local[self._inner]
        del pointers, columns, values, local
        position = np.full(A.getSize()[0], -1, dtype=np.int32)
        position[self._interface] = np.arange(len(self._interface))
        touched = position[rows.indices]
        self._met = np.unique(touched[touched >= 0])
        count = len(self._met)
        position[self._interface[self._met]] = np.arange(count)
        position[first + self._inner] = count + np.arange(len(self._inner))
        n = count + len(self._inner)
        rows = scipy.sparse.csr_matrix(
            (rows.data, position[rows.indices], rows.indptr), shape=(len(self._inner), n)
        )
        corner = interface_block[self._met][:, self._met]
        square: Array | None = None
        error: Exception | None = None
        try:
            if len(self._inner):
                corner.resize((count, n))
                rows = lower(scipy.sparse.vstack([corner, rows], format="csr"))
                analysis = Analysis(rows, A.getBlockSize(), last=count)
                del rows, corner, touched, position
                process.trim_heap()
                single = self._real == np.float32
                self._factor = RoundedFactor(analysis) if single else Cholesky(analysis)
                del analysis
                self._to = np.argsort(self._factor.permutation)  # where a row stands in L
                order, L = self._factor.corner(count)
                self._positions = self._to[order]
                self._met = self._met[order]
                square = _square(L)
                del L  # S and its terms are as large
                known = interface_block[self._met][:, self._met].tocoo()
                square[known.row, known.col] -= known.data
        except NotPositiveDefiniteError as caught:
            error = NotConvergedError(SINGULAR.format(caught))
        except Exception as caught:  # the other ranks must not wait for this one
            error = caught
        agree(comm, error)
        S = np.zeros(interface_block.shape, self._real)
        if square is not None:
            S[np.ix_(self._met, self._met)] = square
            del square
        if comm.rank == 0:
            known = interface_block.tocoo()
            S[known.row, known.col] += known.data
        comm.Allreduce(MPI.IN_PLACE, S)
        try:
            self._S = scipy.linalg.cholesky(S.T, lower=True, overwrite_a=True) if len(S) else None
        except scipy.linalg.LinAlgError as caught:
            raise NotConvergedError(SINGULAR.format(caught)) from caught
        if len(self._inner):
            _, self._L = self._factor.corner(count)

    def _between(self, rows: scipy.sparse.csr_matrix) -> scipy.sparse.csr_matrix:
        """A_ΓΓ on every rank, from the rows of the interface Γ that each rank holds."""
        part = rows[:, self._interface].tocoo()
        of_ranks = self.comm.allgather((self._at[part.row], part.col, part.data))
        row, column, value = (np.concatenate(parts) for parts in zip(*of_ranks, strict=True))
        n = len(self._interface)
        return scipy.sparse.csr_matrix((value, (row, column)), shape=(n, n))

    @property
    def entries(self) -> float:
        """Number of entries of the factors of all ranks and of the interface."""
        local = self._factor.supernodes.values.size if len(self._inner) else 0
        return float(self.comm.allreduce(local) + len(self._interface) ** 2)

    def solve_block(self, R: Array) -> Array:
        """A⁻¹R for a block of vectors (rows of this rank, k)."""
        load: Array = np.zeros((len(self._interface), R.shape[1]), self._real)
        load[self._at] = R[self._mine]
        if len(self._inner):
            B = np.zeros((len(self._to), R.shape[1]), order="F")
            B[self._to[-len(self._inner) :]] = R[self._inner]
            Y = self._factor.forward(B)
            load[self._met] += _triangle(self._L, Y[self._positions])
        self.comm.Allreduce(MPI.IN_PLACE, load)
        U = load if self._S is None else _solved(self._S, load)
        X = np.empty(R.shape, order="F")
        X[self._mine] = U[self._at]
        if len(self._inner):
            Y[self._positions] = _triangle(self._L, U[self._met], trans=1)
            X[self._inner] = self._factor.backward(Y)[self._to[-len(self._inner) :]]
        return X

    def without_matrix(self) -> Substructures:
        """Solves that no longer keep A."""
        result = copy(self)
        result._holder = PETSc.IS().createGeneral([], comm=self.A.getComm())  # of the communicator
        watch(result._holder)
        del result.A
        return result

    def round_to_16_bits(self) -> None:
        """Round the factors of the ranks, which are in single precision."""
        if len(self._inner):
            assert isinstance(self._factor, RoundedFactor)
            self._factor.round_to_16_bits()


def _triangle(L: Array, X: Array, trans: int = 0) -> Array:
    """Product L X, or Lᵀ X, with a lower triangle L; for one vector only the triangle is read."""
    if X.shape[1] != 1 or not len(X):
        return np.asarray((L.T if trans else L) @ X)
    (product,) = scipy.linalg.get_blas_funcs(("trmv",), (L,))
    return np.asarray(product(L, X[:, 0], lower=1, trans=trans))[:, None]


def _solved(L: Array, B: Array) -> Array:
    """(L Lᵀ)⁻¹B; one vector takes a third of the time of a block of one."""
    if B.shape[1] != 1:
        return np.asarray(scipy.linalg.cho_solve((L, True), B, check_finite=False))
    (solve,) = scipy.linalg.get_blas_funcs(("trsv",), (L,))
    return np.asarray(solve(L, solve(L, B[:, 0], lower=1), lower=1, trans=1))[:, None]


def _square(L: Array) -> Array:
    """L Lᵀ of a lower triangle, with a third of the operations of a general product."""
    if not L.size:  # this part meets no other
        return np.zeros(L.shape)
    reversed_L = np.array(L[::-1, ::-1], order="F")  # a copy: LAPACK writes over it
    (product,) = scipy.linalg.get_lapack_funcs(("lauum",), (reversed_L,))
    upper, _ = product(reversed_L, overwrite_c=1)
    square = np.asarray(upper)[::-1, ::-1]
    for j in range(len(square)):  # all at once would take a copy
        square[j, j + 1 :] = square[j + 1 :, j]
    return square


def interface(A: PETSc.Mat) -> IntArray:
    """Global rows of the nodes that separate the rows of different ranks."""
    comm = A.getComm().tompi4py()
    block = A.getBlockSize()
    first, last = A.getOwnershipRange()
    pointers, columns, _ = A.getValuesCSR()
    coupled = np.flatnonzero((columns < first) | (columns >= last))
    rows = first + np.searchsorted(pointers, coupled, side="right") - 1
    pairs = np.unique(np.column_stack([rows, columns[coupled]]) // block, axis=0)
    of_ranks = comm.gather(pairs)
    starts = np.array(comm.allgather(first)) // block

    def cut() -> IntArray:
        pairs = np.vstack(of_ranks)
        return _cut(pairs[pairs[:, 0] < pairs[:, 1]], starts)

    nodes = on_root(comm, cut)
    return np.asarray(block * nodes[:, None] + np.arange(block)).ravel()


def _cut(pairs: IntArray, starts: IntArray) -> IntArray:
    """A set of nodes that contains a node of every pair coupled across ranks, least for each two
    ranks.
    """
    owners = np.searchsorted(starts, pairs, side="right") - 1
    cut_nodes = np.zeros(0, dtype=int)
    for ranks in np.unique(owners, axis=0):
        coupled = pairs[(owners == ranks).all(axis=1)]
        coupled = coupled[~np.isin(coupled, cut_nodes).any(axis=1)]
        if len(coupled):
            cut_nodes = np.union1d(cut_nodes, _cover(coupled))
    return cut_nodes


def _cover(pairs: IntArray) -> IntArray:
    """The least vertex cover of a bipartite graph, by its largest matching (Kőnig's theorem)."""
    first_nodes, i = np.unique(pairs[:, 0], return_inverse=True)
    right, j = np.unique(pairs[:, 1], return_inverse=True)
    n, m = len(first_nodes), len(right)
    graph = scipy.sparse.csr_matrix((np.ones(len(pairs)), (i, j)), shape=(n, m))
    mate = maximum_bipartite_matching(graph, perm_type="column")
    matched = np.flatnonzero(mate >= 0)
    # reached from single nodes on the left, to the right by any pair and back by matched ones
    source = n + m
    single = np.flatnonzero(mate < 0)
    tails = np.concatenate([i, n + mate[matched], np.full(len(single), source)])
    end_nodes = np.concatenate([n + j, matched, single])
    paths = scipy.sparse.csr_matrix(
        (np.ones(len(tails)), (tails, end_nodes)), shape=(source + 1, source + 1)
    )
    visited = np.zeros(source + 1, dtype=bool)
    visited[breadth_first_order(paths, source, return_predecessors=False)] = True
    return np.concatenate([first_nodes[~visited[:n]], right[visited[n:source]]])


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


#: Largest error in energy of a preconditioner's solve, relative; random loads are mostly answered
#: by the softest motions, which a rounded factor knows worst. With 0.092, in 16 bits, 1.03 million
#: dofs took 84 s, with 5e-4, in single precision, 95 s, side by side.
PRECONDITIONER_ERROR = 0.15
#: Bytes for each entry of A of an analysis of its factor: copies of A.
ANALYSIS = 20.0
#: Remedy where neither fits.
SMALLER_MESH = "use a coarser mesh or elements of order 1, or a machine with more memory"
#: Entries of a factor over rows^(4/3), for the most compact bodies: cubes of quadratic tetrahedra.
COMPACT = 35.0
#: Dofs from which times are compared too. Below, a factor takes less than a second.
LARGE = 30_000
#: Most rows of an interface between ranks that are kept as a dense matrix, 0.3 GB on each rank.
INTERFACE = 6_000


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
    process.trim_heap()
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
    process.trim_heap()
    return solver


def preconditioner(
    A: PETSc.Mat, analysis: Callable[[], Analysis | None] = lambda: None
) -> Callable[[Array], Array]:
    """Approximate A⁻¹ on the coarse level; by a factor in 16 bits or in single precision where that
    is accurate enough.

    `analysis` hands over the symbolic factor.
    """
    process.trim_heap()
    solve = _by_rounded(A, analysis)
    return factorize(A).solve if solve is None else solve


def _by_rounded(
    A: PETSc.Mat, analysis: Callable[[], Analysis | None]
) -> Callable[[Array], Array] | None:
    """Solves with the factor in 16 bits, or in single precision if these are not accurate enough;
    None if neither is.
    """
    comm = A.getComm().tompi4py()
    # as large as the stiffness: held rows, with 1 on the diagonal, must not hide the others
    b = np.sqrt(np.abs(A.getDiagonal().array))
    b *= np.random.default_rng(comm.rank).standard_normal(len(b))

    def accurate(solver: RoundedFactor | Substructures) -> bool:
        """Whether the error in energy, as the solver itself estimates it, is small."""
        x = solver.solve(b)
        residual = b - multiply(A, x)
        error = comm.allreduce(residual @ solver.solve(residual))
        return bool(error <= PRECONDITIONER_ERROR**2 * comm.allreduce(b @ x))

    # One factor at a time, and rounded in place: two take more memory than any other step.
    with suppress(NotConvergedError):  # not positive definite after rounding
        factor = _rounded(A, analysis)
        if factor is None or not accurate(factor):
            return None
        factor.round_to_16_bits()
        if accurate(factor):
            return factor.solve
        del factor
        factor = _rounded(A, analysis)
        return None if factor is None else factor.solve
    return None


def _rounded(
    A: PETSc.Mat, analysis: Callable[[], Analysis | None]
) -> RoundedFactor | Substructures | None:
    """The factor of A in single precision; None without CHOLMOD or where the ranks meet in too many
    rows.
    """
    comm = A.getComm().tompi4py()
    if cholmod_refused(comm):
        return None
    if comm.size == 1:
        return RoundedFactor(analysis() or analysed(A))
    rows = interface(A)
    return Substructures(A, rows, single=True).without_matrix() if len(rows) <= INTERFACE else None


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
    if refused:
        return Distributed(A)
    rows = interface(A)
    return Substructures(A, rows) if len(rows) <= INTERFACE else Distributed(A)


def cholmod_refused(comm: MPI.Comm) -> bool:
    """Whether CHOLMOD cannot be called directly on some rank."""
    return any(comm.allgather(bool(cholmod.refusal())))
