"""Krylov anti-oscillators of p sites: the block Lanczos recurrence of the constrained operator.

With the shapes Φ of unit displacements at the sites (`site_shapes`), A = K + sM and the operator
T = A⁻¹M - Y(loadᵀY)⁻¹YᵀM under the constraint that all sites are held, the recurrence starts at the
block TΦ and runs in the inner product of A, in which T is symmetric. Its Ritz pairs are those of
(K, M) on the space {TΦ, …, TᴺΦ}. With z = ω² + s,

    Z = K0 - ω²M_st - ω⁴G,    G = ΦᵀM (I - zT)⁻¹TΦ.

Directions that the block does not add to the basis are dropped, so that its width falls. What the
first n basis vectors V leave out is the residual Q = TΦ - (I - zT)VX of the Galerkin solution X,

    G - G_N = QᵀA(I - zT)⁻¹Q,    ‖Z - Z_N‖₂ ≤ |ω|⁴ ‖Q‖²/|sin arg z|,

since T has real eigenvalues ≥ 0: a bound at every damped frequency. Q needs the products TV, which
are known one block later.
"""

from __future__ import annotations

import numpy as np

from antiosc._types import Array, ComplexArray
from antiosc.fem.extraction.eigenmodes import Modes
from antiosc.fem.extraction.ritz_basis import BASIS_STEP, Remainder, RitzBasis
from antiosc.fem.extraction.site_shapes import SiteShapes
from antiosc.fem.linalg.algebra import dot
from antiosc.fem.structure.structure import Structure
from antiosc.models import driving_point as bands


class BlockLanczos:
    """The recurrence of one model. `load` are the next right-hand sides (rows, k), and `advance`
    takes their solutions."""

    def __init__(self, structure: Structure, static: SiteShapes, room: int = BASIS_STEP) -> None:
        self._comm, self._shift, self._static = structure.comm, structure.shift, static
        self._basis = RitzBasis(structure, static, room)
        #: how many of the basis vectors T has been applied to
        self.applied = -1
        self._c = np.zeros((0, len(static.kept)))  # VᵀMΦ
        #: lengths of what was dropped of TΦ and of TV
        self._dropped = np.zeros(2)
        self.load = static.m_phi

    @property
    def steps(self) -> int:
        """Number of basis vectors."""
        return self._basis.steps

    @property
    def exhausted(self) -> bool:
        """Whether the basis spans all that the sites see."""
        return self.load.shape[1] == 0

    def advance(self, solutions: Array) -> None:
        """Make the next basis vectors and the next `load` from A⁻¹ load."""
        first = self.steps
        for w, load in zip(solutions.T, self.load.T, strict=True):
            added, length = self._basis.add(w, load)
            if not added:
                self._dropped[int(self.applied >= 0)] += length
        self.applied = first
        self.load = self._basis.project()
        new = self._basis.vectors[:, first:]
        self._c = np.vstack([self._c, dot(self._comm, new, self._static.m_phi)])

    def parameters(self, n: int) -> tuple[Array, Array, Array]:
        """(M0 (p, p) without cancellation below rounding, P (n, p), ω² (n,)) of the first n."""
        theta, turn = self._basis.resolved(n)
        P = turn.T @ self._c[:n] / np.sqrt(theta)[:, None]
        poles = np.maximum(1 / theta - self._shift, 0.0)
        return bands.semidefinite(self._static.mass - P.T @ P), P, poles

    def observable(self, n: int, tol: float) -> int:
        """How many pairs of the first n vectors have more than the share `tol` in Z."""
        m0, P, poles = self.parameters(n)
        return int(np.sum(bands.shares_at_sites(self._static.k0, m0, P, poles) > tol))

    def modes(self, n: int) -> Modes:
        """The Ritz pairs of the first n vectors; M-orthonormal, and orthogonal through K too."""
        return self._basis.modes(n, self.exhausted)

    def remainder(self, n: int) -> Remainder:
        """Bound on ‖Z - Z_N‖₂ of the model of the first n <= `applied` vectors, at complex x."""
        theta, turn = self._basis.ritz(n)
        start, rest, shift = turn.T @ self._c[:n], self._c[n:], self._shift
        following = self._basis.H[n:, :n] @ turn
        none, beside = self._dropped

        def bound(x: ComplexArray) -> Array:
            z = x + shift
            X = start / (1 - z[:, None] * theta)[:, :, None]
            Q = bands.spectral_norms(rest + z[:, None, None] * (following @ X))
            Q += none + beside * np.abs(z) * np.linalg.norm(X, axis=(1, 2))
            return np.asarray(np.abs(x * Q) ** 2 * np.abs(z) / z.imag)

        return bound

    def error(self, n: int, band: float) -> float:
        """Bound on ‖ΔZ‖₂‖Z_N⁻¹‖₂ of the model of n vectors over the band up to `band` [rad/s]."""
        m0, P, poles = self.parameters(n)
        k0 = self._static.k0
        P, poles = P[poles > 0], poles[poles > 0]
        lowest = bands.lowest_frequency_at_sites(k0, self._static.mass, poles)
        x = bands.samples(band, lowest) ** 2
        Z = bands.stiffness_at_sites(x, k0, m0, P, poles)
        inverse = bands.spectral_norms(np.linalg.inv(Z))
        return float(np.max(self.remainder(n)(x) * inverse))
