"""Krylov anti-oscillators: one solve for each, and the best Z(ω) that N solves can give.

The Lanczos recurrence for the constrained operator T = A⁻¹M - y yᵀM/(bᵀy), A = K + sM, y = A⁻¹b,
starts at T φ_st and runs in the inner product of A, in which T is symmetric. Its Ritz pairs are
those of (K, M) on the space {T φ_st, …, Tᴺφ_st}: a Galerkin model, so every m_i is positive and
Σm_i ≤ m_st. With z = ω² + s,

    Z = k0 - ω² m_st - ω⁴ g,    g = φ_stᵀM (I - zT)⁻¹T φ_st = Σ_j z^j φ_stᵀM T^(j+1) φ_st,

and N steps match the first 2N of these moments (Gauss quadrature of g: Golub and Meurant,
*Matrices, Moments and Quadrature*, 2010, ch. 6). A mode that the site cannot see is orthogonal to
the start: rounding alone may let it in, without mass. The highest Ritz pairs stand for all the
mass above.

What N steps leave out is a quadratic form of the next basis vector v, g - g_N = q² vᵀA(I - zT)⁻¹v
with q = z β_N e_Nᵀ(I - zH)⁻¹e_1 ‖Tφ_st‖. As vᵀAv = 1 and T has real positive eigenvalues only,
|g - g_N| ≤ |q|²/|sin arg z|: a bound at every damped frequency, at no cost.

The shift s is 0 where K is regular. One inside the band (s < 0) would save a fifth of the steps at
most (bracket of 21 300 dofs, 16 antiresonances in the band: 26 to 31 steps against 32 for 1e-3),
but takes a second factorization, and an indefinite one, whose solves cost more.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence

import numpy as np

from antiosc import band as bands
from antiosc.fem.algebra import Array, dot, multiply
from antiosc.fem.modes import Modes
from antiosc.fem.site import Functional
from antiosc.fem.static import StaticMode
from antiosc.fem.structure import Structure

#: What orthogonalisation leaves of a new direction, relatively, when the space is exhausted.
EXHAUSTED = 1e-10
#: Columns by which a basis grows.
CHUNK = 16

log = logging.getLogger(__name__)


class Lanczos:
    """The recurrence of one site. `load` asks for a solve, `advance` takes its result."""

    def __init__(
        self, structure: Structure, site: Functional, static: StaticMode, room: int = CHUNK
    ) -> None:
        self._comm, self._M, self._shift = structure.comm, structure.M, structure.shift
        self._A = structure.factorization.A
        self._b, self._static = site.b, static
        #: basis vectors found
        self.steps = 0
        #: β_N: how far T leads out of the space; known one solve after its last vector
        self.beta: float | None = None
        self.exhausted = False
        self._norm = 0.0  # ‖Tφ_st‖, the length of the first vector
        self._H = np.zeros((0, 0))  # VᵀMV, that is T in the basis
        # V, and F = A V. In front stand the rigid-body modes that vanish at the site, which no
        # step may pick up again.
        rows, self._locked = static.still.shape
        self._V = np.empty((rows, self._locked + room), order="F")
        self._F = np.empty_like(self._V)
        if self._locked:
            scale = np.sqrt(self._shift)  # RᵀAR = s
            self._V[:, : self._locked] = static.still / scale
            self._F[:, : self._locked] = scale * multiply(self._M, static.still)
        self.load = static.m_phi

    def advance(self, w: Array) -> None:
        """Take w = A⁻¹ load as the next basis vector and make the next load of it."""
        k = self._locked + self.steps
        V, F = self._V[:, :k], self._F[:, :k]
        w = self._pinned(w)
        before = float(dot(self._comm, w, self.load))
        w = self._pinned(w - V @ dot(self._comm, F, w))
        # f = A w afresh: carried along, f and w would part by a constant factor each step.
        f = multiply(self._A, w)
        h = dot(self._comm, V, f)  # twice is enough (Kahan)
        w, f = self._pinned(w - V @ h), f - F @ h
        left = float(dot(self._comm, w, f))
        self.exhausted = not left > EXHAUSTED**2 * before
        beta = 0.0 if self.exhausted else float(np.sqrt(left))
        if self.steps:
            self.beta = beta
        else:
            self._norm = beta
        if not self.exhausted:
            self._append(w / beta, f / beta)

    def _append(self, v: Array, f: Array) -> None:
        k = self._locked + self.steps
        if k == self._V.shape[1]:
            self._V, self._F = (
                np.concatenate([x.T, np.empty((CHUNK, len(x)))]).T for x in (self._V, self._F)
            )
        self._V[:, k], self._F[:, k] = v, f
        m_v = multiply(self._M, v)
        column = dot(self._comm, self._V[:, self._locked : k + 1], m_v)
        H = np.zeros((self.steps + 1, self.steps + 1))
        H[:-1, :-1] = self._H
        H[:, -1] = H[-1, :] = column
        self._H, self.load = H, m_v
        self.steps += 1

    def release(self) -> None:
        """Let go of the basis."""
        self._V = self._F = np.zeros((0, 0))

    def _pinned(self, w: Array) -> Array:
        """w - y (bᵀw)/(bᵀy), which vanishes at the site."""
        return np.asarray(w - self._static.y * (dot(self._comm, self._b, w) / self._static.bAb))

    def _ritz(self, n: int) -> tuple[Array, Array]:
        """Eigenvalues θ = 1/(ω² + s), ω ascending, and eigenvectors of the first n steps."""
        theta, turn = np.linalg.eigh(self._H[:n, :n])
        return theta[::-1], turn[:, ::-1]

    def masses(self, n: int) -> Array:
        """m_i of the first n steps, kg."""
        theta, turn = self._ritz(n)
        return np.asarray((self._norm * turn[0]) ** 2 / theta)

    def modes(self, n: int) -> Modes:
        """The Ritz pairs of the first n steps; M-orthonormal, and orthogonal through K too."""
        theta, turn = self._ritz(n)
        omega = np.sqrt(np.maximum(1 / theta - self._shift, 0.0))
        basis = self._V[:, self._locked : self._locked + n]
        return Modes(omega, basis @ (turn / np.sqrt(theta)), self.exhausted)

    def bound(self, n: int, band: float) -> float:
        """Bound on |Z - Z_N|/|Z_N| of the model of n steps over the band up to `band` [rad/s].

        n is `steps`, or one less: the step after must have been tried.
        """
        beta = self.beta if n == self.steps else float(self._H[n, n - 1])
        assert beta is not None
        theta, turn = self._ritz(n)
        poles = np.maximum(1 / theta - self._shift, 0.0)
        m = self.masses(n)
        static = self._static
        lowest = bands.lowest_frequency(static.k0, static.mass, np.sqrt(poles))
        x = bands.samples(band, lowest)[:, None] ** 2
        z = x + self._shift
        stiffness = static.k0 - x[:, 0] * static.mass - np.sum(m * x**2 / (poles - x), axis=1)
        last = np.sum(self._norm * turn[0] * turn[-1] / (1 - z * theta), axis=1)
        left = np.abs(x * z * beta * last[:, None])[:, 0] ** 2
        left = left * np.abs(z[:, 0]) / z[:, 0].imag
        return float(np.max(left / np.abs(stiffness)))


def by_krylov(
    structure: Structure,
    sites: Sequence[Functional],
    statics: Sequence[StaticMode],
    n: int,
    unseen: float,
    band: float | None,
    accuracy: float,
) -> list[tuple[Modes, float | None]]:
    """(Ritz pairs, error bound of Z over the band) of each site; the sites advance together.

    Without a band there are n pairs with more than the share `unseen` of the static mass, if the
    structure has so many. With one, there are as few as make the bound at most `accuracy`, and at
    most n. One block of right-hand sides per step.
    """
    runs = [
        Lanczos(structure, site, static, n + 1 if band is None else CHUNK)
        for site, static in zip(sites, statics, strict=True)
    ]
    done: dict[int, tuple[Modes, float | None]] = {}
    if n == 0:
        return [(run.modes(0), None) for run in runs]
    while len(done) < len(runs):
        active = [i for i in range(len(runs)) if i not in done]
        shapes = structure.factorization.solve_block(
            np.column_stack([runs[i].load for i in active])
        )
        for i, w in zip(active, shapes.T, strict=True):
            runs[i].advance(w)
            kept, error = _finished(runs[i], n, unseen * statics[i].mass, band, accuracy)
            if kept is not None:
                done[i] = (runs[i].modes(kept), error)
                runs[i].release()
        log.debug("Krylov step: %d of %d sites done", len(done), len(runs))
    return [done[i] for i in range(len(runs))]


def _finished(
    run: Lanczos, n: int, massless: float, band: float | None, accuracy: float
) -> tuple[int | None, float | None]:
    """(steps to keep, or None to go on; bound of the error over the band)."""
    if run.exhausted:
        return run.steps, None if band is None else 0.0
    if band is None:
        enough = run.steps >= n and np.sum(run.masses(run.steps) > massless) >= n
        return (run.steps if enough else None), None
    tried = run.steps - 1
    if tried == 0:
        return None, None
    error = run.bound(tried, band)
    return (tried, error) if error <= accuracy or tried == n else (None, error)
