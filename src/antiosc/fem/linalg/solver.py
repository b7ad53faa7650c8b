"""The base of all solvers of symmetric positive definite matrices: checked solves, forecasts.

Forecasts are the time (seconds of one core) and memory (bytes) of the solvers of a large part. The
cost of a factor follows from the number of its entries, which a symbolic analysis counts. The cost
of two levels follows from the size of their matrices and the iterations of one trial solve, which
depend on Poisson's ratio, thinness, slivers, material axes and springs. A random load takes within
20 % of the iterations of a model's loads (measured).
"""

from __future__ import annotations

import logging
import math
import time
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import get_args

import numpy as np
import scipy.sparse
import scipy.sparse.linalg

from antiosc.base import checks, process
from antiosc.base._types import Array, Matrix, SolverChoice
from antiosc.base.errors import AccuracyError, NotConvergedError
from antiosc.base.process import one_thread
from antiosc.base.texts import plain_number
from antiosc.fem.linalg import algebra
from antiosc.fem.linalg.algebra import diagonal_roots, multiply, norms

#: Solves in turn that a model of twenty anti-oscillators needs.
SOLVES_OF_MODEL = 22
#: Bytes per entry of a factor, and of the matrices and work arrays beside it.
FACTOR_ENTRY_BYTES = 8 * 1.3
#: Bytes of two levels for each entry of the coarse factor, which may need double precision.
COARSE_ENTRY_BYTES = 10.0
#: Seconds of a factor for each of its entries, and for entries^1.5, by which operations grow.
FACTOR_ENTRY_SECONDS, FACTOR_WORK_SECONDS = 2.2e-8, 3.5e-12
#: Seconds of a solve for each entry; k right-hand sides at once take k^0.4 times as long.
SOLVE_ENTRY_SECONDS, BLOCK_SOLVE_EXPONENT = 1e-9, 0.4
#: Seconds of an iteration of two levels for each entry of the factor of the coarse level.
COARSE_SECONDS = 0.5e-9
#: Fewest iterations of a solve by two levels: compact blocks of hexahedra take 8, tetrahedra 10.
FEWEST_ITERATIONS = 8
#: Largest ‖A‖‖x‖/‖Ax‖: rounding makes a mechanism as stiff as 1e-16 of the stiffest motion.
SOLUTION_GROWTH = 1e14
#: Message for a matrix without a Cholesky factor.
SINGULAR_MESSAGE = (
    "the stiffness matrix cannot be factored ({}): some part can move freely, for instance at a "
    "hinge, a single common point or line (join it along a face, or support it), or a part is too "
    "slender for double precision (use fewer elements)."
)

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class ProductCost:
    """Cost of a two-level solver per entry of A, stored or not, in bytes and seconds."""

    row: float  # mean number of entries in a row of A; NaN where they are stored and counted
    bytes: float  # of the levels, and of the cells' data for products by cells
    #: bytes if the coarse level is aggregated in place of factored, at most, during the set-up
    aggregated: float
    seconds: float  # of an iteration


#: Products by stored entries.
STORED_PRODUCTS = ProductCost(math.nan, 6.0, 20.0, 8e-9)
#: Products by straight isotropic tetrahedra (by aggregates a bracket of 1.65 million dofs).
STRAIGHT_PRODUCTS = ProductCost(80.0, 4.5, 5.0, 1.1e-9)
#: Cost that curved cells add: their kernel takes 130 ns a cell, with the points of smoothing 31
#: and 60 in single and double precision, that of straight ones 16 and 24 (with AVX-512); a part
#: with 71 000 of them took 1.3 kB more a cell.
CURVED_PRODUCTS = ProductCost(80.0, 3.5, 3.5, 0.4e-9)
#: Entries of a factor of quadratic elements over those of linear ones on the same cells: 12 to 19
#: from plates to compact blocks of tetrahedra, 43 000 to 340 000 dofs; 10 to 13 of hexahedra.
QUADRATIC_OVER_LINEAR = 15.0
#: Entries of the factor of the coarse level up to which it is used. Brackets with 4e6 and 2e7 ones
#: take as long by aggregates, the larger one a quarter less memory; by the factor a plate with 8e6,
#: one cell thick, takes 37 iterations in place of 109.
MOST_COARSE_ENTRIES = 1e7
#: Seconds of the set-up of two levels for each entry, beside the factor of the coarse level.
SET_UP_SECONDS = 4e-8


@dataclass(frozen=True)
class Cost:
    """Forecast of a solver: bytes, and seconds of one core if known."""

    bytes: float
    seconds: float | None = None

    def __str__(self) -> str:
        time = "" if self.seconds is None else f"{plain_number(self.seconds)} s, "
        return f"forecast {time}{self.bytes / 1e9:.2g} GB"


