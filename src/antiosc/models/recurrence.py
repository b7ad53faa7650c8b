"""The recurrence of a Krylov model, which bounds the motion that the model leaves out.

Let Φ be the shapes of unit displacements at the sites, and V the vectors of the block Lanczos
recurrence, which vanish at the sites, with VᵀAV = 1, A = K + sM. The displacement Φu + Va of the
Galerkin model leaves a residual load in the structure with a fixed pattern and the amplitude f,

    BF - Mü - Ku = -A W f,    f = WᵀMV (a'' - s a),    BᵀW = 0,

where W are the next vectors of the recurrence, one for a model of one site.

With C = αM + τK + 2ζM(M⁻¹K)^(1/2), the modes of the model have the decay ζω_j + α/2 + τω_j²/2. With
modal forces b_j F and c_j = q_j + τq_j', f = Σ r_j (b_j F - (ω_j² + s) c_j). The damping ratio ζ
leaves another load 2ζMΣ((M⁻¹K)^(1/2) - ω_j) ψ_j q_j', where ψ_j is the shape of mode j, with

    ‖((M⁻¹K)^(1/2) - ω_j) ψ_j‖_M ≤ |r_j| (ω_j² + s) max(1, √s/ω_j).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.base.texts import FieldsRepr
from antiosc.models.modal import Damping

#: Entries beside the three diagonals of VᵀMV, over its own, from which the recurrence broke down.
COUPLING_ROUNDING = 1e-9
#: Stiffness of a motion of the sites, over the largest, below which it is a rigid-body motion.
RIGID_STIFFNESS = 1e-9


def _damping_ratio(damping: Damping) -> float:
    """The damping ratio, which is the same for all modes."""
    return float(np.max(damping.ratio))


@dataclass(frozen=True, eq=False, repr=False)
class ReferenceModes:
    """Free modes of unit mass of a Galerkin model, and residual loads A W f of the model.

    p: number of sites; W: next Krylov vectors, A-orthonormal, A = K + sM; f (k,): amplitudes.
    """

    omega: Array  # (J,) [rad/s]; rigid-body modes are the first ones, with 0
    b: Array  # (J, p) displacements of the sites
    residual: Array  # (k, J) f of each mode over (d²/dt² - s) q, where (W f)ᵀA(W f) = |f|²
    inertia: Array  # WᵀMW (k, k)
    shift: float  # s [rad²/s²]

    def _factors(self, square: Array, by: dict[int, Array | float]) -> Array:
        """Factors (k, 5, J) as in `drive`: square^(1/2) `residual` times `by[i]` at (:, i, :)."""
        x, U = np.linalg.eigh(square)
        root = (U * np.sqrt(np.maximum(x, 0.0))) @ U.T
        weights = root @ self.residual
        rows = np.zeros((len(weights), 5, self.omega.size))
        for place, values in by.items():
            rows[:, place] = weights * values
        return rows

    @property
    def _stiffness(self) -> Array:
        """WᵀKW (k, k)."""
        return np.eye(len(self.inertia)) - self.shift * self.inertia

    def drive(self, damping: Damping, lag: Array) -> Array:
        """Factors (k, 5, J) of q, q', the modal force and its first and second rate in the residual
        load M^(1/2) W (f'' + αf' - sf + …) of the motion W f. `lag` (J,): q'' = force - ω²q -
        2 decay q' - lag (ω²q' - rate of the force)."""
        s, stiff = self.shift, self.omega**2 + self.shift
        by_v = damping.beta * stiff + 2 * _damping_ratio(damping) * self.omega + lag * self.omega**2
        by: dict[int, Array | float] = {
            0: stiff**2,
            1: stiff * by_v,
            2: -stiff - s,
            3: damping.alpha - stiff * lag,
            4: 1.0,
        }
        return self._factors(self.inertia, by)

    def losses(self, damping: Damping) -> Array:
        """Factors (2k, 5, J), as in `drive`, of terms whose squares bound the power of damping."""
        stiff = self.omega**2 + self.shift

        # |f|² of √(M K) is at most half of those of M/e + eK
        balance = np.sqrt(np.trace(self.inertia) / max(np.trace(self._stiffness), 1e-300))
        both = (self.inertia / balance + self._stiffness * balance) / 2
        by_stiffness = self._factors(damping.beta / 4 * self._stiffness, {3: 1.0})
        by_ratio = self._factors(_damping_ratio(damping) / 2 * both, {1: -stiff, 3: 1.0})
        return np.concatenate([by_stiffness, by_ratio])

    def brake(self, damping: Damping) -> Array:
        """Bounds (J,) on the residual load of the damping ratio ζ, per unit rate of each mode."""
        far = np.sqrt(self.shift) / np.where(self.omega > 0, self.omega, np.inf)
        stiff = self.omega**2 + self.shift
        own = np.linalg.norm(self.residual, axis=0) * stiff * np.maximum(far, 1.0)
        return 2 * _damping_ratio(damping) * own

    def receptance(self, x: Array, b: Array) -> Array:
        """Upper bounds (n,) [m/N] of bᵀ(K + xM)⁻¹b at x (n,) > 0 [rad²/s²]; b (J,) in the modes."""
        share = b / (self.omega**2 + x[:, None])
        left_out = ((self.shift - x)[:, None] * (share @ self.residual.T)) ** 2
        return share @ b + left_out.sum(axis=1) * np.maximum(self.shift / x, 1.0)


@dataclass(frozen=True, eq=False, repr=False)
class Recurrence(FieldsRepr):
    """Block Lanczos recurrence of a Krylov model, which bounds the motion that it leaves out.

    Φ: shapes of unit displacements at p sites; V: N Krylov vectors, A-orthonormal, A = K + sM.
    """

    #: k0, mass: ΦᵀKΦ [N/m] and ΦᵀMΦ [kg], (p, p)
    k0: Array
    mass: Array
    start: Array  # (N, p) VᵀMΦ
    H: Array  # (N, N) VᵀMV, the next vectors last
    n: int  # largest number of vectors of a model whose residual is known
    shift: float  # s [rad²/s²]

    def __post_init__(self) -> None:
        size, sites = checks.floats("start", self.start, (None, None)).shape
        checks.floats("H", self.H, (size, size))
        for name in ("k0", "mass"):
            checks.floats(name, getattr(self, name), (sites, sites))
        if not 0 < self.n < size or self.H.diagonal().min() < 0 or self.shift < 0:
            raise InputError("the recurrence of a model needs two vectors or more, of masses >= 0.")

    @property
    def scalars(self) -> Array:
        """n and shift as an array (2,), for files."""
        return np.array([self.n, self.shift])

    def modes(self, n: int) -> ReferenceModes:
        """Free modes of the model of the first n vectors, 1 <= n <= `self.n`."""
        s, c, p = self.shift, self.start[:n], len(self.k0)
        M = np.block([[self.mass, c.T], [c, self.H[:n, :n]]])
        A = np.block([[self.k0 + s * self.mass, s * c.T], [s * c, np.eye(n)]])

        from scipy.linalg import eigh, null_space  # takes long to load

        # rigid-body motions first, and what is orthogonal to them in M
        stiffness, moved = np.linalg.eigh(self.k0)
        free = stiffness <= RIGID_STIFFNESS * stiffness.max()
        rigid = np.vstack([moved[:, free], np.zeros((n, free.sum()))])
        Z = null_space((M @ rigid).T) if rigid.size else np.eye(p + n)
        theta, X = eigh(Z.T @ M @ Z, Z.T @ A @ Z)
        order = np.argsort(-theta)
        mass, turned = np.linalg.eigh(rigid.T @ M @ rigid)
        unit_mass = [rigid @ (turned / np.sqrt(mass)), (Z @ X / np.sqrt(theta))[:, order]]
        shapes = np.column_stack(unit_mass)
        omega = np.append(np.zeros(rigid.shape[1]), np.sqrt(1 / theta[order] - s))

        beyond = slice(n, n + 2 * p - 1)
        residual = self.H[beyond, :n] @ shapes[p:] + self.start[beyond] @ shapes[:p]
        return ReferenceModes(omega, shapes[:p].T, residual, self.H[beyond, beyond], s)


def recurrence_of(
    k0: Array,
    mass: Array,
    start: Array,
    H: Array,
    ends: Sequence[int],
    shift: float,
    dropped: float | None,
) -> Recurrence | None:
    """The recurrence with start = VᵀMΦ and H = VᵀMV, up to the last block that couples only with
    its neighbours; None with fewer than two such blocks. `ends`: number of vectors up to the end
    of each block; `dropped`: norm of the next vector if it was dropped as rounding, else None."""
    size_of = np.sqrt(np.maximum(H.diagonal(), 0.0))  # of V; the next lines by Cauchy and Schwarz
    beside = np.abs(H / size_of.max())
    for first, last in zip((0, *ends), (*ends[1:], len(H)), strict=False):
        beside[first:last, first:last] = 0.0

    far = np.triu(beside).max(axis=0, initial=0.0)
    loads = np.abs(start) / np.sqrt(mass.diagonal())
    far[ends[0] :] = np.maximum(far[ends[0] :], loads[ends[0] :].max(axis=1))
    broken = np.append(np.flatnonzero(far > COUPLING_ROUNDING * size_of), len(H))[0]

    known = [end for end in ends if end <= broken]
    if dropped is not None and known[-1:] == [len(H)]:
        from scipy.linalg import block_diag

        largest = np.linalg.eigvalsh(H)[-1]
        H = block_diag(H, largest)
        H[-1, -2] = H[-2, -1] = dropped
        known.append(len(H))
        start = np.vstack([start, np.zeros_like(k0)])

    if len(known) < 2:
        return None

    size = known[-1]
    return Recurrence(k0, mass, start[:size], H[:size, :size], known[-2], shift)
