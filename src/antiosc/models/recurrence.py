"""The recurrence of a Krylov model, by which the motion that the model leaves out is bounded.

With the shape Φ of a unit displacement at the site and vectors V of the Lanczos recurrence, which
vanish there, VᵀAV = 1, A = K + sM, the displacement Φu + Va of the Galerkin model leaves one fixed
residual in the structure,

    bF - Mü - Ku = -A w f,    f = β (a_n'' - s a_n),    bᵀw = 0,

where w is the next vector of the recurrence, β its last coefficient and a_n the last amplitude.

With C = αM + τK + 2ζM(M⁻¹K)^(1/2), the modes of the model have the decay ζω_j + α/2 + τω_j²/2. Of
the modal forces b_j F and c_j = q_j + τq_j', f = Σ r_j (b_j F - (ω_j² + s) c_j), and ζ leaves
2ζMΣ((M⁻¹K)^(1/2) - ω_j) ψ_j q_j' besides, ψ_j the mode's shape, with

    ‖((M⁻¹K)^(1/2) - ω_j) ψ_j‖_M ≤ |r_j| (ω_j² + s) max(1, √s/ω_j).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.base.texts import FieldsRepr
from antiosc.models.modal import Damping

#: Entries beside the three diagonals of VᵀMV, over its own, from which the recurrence broke down.
BROKEN = 1e-9


def _ratio(damping: Damping) -> float:
    """The one damping ratio of all modes."""
    return float(np.max(damping.ratio))


@dataclass(frozen=True, eq=False)
class ReferenceModes:
    """The free modes of a Galerkin model, of unit mass, and their residual.

    Attributes
    ----------
    omega : (J,) [rad/s]; a rigid-body mode is the first one, with 0.
    b : (J,) displacements of the site.
    residual : (J,) f of each mode over (d²/dt² - s) q, where (w f)ᵀA(w f) = f².
    inertia : wᵀMw.
    shift : s [rad²/s²].
    """

    omega: Array
    b: Array
    residual: Array
    inertia: float
    shift: float

    def drive(self, damping: Damping) -> Array:
        """‖w‖_M (f'' + αf' - sf + ...) of each mode by q, v, the modal force, two rates, (5, J)."""
        s, stiff = self.shift, self.omega**2 + self.shift
        by_v = stiff * (damping.beta * stiff + 2 * _ratio(damping) * self.omega)
        one = np.ones_like(stiff)
        rows = stiff**2, by_v, -stiff - s, damping.alpha * one, one
        return np.sqrt(self.inertia) * self.residual * np.array(rows)

    def losses(self, damping: Damping) -> Array:
        """The roots of the energies that the damping of the lift gives, by the same, (2, 5, J)."""
        stiff = self.omega**2 + self.shift
        stiffness = max(1 - self.shift * self.inertia, 0.0)  # wᵀKw
        rows = np.zeros((2, 5, stiff.size))
        rows[0, 3] = np.sqrt(damping.beta * stiffness) / 2
        size = np.sqrt(_ratio(damping) / 2) * (self.inertia * stiffness) ** 0.25
        rows[1, 1], rows[1, 3] = -size * stiff, size
        return self.residual * rows

    def brake(self, damping: Damping) -> Array:
        """Bounds on what ζ leaves of each mode's rate in the structure, (J,)."""
        far = np.sqrt(self.shift) / np.where(self.omega > 0, self.omega, np.inf)
        own = abs(self.residual) * (self.omega**2 + self.shift) * np.maximum(far, 1.0)
        return 2 * _ratio(damping) * own

    def receptance(self, x: Array) -> Array:
        """Upper bounds [m/N] of bᵀ(K + xM)⁻¹b at x > 0 [rad²/s²], (n,)."""
        share = self.b / (self.omega**2 + x[:, None])
        left_out = (self.shift - x) * (share @ self.residual)
        return share @ self.b + left_out**2 * np.maximum(self.shift / x, 1.0)


@dataclass(frozen=True, eq=False)
class Recurrence(FieldsRepr):
    """What the Krylov space of one site says of the structure, beside the anti-oscillators.

    Attributes
    ----------
    k0, mass : ΦᵀKΦ [N/m] and ΦᵀMΦ [kg].
    diagonal : (n + 1,) of VᵀMV, the next vector last.
    coupling : (n + 1,) v₁ᵀMΦ, then v₍ᵢ₊₁₎ᵀMvᵢ.
    shift : s [rad²/s²].
    """

    k0: float
    mass: float
    diagonal: Array
    coupling: Array
    shift: float

    def __post_init__(self) -> None:
        size = checks.floats("diagonal", self.diagonal, (None,)).size
        checks.floats("coupling", self.coupling, (size,))
        if size < 2 or self.diagonal.min() < 0 or min(self.k0, self.mass, self.shift) < 0:
            raise InputError("the recurrence of a model needs two vectors or more, of masses >= 0.")

    @property
    def scalars(self) -> Array:
        """k0, mass and shift."""
        return np.array([self.k0, self.mass, self.shift])

    @property
    def n(self) -> int:
        """Largest number of vectors of a model whose residual is known."""
        return len(self.diagonal) - 1

    def modes(self, n: int) -> ReferenceModes:
        """The model of the first n vectors, 1 <= n <= `n`."""
        s = self.shift
        H = np.diag(self.diagonal[:n])
        H += np.diag(self.coupling[1:n], 1) + np.diag(self.coupling[1:n], -1)
        c = np.zeros(n)
        c[0] = self.coupling[0]

        if self.k0 == 0:  # Φ is a rigid-body motion, M-orthogonal to the elastic modes
            own = np.outer(c, c) / self.mass
            theta, X = scipy.linalg.eigh(H - own, np.eye(n) - s * own)
            X = X / np.sqrt(theta)
            a = np.column_stack([np.zeros(n), X])
            b = np.append(1 / np.sqrt(self.mass), -(c @ X) / self.mass)
            omega = np.append(0.0, np.sqrt(1 / theta - s))
        else:
            M = np.block([[self.mass, c], [c[:, None], H]])
            A = np.block([[self.k0 + s * self.mass, s * c], [s * c[:, None], np.eye(n)]])
            theta, X = scipy.linalg.eigh(M, A)
            b, *a = X / np.sqrt(theta)
            omega = np.sqrt(1 / theta - s)

        last = np.asarray(a)[-1]
        order = np.argsort(omega)
        residual = self.coupling[n] * last
        return ReferenceModes(
            omega[order], b[order], residual[order], float(self.diagonal[n]), self.shift
        )


def recurrence_of(
    k0: float, mass: float, start: Array, H: Array, shift: float, dropped: float | None
) -> Recurrence | None:
    """The recurrence with start = VᵀMΦ and H = VᵀMV, up to where it breaks down; None: at once.

    In exact arithmetic H is tridiagonal, and Φ couples with the first vector alone. `dropped`:
    length of the next vector, where the space has no further one but for rounding.
    """
    size_of = np.sqrt(np.maximum(H.diagonal(), 0.0))  # of V; the next lines by Cauchy and Schwarz
    beside = np.abs(np.triu(H, 2)).max(axis=0, initial=0.0) / size_of.max()
    beside[1:] = np.maximum(beside[1:], abs(start[1:]) / np.sqrt(mass))
    broken = np.flatnonzero(beside > BROKEN * size_of)
    size = int(broken[0]) if broken.size else len(H)
    diagonal = H.diagonal()[:size]
    coupling = np.append(start[0], np.diagonal(H, 1))[:size]

    if dropped is not None and not broken.size:
        diagonal = np.append(diagonal, np.linalg.eigvalsh(H)[-1])
        coupling = np.append(coupling, dropped)

    if len(diagonal) < 2:
        return None
    return Recurrence(k0, mass, diagonal, coupling, shift)
