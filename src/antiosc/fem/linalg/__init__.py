"""Solvers of symmetric positive definite matrices of SciPy and of PETSc."""

from __future__ import annotations

from collections.abc import Callable

from antiosc.base._types import Array, Matrix, SolverChoice
from antiosc.fem.linalg.algebra import is_scipy
from antiosc.fem.linalg.solver import Solver, SuperLU


def solver_for(
    A: Matrix,
    choice: SolverChoice,
    motions: Callable[[], Array],
    prolongation: Callable[[], Matrix | None] = lambda: None,
    columns: float = 1.0,
) -> Solver:
    """The solver of A by `choice`; of a SciPy matrix always SuperLU.

    Multigrid uses the rigid-body motions that `motions()` returns (rows of this rank, r), and the
    interpolation from coarse dofs that `prolongation()` returns (None: it aggregates dofs).
    `columns`: right-hand sides at once; inf: "auto" takes a direct solver if it fits in memory.
    """
    if is_scipy(A):
        return SuperLU(A)
    from antiosc.fem.linalg import iterative, solver_choice  # need PETSc

    return solver_choice.solver_for(A, choice, iterative.Levels(motions, prolongation), columns)
