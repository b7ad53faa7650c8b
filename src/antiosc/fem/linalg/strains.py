"""K = SᵀS + rest, from its strains: accurate products and solves for slender beams.

The entries of K of a slender beam are dominated by the shear stiffness; the bending energy is what
remains when these entries cancel. Their rounding ε makes a relative error of up to ε (L/r)² n² of
the bending stiffness (r the radius of gyration, n nodes): 1e-6 at L/r = 900 and 800 nodes, all
digits at 3e5 and 2000. S, whose rows are the strains at the Gauss points times √(stiffness ·
weight), has the square root of K's condition number: Sᵀ(S x) loses ε L/r. The gain is that of QR
over the normal equations in least squares (Golub and Van Loan, *Matrix Computations*, §5.3).

The factor of the rounded K is the preconditioner of conjugate gradients with that product: one or
two steps up to L/r = 3e4, ten if rounding has removed the bending stiffness from the factor.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from petsc4py import PETSc

from antiosc.base._types import Array
from antiosc.base.errors import AccuracyError, NotConvergedError
from antiosc.fem.linalg.algebra import conjugate_gradients, quotient
from antiosc.fem.linalg.petsc_algebra import PRODUCT, multiply
from antiosc.fem.linalg.solver import Solver

#: Error of a solve in the energy norm at which it ends, relative; of a compliance it is the square.
ENERGY = 1e-11
#: Largest error accepted if rounding, or the largest number of steps, ends the solve.
STALLED, MOST_CG_STEPS = 1e-6, 60
#: Share of its own diagonal by which a matrix is made stiffer that rounding keeps from a factor.
RIDGE = 1e-14
#: Largest ‖A‖‖x‖/‖Ax‖: products by strains leave a mechanism about 1e-32 of the stiffest motion.
SOLUTION_GROWTH_BY_STRAINS = 1e24


def attach(K: PETSc.Mat, S: PETSc.Mat, rest: PETSc.Mat) -> None:
    """Make `multiply` compute products with K = SᵀS + rest from the strains."""
    back = PETSc.Mat()
    S.transpose(back)

    def product(x: Array) -> Array:
        return np.asarray(multiply(back, multiply(S, x)) + multiply(rest, x))

    K.setAttr(PRODUCT, product)


class Refined(Solver):
    """Conjugate gradients with A's accurate product, preconditioned by a solver of its entries.

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
        """Entries of the factor; 0 of a solver without one."""
        return float(getattr(self._inner, "entries", 0.0))

    def _set_up(self) -> None:
        try:
            self._inner = self._make(self.A)
        except NotConvergedError:
            stiffer = self.A.copy()
            stiffer.setDiagonal((1 + RIDGE) * self.A.getDiagonal())
            self._inner = self._make(stiffer)

    def solve_block(self, R: Array) -> Array:
        """A⁻¹R for a block of vectors (rows, k).

        Raises AccuracyError where the solver of the entries is too far from A.
        """
        for X, rest, energy in conjugate_gradients(
            R,
            lambda x: multiply(self.A, x),
            self._inner.solve_block,
            self._inner_products,
            MOST_CG_STEPS,
        ):
            if (rest <= ENERGY**2 * energy).all():
                return X
        left = float(np.max(np.sqrt(np.abs(quotient(rest, energy)))))
        if not left <= STALLED:
            raise AccuracyError(
                f"a solve stopped at a relative error of {left:.1e} in energy after "
                f"{MOST_CG_STEPS} steps (limit {STALLED:.0e}): for beams this slender with "
                "elements this short double precision does not resolve the bending stiffness; "
                "use fewer elements, or support loose parts."
            )
        return X

    def force_sizes(self, R: Array) -> Array:
        """√(rᵀA⁻¹r): in the Euclidean norm the rounding of x alone makes A x large."""
        return np.asarray(np.sqrt(np.maximum(self._inner_products(R, self.solve_block(R)), 0.0)))

    def _inner_products(self, x: Array, y: Array) -> Array:
        return np.asarray(self.comm.allreduce(np.einsum("ij,ij->j", x, y)))