def cost_of_factor(entries: float, columns: float) -> Cost:
    """Cost of a factor with `entries` entries and of a model's solves for `columns` loads."""
    return Cost(FACTOR_ENTRY_BYTES * entries, seconds_of_factor(entries, columns))


def seconds_of_factor(entries: float, columns: float) -> float:
    """Time [s] of a factor of `entries` entries and of a model's solves for `columns` loads."""
    seconds_of_solve = SOLVE_ENTRY_SECONDS * entries * columns**BLOCK_SOLVE_EXPONENT
    return _factor_seconds(entries) + SOLVES_OF_MODEL * seconds_of_solve


def seconds_of_steps(entries: float, steps: int) -> float:
    """Time [s] of a factor with this number of entries and of `steps` single solves."""
    return _factor_seconds(entries) + steps * SOLVE_ENTRY_SECONDS * entries


def _factor_seconds(entries: float) -> float:
    """Time [s] of a factor of `entries` entries."""
    return FACTOR_ENTRY_SECONDS * entries + FACTOR_WORK_SECONDS * entries**1.5


#: (c, p): the factor of shells has c dofs^p entries: c = 52 to 54 of bottles.
SHELL_FILL = 53.0, 1.15
#: Bytes for each dof and anti-oscillator: the bottle took 6 GB with 792 000 dofs.
SHAPE_BYTES = 16.0
#: Bytes for each dof of a structure of shells: K, M and their assembly. A printed carriage of
#: 142 000 dofs took 0.38 GB before, and 0.94 GB with 20 anti-oscillators (1.09 GB with 150).
SHELL_BYTES = 2700.0


def bytes_of_shells(dofs: float, n: int) -> float:
    """Memory [bytes] of factor and shapes of a model of shells with `n` anti-oscillators."""
    coefficient, power = SHELL_FILL
    return FACTOR_ENTRY_BYTES * coefficient * dofs**power + SHAPE_BYTES * n * dofs


@dataclass(frozen=True)
class LevelSizes:
    """Numbers of entries that determine the cost of a two-level solver."""

    stored: float  # of A, also where products by cells do not store them
    products: ProductCost  # of products with A, stored or by cells
    #: of a factor of A, from which `coarse` follows; 0: no coarse level of linear elements
    factor: float = 0.0

    @property
    def coarse(self) -> float:
        """Number of entries of the coarse level's factor; 0 if only aggregates are factorized."""
        entries = self.factor / QUADRATIC_OVER_LINEAR
        return entries if entries <= MOST_COARSE_ENTRIES else 0.0

    @property
    def bytes(self) -> float:
        """Bytes of the levels and work arrays, without A."""
        if not self.coarse:
            return self.products.aggregated * self.stored
        return self.products.bytes * self.stored + COARSE_ENTRY_BYTES * self.coarse

    @property
    def setup_seconds(self) -> float:
        """Seconds of the set-up of the levels."""
        return SET_UP_SECONDS * self.stored + _factor_seconds(self.coarse)

    @property
    def iteration_seconds(self) -> float:
        """Seconds of one iteration."""
        return self.products.seconds * self.stored + COARSE_SECONDS * self.coarse

    def cost(self, iterations: float, columns: float) -> Cost:
        """Cost of a model whose solves take `iterations` iterations each."""
        solves = SOLVES_OF_MODEL * columns * iterations * self.iteration_seconds
        return Cost(self.bytes, self.setup_seconds + solves)

    def iterations_within(self, seconds: float, columns: float) -> int:
        """Most iterations per solve for which the model's total time is at most `seconds`."""
        left = seconds - self.setup_seconds
        return max(0, int(left / (SOLVES_OF_MODEL * columns * self.iteration_seconds)))


def checked_choice(choice: SolverChoice) -> SolverChoice:
    """`choice`; InputError if it names no solver."""
    checks.choice("solver", choice, get_args(SolverChoice))
    return choice


