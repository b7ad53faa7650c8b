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

from collections.abc import Callable

import numpy as np

from antiosc._types import Array, ComplexArray
from antiosc.fem.extraction.eigenmodes import Modes, polish
from antiosc.fem.extraction.site_shapes import SiteShapes
from antiosc.fem.linalg.algebra import dot, multiply
from antiosc.fem.structure.structure import Structure
from antiosc.models import driving_point as bands

#: What orthogonalisation leaves of a new direction, relatively, when it adds nothing to the basis.
EXHAUSTED = 1e-10
#: Share of the largest θ below which the smallest θ of an eigensolver are inaccurate.
WIDE = 1e-8
#: Columns by which a basis grows.
BASIS_STEP = 16

#: Bound on ‖Z - Z_N‖₂ [N/m] at complex x = ω² of shape (W,): (W,).
Remainder = Callable[[ComplexArray], Array]


class BlockLanczos:
    """The recurrence of one model. `load` are the next right-hand sides (rows, k), and `advance`
    takes their solutions."""

    def __init__(self, structure: Structure, static: SiteShapes, room: int = BASIS_STEP) -> None:
        self._comm, self._M, self._shift = structure.comm, structure.M, structure.shift
        self._A = structure.factorize().A
        self._static = static
        self._most = structure.dofs - len(static.kept) - static.nodal.shape[1]
        #: basis vectors found, and how many of them T has been applied to
        self.steps, self.applied = 0, -1
        self._H = np.zeros((0, 0))  # VᵀMV, that is T in the basis
        self._c = np.zeros((0, len(static.kept)))  # VᵀMΦ
        #: lengths of what was dropped of TΦ and of TV
        self._dropped = np.zeros(2)
        # V, and F = A V. In front stand the rigid-body modes that do not move the sites, which no
        # step may pick up again.
        rows, self._locked = static.nodal.shape
        self._V = np.empty((rows, self._locked + room), order="F")
        self._F = np.empty_like(self._V)
        if self._locked:
            scale = np.sqrt(self._shift)  # RᵀAR = s
            self._V[:, : self._locked] = static.nodal / scale
            self._F[:, : self._locked] = scale * multiply(self._M, static.nodal)
        self.load = static.m_phi

    @property
    def exhausted(self) -> bool:
        """Whether the basis spans all that the sites see."""
        return self.load.shape[1] == 0

    def advance(self, solutions: Array) -> None:
        """Make the next basis vectors and the next `load` from A⁻¹ load."""
        first, loads = self.steps, self.load
        for w, load in zip(solutions.T, loads.T, strict=True):
            self._add(w, load)
        self.applied = first
        new = self._V[:, self._locked + first : self._locked + self.steps]
        self.load = multiply(self._M, new)
        basis = self._V[:, self._locked : self._locked + self.steps]
        column = dot(self._comm, basis, self.load)
        H = np.zeros((self.steps, self.steps))
        H[:first, :first] = self._H
        H[:, first:], H[first:] = column, column.T
        self._H = (H + H.T) / 2
        self._c = np.vstack([self._c, dot(self._comm, new, self._static.m_phi)])

    def _add(self, w: Array, load: Array) -> None:
        """Orthogonalise w = A⁻¹ load and add it to the basis, or drop it."""
        k = self._locked + self.steps
        V, F = self._V[:, :k], self._F[:, :k]
        w = self._constrained(w)
        before = float(dot(self._comm, w, load))
        w = self._constrained(w - V @ dot(self._comm, F, w))
        # f = A w is computed anew: with an update f and w would diverge by a constant factor in
        # each step.
        f = multiply(self._A, w)
        h = dot(self._comm, V, f)  # twice is enough (Kahan)
        # K has no part in it for a rigid-body mode: its rounding, over s, would be a large one
        h[: self._locked] = dot(self._comm, F[:, : self._locked], w)
        w, f = self._constrained(w - V @ h), f - F @ h
        left = float(dot(self._comm, w, f))
        if self.steps < self._most and left > EXHAUSTED**2 * before:
            self._append(w / np.sqrt(left), f / np.sqrt(left))
        elif self.steps < self._most:  # else rounding produced a direction outside the space
            # at most: it may be all rounding
            self._dropped[int(self.applied >= 0)] += EXHAUSTED * np.sqrt(max(before, 0.0))

    def _append(self, v: Array, f: Array) -> None:
        k = self._locked + self.steps
        if k == self._V.shape[1]:
            self._V, self._F = (
                np.concatenate([x.T, np.empty((BASIS_STEP, len(x)))]).T for x in (self._V, self._F)
            )
        self._V[:, k], self._F[:, k] = v, f
        self.steps += 1

    def release(self) -> None:
        """Release the memory of the basis."""
        self._V = self._F = np.zeros((0, 0))

    def _constrained(self, w: Array) -> Array:
        """w - Y(loadᵀY)⁻¹loadᵀw, which vanishes at the sites."""
        static = self._static
        held = np.linalg.solve(static.bAb, dot(self._comm, static.load, w))
        return np.asarray(w - static.y @ held)

    def _ritz(self, n: int) -> tuple[Array, Array]:
        """Eigenvalues θ = 1/(ω² + s), ω ascending, and eigenvectors of the first n vectors."""
        H = self._H[:n, :n]
        theta, turn = np.linalg.eigh(H)
        if n and 0 < theta[0] < WIDE * theta[-1]:
            poles, x = polish(turn / np.sqrt(theta), lambda x: x.T @ x, lambda x: x.T @ H @ x)
            order = np.argsort(-poles)
            theta, turn = 1 / poles[order], (x / np.sqrt(poles))[:, order]
        return theta[::-1], turn[:, ::-1]

    def parameters(self, n: int) -> tuple[Array, Array, Array]:
        """(M0 (p, p) without cancellation below rounding, P (n, p), ω² (n,)) of the first n."""
        theta, turn = self._ritz(n)
        P = turn.T @ self._c[:n] / np.sqrt(theta)[:, None]
        poles = np.maximum(1 / theta - self._shift, 0.0)
        return bands.semidefinite(self._static.mass - P.T @ P), P, poles

    def observable(self, n: int, tol: float) -> int:
        """How many pairs of the first n vectors have more than the share `tol` in Z."""
        m0, P, poles = self.parameters(n)
        return int(np.sum(bands.shares_at_sites(self._static.k0, m0, P, poles) > tol))

    def modes(self, n: int) -> Modes:
        """The Ritz pairs of the first n vectors; M-orthonormal, and orthogonal through K too."""
        theta, turn = self._ritz(n)
        omega = np.sqrt(np.maximum(1 / theta - self._shift, 0.0))
        basis = self._V[:, self._locked : self._locked + n]
        return Modes(omega, basis @ (turn / np.sqrt(theta)), self.exhausted)

    def remainder(self, n: int) -> Remainder:
        """Bound on ‖Z - Z_N‖₂ of the model of the first n <= `applied` vectors, at complex x."""
        theta, turn = self._ritz(n)
        start, rest, shift = turn.T @ self._c[:n], self._c[n:], self._shift
        following = self._H[n:, :n] @ turn
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
