"""Damping that couples the modes of a body: a matrix of dashpots, and branches that relax.

With coordinates x, stiffness K and mass M of the body,

    M x'' + C x' + K x + sum_k G_k (x - z_k) = f,        tau_k z_k' = x - z_k,

C and G_k symmetric and positive semidefinite: a branch is a spring G_k in series with a dashpot
tau_k G_k (Maxwell), several in parallel are a Prony series. In s = i omega they add

    s C + sum_k G_k s tau_k/(1 + s tau_k)

to the dynamic stiffness, whose real part on every x is >= 0: the body gives back no more than it
was given, whatever coordinates it is reduced to.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base import checks
from antiosc.base._types import Array, ComplexArray
from antiosc.base.errors import InputError
from antiosc.base.texts import Brief

#: Asymmetry and negative eigenvalues, of a unit diagonal, that are rounding.
ROUNDING = 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class DampingMatrix(Brief):
    """Damping that couples the modes of a model, exact in the march however strong it is.

    Parameters
    ----------
    matrix : array_like, shape (n, n)
        C [N s/m], symmetric, positive semidefinite. In a model of one site the coordinates are
        the displacement of the site, the amplitudes of the N constraint modes of unit mass (of
        positive inertia sqrt(m_i) against the site), then the hidden rigid-body motions; of
        several sites the displacements u (p,) in place of the first.
    branches : sequence of (matrix (n, n), float)
        Stiffness G [N/m], like C, and relaxation time tau > 0 [s] of each Maxwell branch.

    Raises
    ------
    InputError
        For matrices that are not symmetric and positive semidefinite, which add energy.

    Notes
    -----
    K. Park, W. Schapery, *Int. J. Solids Struct.* 36 (1999) 1653 (Prony series); the march solves
    it in first-order modes (`antiosc.models.first_order`).
    """

    matrix: Array
    branches: Sequence[tuple[Array, float]] = ()
    factor: Array = field(init=False)
    factors: tuple[tuple[Array, float], ...] = field(init=False)

    def __post_init__(self) -> None:
        factor = _factor("matrix", self.matrix, None)
        found = []
        for branch in checks.instance("branches", self.branches, (list, tuple), "a list"):
            if not isinstance(branch, list | tuple) or len(branch) != 2:
                raise InputError(
                    f"branches must list pairs (matrix, tau); got {checks.shown(branch)}."
                )
            own = _factor("the matrix of a branch", branch[0], factor.shape[1])
            found.append((own, checks.positive("tau", branch[1], "s")))
        _keep(self, factor, found)

    def _facts(self) -> list[tuple[str, str]]:
        return [("matrix", f"{self.matrix.shape}"), ("branches", f"{len(self.branches)}")]

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return int(self.factor.shape[1])

    def stiffness(self, omega: ArrayLike) -> ComplexArray:
        """What it adds to the dynamic stiffness at circular frequencies (...) [rad/s]: (..., n, n).

        The harmonic motion is exp(i omega t).
        """
        s = 1j * checks.spectrum("omega", omega)[..., None, None]
        total = s * self.matrix
        for G, tau in self.branches:
            total = total + G * (s * tau / (1 + s * tau))
        return np.asarray(total)

    def as_dict(self) -> dict[str, object]:
        """Arguments of `of_factors` as JSON values, and the number of coordinates."""
        return {
            "n": self.n,
            "factor": self.factor.tolist(),
            "branches": [[L.tolist(), tau] for L, tau in self.factors],
        }


def of_factors(factor: Array, branches: Sequence[tuple[Array, float]] = ()) -> DampingMatrix:
    """C = factor' factor, factor (r, n), and the branches likewise: semidefinite as it is."""
    found = object.__new__(DampingMatrix)
    _keep(found, factor, branches)
    return found


def along(damping: DampingMatrix, turn: Array) -> DampingMatrix:
    """The same damping in the coordinates y of x = turn y, turn (n, m)."""
    return of_factors(damping.factor @ turn, [(L @ turn, tau) for L, tau in damping.factors])


def _keep(of: DampingMatrix, factor: Array, branches: Sequence[tuple[Array, float]]) -> None:
    checks.store(
        of,
        factor=factor,
        factors=tuple(branches),
        matrix=checks.kept(factor.T @ factor),
        branches=tuple((checks.kept(L.T @ L), tau) for L, tau in branches),
    )


def _factor(name: str, matrix: object, size: int | None) -> Array:
    """L (r, n) of matrix = L'L; InputError for what is not symmetric and semidefinite."""
    found = checks.array(name, matrix, (size, size))
    if found.shape[0] != found.shape[1]:
        raise InputError(f"{name} must be square; got shape {found.shape}.")
    scale = np.sqrt(np.maximum(found.diagonal(), 0.0))
    unit = found / np.where(scale > 0, scale, 1.0)[:, None] / np.where(scale > 0, scale, 1.0)
    values, vectors = np.linalg.eigh((unit + unit.T) / 2)
    least = float(values.min(initial=0.0))
    uneven = float(np.abs(unit - unit.T).max(initial=0.0))
    if uneven > ROUNDING or least < -ROUNDING or np.any(found[scale == 0]):
        raise InputError(
            f"{name} must be symmetric and positive semidefinite, as dashpots and springs make it;"
            f" its least eigenvalue is {least:.2g} of its diagonal: it would add energy."
        )
    real = values > 1e-15 * len(values)
    return np.asarray((vectors[:, real] * np.sqrt(values[real])).T * scale)