class Solver(ABC):
    """A⁻¹ of a symmetric positive definite matrix, for many right-hand sides."""

    #: largest ‖A‖‖x‖/‖Ax‖ of a checked solve
    growth: float = SOLUTION_GROWTH
    #: largest ‖Ax - r‖ / (‖A‖‖x‖ + ‖r‖) that a solve may leave; sound factors leave about 1e-16
    backward_error: float = 1e-10
    #: bound on the relative error in energy of the solves so far; 0 for factors
    error: float = 0.0
    #: forecast of a one-site model with this solver; None: no forecast was made
    cost: Cost | None = None
    #: largest number of right-hand sides at once for which this solver was chosen
    columns: float = math.inf

    def __init__(self, A: Matrix) -> None:
        start_time = time.perf_counter()
        self.A = A
        self.comm = algebra.communicator(A)
        algebra.declare_definite(A)
        process.return_free_memory()
        with one_thread():  # but for factors that are worth more
            self._set_up()
        process.return_free_memory()

        #: time of the set-up, s
        self.seconds = time.perf_counter() - start_time
        log.info("%s of %d dofs: %.1f s", type(self).__name__, algebra.size(A), self.seconds)

    @abstractmethod
    def _set_up(self) -> None:
        """Prepare the solver, once, before its first solve."""

    @abstractmethod
    def solve_block(self, R: Array) -> Array:
        """A⁻¹R for a block of vectors (rows, k), without a check of the residual."""

    def solve(self, r: Array) -> Array:
        """A⁻¹r for one vector."""
        return self.solve_block(r[:, None])[:, 0]

    def solve_checked(self, r: Array) -> Array:
        """A⁻¹r (a vector or a block); AccuracyError if growth or residual show a singular A."""
        R = r[:, None] if r.ndim == 1 else r
        X = self.solve_block(R)
        root = diagonal_roots(self.A)[:, None]
        load = norms(self.comm, R / root)
        size = norms(self.comm, root * X) + load
        residual = norms(self.comm, (multiply(self.A, X) - R) / root)
        growth = (size / np.maximum(load, np.finfo(float).tiny)).max()
        if not growth <= self.growth:
            raise AccuracyError(SINGULAR_MESSAGE.format(f"‖A‖‖x‖/‖Ax‖ = {growth:.0e}"))
        if not (residual <= self.backward_error * size).all():
            error = (residual / size).max()
            reason = f"backward error {error:.1e}, limit {self.backward_error:.0e}"
            raise AccuracyError(SINGULAR_MESSAGE.format(reason))

        return X[:, 0] if r.ndim == 1 else X

    @contextmanager
    def accurately(self) -> Iterator[None]:
        """Context in which solves have the accuracy that an eigenproblem's shapes need."""
        yield

    @property
    def description(self) -> str:
        """Name of the solver, with its forecast, as text for messages."""
        return "factor" if self.cost is None else f"factor; {self.cost}"

    def force_sizes(self, R: Array) -> Array:
        """Norms (k,) of loads R (rows, k), to which residuals are relative."""
        return norms(self.comm, R)


class Factorization(Solver):
    """Base of direct solvers."""

    @property
    @abstractmethod
    def entries(self) -> float:
        """Number of entries of the factor on all ranks."""


# -- factors of SciPy's matrices by SuperLU


#: Remedy for matrices that are too large.
REDUCE_REMEDY = "reduce the matrices, take a coarser mesh, or a machine with more memory"

#: How SuperLU orders, for symmetric matrices with pivots on the diagonal.
SYMMETRIC_ORDER: dict[str, object] = {
    "permc_spec": "MMD_AT_PLUS_A",
    "diag_pivot_thresh": 0.0,
    "options": {"SymmetricMode": True, "Equil": False},
}


class SuperLU(Factorization):
    """P A Pᵀ = L D Lᵀ by SuperLU; A is positive definite if all diagonal pivots are positive."""

    def _set_up(self) -> None:
        try:
            self._lu = scipy.sparse.linalg.splu(self.A.tocsc(), **SYMMETRIC_ORDER)
        except RuntimeError as error:  # an empty column of what is left
            raise NotConvergedError(SINGULAR_MESSAGE.format(f"SuperLU: {error}")) from error
        except MemoryError as error:
            noun = f"the factor of {self.A.shape[0]} dofs"
            raise process.allocation_error(noun, error, REDUCE_REMEDY) from error

        if not np.array_equal(self._lu.perm_r, self._lu.perm_c):
            raise NotConvergedError(SINGULAR_MESSAGE.format("a pivot is zero"))

        pivots = self._lu.U.diagonal()
        if not (pivots > 0).all():
            row = int(np.flatnonzero(~(pivots > 0))[0])
            reason = f"pivot {row + 1} of {len(pivots)} is {pivots[row]:.1e}"
            raise NotConvergedError(SINGULAR_MESSAGE.format(reason))

    @property
    def entries(self) -> float:
        """Number of entries of L and U."""
        return float(self._lu.nnz)

    def solve_block(self, R: Array) -> Array:
        """A⁻¹R for a block of vectors (rows, k)."""
        return np.asarray(self._lu.solve(np.asfortranarray(R)))
