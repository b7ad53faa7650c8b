"""Damping that couples the modes of a body: matrices of dashpots, branches, first-order modes.

With coordinates x, stiffness K and mass M of the body,

    M x'' + C x' + K x + sum_k G_k (x - z_k) = f,        tau_k z_k' = x - z_k,

where C and G_k are symmetric and positive semidefinite. A branch is a spring G_k in series with a
dashpot tau_k G_k (Maxwell); several in parallel are a Prony series. In s = i omega they add

    s C + sum_k G_k s tau_k/(1 + s tau_k)

to the dynamic stiffness, whose real part is positive semidefinite. The body is therefore passive
(it returns no more energy than it received) after reduction to any coordinates.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array, ArrayLike, ComplexArray
from antiosc.base.errors import InputError
from antiosc.base.texts import ReprMixin

#: Asymmetry and negative eigenvalues, of a unit diagonal, that are rounding.
MATRIX_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class DampingMatrix(ReprMixin):
    """Damping of any strength that couples the modes of a model; it is integrated exactly.

    Parameters
    ----------
    matrix : array_like, shape (n, n)
        C [N s/m], symmetric, positive semidefinite. The coordinates of a model are, in this order:
        the displacement of its site (u (p,) of several sites), the amplitudes of its N constraint
        modes of unit mass, coupled to the site by +sqrt(m_i), and its hidden rigid-body motions.
    branches : sequence of (matrix (n, n), float)
        Stiffness G [N/m], like C, and relaxation time tau > 0 [s] of each Maxwell branch.

    Raises
    ------
    InputError
        Matrices that are not symmetric and positive semidefinite, and would add energy.

    Notes
    -----
    K. Park, W. Schapery, *Int. J. Solids Struct.* 36 (1999) 1653 (Prony series); it is
    integrated in first-order modes (`antiosc.engine.first_order`).
    """

    matrix: Array
    branches: Sequence[tuple[Array, float]] = ()
    factor: Array = field(init=False)  # L (r, n) of C = L'L
    #: (L_k, tau) of each branch, G = L_k'L_k
    factors: tuple[tuple[Array, float], ...] = field(init=False)

    def __post_init__(self) -> None:
        factor = _factor("matrix", self.matrix, None)
        factors = []
        for branch in checks.instance("branches", self.branches, (list, tuple), "a list"):
            if not isinstance(branch, list | tuple) or len(branch) != 2:
                raise InputError(
                    f"branches must list pairs (matrix, tau); got {checks.shown(branch)}."
                )
            branch_factor = _factor("the matrix of a branch", branch[0], factor.shape[1])
            factors.append((branch_factor, checks.positive("tau", branch[1], "s")))

        _store_factors(self, factor, factors)

    def _facts(self) -> list[tuple[str, str]]:
        return [("matrix", f"{self.matrix.shape}"), ("branches", f"{len(self.branches)}")]

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return int(self.factor.shape[1])

    def stiffness(self, omega: ArrayLike) -> ComplexArray:
        """Contribution to the dynamic stiffness at circular frequencies (...) [rad/s]: (..., n, n).

        The harmonic motion is exp(i omega t).
        """
        s = 1j * checks.spectrum("omega", omega)[..., None, None]
        total = s * self.matrix
        for G, tau in self.branches:
            total = total + G * (s * tau / (1 + s * tau))
        return np.asarray(total)

    def as_dict(self) -> dict[str, object]:
        """Arguments of `from_factors` as JSON values, and the number of coordinates."""
        return {
            "n": self.n,
            "factor": self.factor.tolist(),
            "branches": [[L.tolist(), tau] for L, tau in self.factors],
        }


def from_factors(factor: Array, branches: Sequence[tuple[Array, float]] = ()) -> DampingMatrix:
    """Damping with C = L'L, `factor` L (r, n), and Maxwell branches (factor of G, tau)."""
    damping = object.__new__(DampingMatrix)
    _store_factors(damping, factor, branches)
    return damping


def in_coordinates(damping: DampingMatrix, T: Array) -> DampingMatrix:
    """The damping in new coordinates y (m,); the old coordinates are T y, with T (n, m)."""
    return from_factors(damping.factor @ T, [(L @ T, tau) for L, tau in damping.factors])


def _store_factors(
    damping: DampingMatrix, factor: Array, branches: Sequence[tuple[Array, float]]
) -> None:
    checks.store(
        damping,
        factor=factor,
        factors=tuple(branches),
        matrix=checks.read_only(factor.T @ factor),
        branches=tuple((checks.read_only(L.T @ L), tau) for L, tau in branches),
    )


def _factor(name: str, matrix: object, size: int | None) -> Array:
    """L (r, n) with L'L = matrix; InputError unless this is symmetric and semidefinite."""
    checked_matrix = checks.floats(name, matrix, (size, size))
    if checked_matrix.shape[0] != checked_matrix.shape[1]:
        raise InputError(f"{name} must be square; got shape {checked_matrix.shape}.")

    scale = np.sqrt(np.maximum(checked_matrix.diagonal(), 0.0))
    unit, uneven = checks.scaled_symmetric(checked_matrix, scale)
    values, vectors = np.linalg.eigh(unit)
    smallest = float(values.min(initial=0.0))
    if (
        uneven > MATRIX_ROUNDING
        or smallest < -MATRIX_ROUNDING
        or np.any(checked_matrix[scale == 0])
    ):
        raise InputError(
            f"{name} must be symmetric and positive semidefinite, as dashpots and springs make it;"
            f" its least eigenvalue is {smallest:.2g} of its diagonal: it would add energy."
        )

    is_positive = values > 1e-15 * len(values)
    return np.asarray((vectors[:, is_positive] * np.sqrt(values[is_positive])).T * scale)
