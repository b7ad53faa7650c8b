"""Factors of symmetric positive definite SciPy matrices: CHOLMOD by scikit-sparse, or SuperLU."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np
import scipy.sparse.linalg

from antiosc._types import Array
from antiosc.errors import NotConvergedError
from antiosc.fem.linalg.solver import SINGULAR, Factorization

try:
    cholmod: Any = import_module("sksparse.cholmod")
except ImportError:  # optional: SuperLU serves without it
    cholmod = None


def factorize(A: Any) -> Factorization:
    """The factor of A by CHOLMOD where scikit-sparse is installed, otherwise by SuperLU."""
    return SuperLU(A) if cholmod is None else Cholmod(A)


class SuperLU(Factorization):
    """A factor P A Pᵀ = L D Lᵀ by SuperLU with pivots on the diagonal.

    The ordering is symmetric, so the signs of D are those of A's eigenvalues (Sylvester): a matrix
    that is not positive definite has a pivot that is not positive, or one off the diagonal.
    """

    def _set_up(self) -> None:
        try:
            self._lu = scipy.sparse.linalg.splu(
                self.A.tocsc(),
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=0.0,
                options={"SymmetricMode": True, "Equil": False},
            )
        except RuntimeError as error:  # an empty column of what is left
            raise NotConvergedError(SINGULAR.format(f"SuperLU: {error}")) from error
        if not np.array_equal(self._lu.perm_r, self._lu.perm_c):
            raise NotConvergedError(SINGULAR.format("a pivot is zero"))
        pivots = self._lu.U.diagonal()
        if not (pivots > 0).all():
            at = int(np.flatnonzero(~(pivots > 0))[0])
            raise NotConvergedError(
                SINGULAR.format(f"pivot {at + 1} of {len(pivots)} is {pivots[at]:.1e}")
            )

    @property
    def entries(self) -> float:
        """Entries of L and U."""
        return float(self._lu.nnz)

    def solve_block(self, R: Array) -> Array:
        """A⁻¹R for a block of vectors (rows, k)."""
        return np.asarray(self._lu.solve(np.asfortranarray(R)))


class Cholmod(Factorization):
    """A Cholesky factor by CHOLMOD, called by scikit-sparse (0.4, or 0.5 with other names)."""

    def _set_up(self) -> None:
        A = self.A.tocsc()
        try:
            if hasattr(cholmod, "cho_factor"):
                self._factor = cholmod.cho_factor(A)
                self._solve = self._factor.solve
            else:  # a supernodal factor is L Lᵀ, which an indefinite matrix does not have
                self._factor = cholmod.cholesky(A, mode="supernodal")
                self._solve = self._factor.solve_A
        except cholmod.CholmodNotPositiveDefiniteError as error:
            raise NotConvergedError(SINGULAR.format(error)) from error

    @property
    def entries(self) -> float:
        """Entries of the factor."""
        L = self._factor.L
        return float((L() if callable(L) else L).nnz)

    def solve_block(self, R: Array) -> Array:
        """A⁻¹R for a block of vectors (rows, k)."""
        return np.asarray(self._solve(np.asfortranarray(R)))
