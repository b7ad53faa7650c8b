"""The base of all solvers of symmetric positive definite matrices: checked solves."""

from __future__ import annotations

import logging
import math
import time
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager
from typing import get_args

import numpy as np
import scipy.sparse
import scipy.sparse.linalg

from antiosc.base import checks, process
from antiosc.base._types import Array, Matrix, SolverChoice
from antiosc.base.errors import AccuracyError, NotConvergedError
from antiosc.base.process import one_thread
from antiosc.fem.linalg import algebra
from antiosc.fem.linalg.algebra import multiply, norms, roots
from antiosc.fem.linalg.forecast import Cost

#: Largest ‖A‖‖x‖/‖Ax‖: rounding makes a mechanism as stiff as 1e-16 of the stiffest motion.
SOLUTION_GROWTH = 1e14
#: Message for a matrix without a Cholesky factor.
SINGULAR = (
    "the stiffness matrix cannot be factored ({}): some part can move freely, for instance at a "
    "hinge, a single common point or line (join it along a face, or support it), or a part is too "
    "slender for double precision (use fewer elements)."
)

log = logging.getLogger(__name__)


def checked_choice(choice: SolverChoice) -> SolverChoice:
    """`choice`, or InputError."""
    checks.choice("solver", choice, get_args(SolverChoice))
    return choice


class Solver(ABC):
    """A⁻¹ of a symmetric positive definite matrix, for many right-hand sides."""

    #: largest ‖A‖‖x‖/‖Ax‖ of a checked solve
    growth: float = SOLUTION_GROWTH
    #: largest ‖Ax - r‖ / (‖A‖‖x‖ + ‖r‖) that a solve may leave; sound factors leave about 1e-16
    backward_error: float = 1e-10
    #: relative error in energy that the solves so far may have; factors leave rounding
    error: float = 0.0
    #: forecast of a model of one site with it, where there is one
    cost: Cost | None = None
    #: largest number of right-hand sides at once for which it is the faster one
    columns: float = math.inf

    def __init__(self, A: Matrix) -> None:
        start_time = time.perf_counter()
        self.A = A
        self.comm = algebra.communicator(A)
        algebra.declare_definite(A)
        with one_thread():  # but for factors that are worth more
            self._set_up()
        #: what the set-up took
        self.seconds = time.perf_counter() - start_time
        log.info("%s of %d dofs: %.1f s", type(self).__name__, algebra.size(A), self.seconds)

    @abstractmethod
    def _set_up(self) -> None:
        """Prepare the solver, once, before its first solve."""

    @abstractmethod
    def solve_block(self, R: Array) -> Array:
        """A⁻¹R for a block of vectors (rows, k), without a check beyond the solver's."""

    def solve(self, r: Array) -> Array:
        """A⁻¹r for one vector."""
        return self.solve_block(r[:, None])[:, 0]

    def solve_checked(self, r: Array) -> Array:
        """A⁻¹r (a vector or a block), whose residual shows a singular matrix."""
        R = r[:, None] if r.ndim == 1 else r
        X = self.solve_block(R)
        root = roots(self.A)[:, None]
        load = norms(self.comm, R / root)
        size = norms(self.comm, root * X) + load
        residual = norms(self.comm, (multiply(self.A, X) - R) / root)
        growth = (size / np.maximum(load, np.finfo(float).tiny)).max()
        if not growth <= self.growth:
            raise AccuracyError(SINGULAR.format(f"‖A‖‖x‖/‖Ax‖ = {growth:.0e}"))
        if not (residual <= self.backward_error * size).all():
            error = (residual / size).max()
            raise AccuracyError(
                SINGULAR.format(f"backward error {error:.1e}, limit {self.backward_error:.0e}")
            )
        if r.ndim == 1:
            return X[:, 0]
        return X

    @contextmanager
    def accurately(self) -> Iterator[None]:
        """Context in which solves are as accurate as the shapes of an eigenproblem need."""
        yield

    @property
    def description(self) -> str:
        """Name of the solver, with its forecast, as text for messages."""
        return "factor" if self.cost is None else f"factor; {self.cost}"

    def force_sizes(self, R: Array) -> Array:
        """Norms (k,) of loads R (rows, k), relative to which residuals are measured."""
        return norms(self.comm, R)


class Factorization(Solver):
    """Base of direct solvers."""

    @property
    @abstractmethod
    def entries(self) -> float:
        """Number of entries of the factor on all ranks."""


# -- factors of SciPy's matrices by SuperLU


#: Remedy for matrices that are too large.
REDUCE = "reduce the matrices, take a coarser mesh, or a machine with more memory"

#: How SuperLU orders, for symmetric matrices with pivots on the diagonal.
SYMMETRIC_ORDER: dict[str, object] = {
    "permc_spec": "MMD_AT_PLUS_A",
    "diag_pivot_thresh": 0.0,
    "options": {"SymmetricMode": True, "Equil": False},
}


class SuperLU(Factorization):
    """A factor P A Pᵀ = L D Lᵀ by SuperLU with pivots on the diagonal.

    The ordering is symmetric, so the signs of D are those of A's eigenvalues (Sylvester): a matrix
    that is not positive definite has a pivot that is not positive, or one off the diagonal.
    """

    def _set_up(self) -> None:
        try:
            self._lu = scipy.sparse.linalg.splu(self.A.tocsc(), **SYMMETRIC_ORDER)
        except RuntimeError as error:  # an empty column of what is left
            raise NotConvergedError(SINGULAR.format(f"SuperLU: {error}")) from error
        except MemoryError as error:
            raise process.allocation_failed(
                f"the factor of {self.A.shape[0]} dofs", error, REDUCE
            ) from error
        if not np.array_equal(self._lu.perm_r, self._lu.perm_c):
            raise NotConvergedError(SINGULAR.format("a pivot is zero"))
        pivots = self._lu.U.diagonal()
        if not (pivots > 0).all():
            row = int(np.flatnonzero(~(pivots > 0))[0])
            raise NotConvergedError(
                SINGULAR.format(f"pivot {row + 1} of {len(pivots)} is {pivots[row]:.1e}")
            )

    @property
    def entries(self) -> float:
        """Number of entries of L and U."""
        return float(self._lu.nnz)

    def solve_block(self, R: Array) -> Array:
        """A⁻¹R for a block of vectors (rows, k)."""
        return np.asarray(self._lu.solve(np.asfortranarray(R)))
