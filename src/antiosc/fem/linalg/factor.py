"""The solver of a matrix, from the back-end that the matrix is of."""

from __future__ import annotations

from collections.abc import Callable

from antiosc._types import Array, Matrix
from antiosc.fem.linalg import scipy_solvers
from antiosc.fem.linalg.algebra import by_scipy
from antiosc.fem.linalg.solver import Choice, Solver


def solver_for(A: Matrix, choice: Choice, motions: Callable[[], Array]) -> Solver:
    """The solver of A that `choice` names; "auto": direct if its factor fits in memory.

    `motions` gives rigid-body motions (rows of this rank, r) for a multigrid. A SciPy matrix is
    always solved directly.
    """
    if by_scipy(A):
        return scipy_solvers.factorize(A)
    from antiosc.fem.linalg import solver_choice  # needs PETSc

    return solver_choice.solver_for(A, choice, motions)
