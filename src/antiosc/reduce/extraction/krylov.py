"""Krylov anti-oscillators: N solves for N anti-oscillators, and the most accurate Z(ω) for them.

With the shapes Φ of unit displacements at p ≥ 1 sites (`site_shapes`), A = K + sM, Y = A⁻¹load for
the loads at the sites, and T = A⁻¹M - Y(loadᵀY)⁻¹YᵀM, which keeps all sites fixed, the block
Lanczos recurrence starts at TΦ and runs in the inner product of A, in which T is symmetric. Its
Ritz pairs are those of (K, M) on the space {TΦ, …, TᴺΦ}: a Galerkin model, so every m_i is positive
semidefinite and Σm_i ≤ M_st. With z = ω² + s, K0 = ΦᵀKΦ and M_st = ΦᵀMΦ,

    Z = K0 - ω²M_st - ω⁴S,    S = ΦᵀM (I - zT)⁻¹TΦ = Σ_j z^j ΦᵀM T^(j+1) Φ,

and N steps match the first 2N of these moments (Gauss quadrature of S: Golub and Meurant,
*Matrices, Moments and Quadrature*, 2010, ch. 6). An unobservable mode is orthogonal to the start
block: only rounding may introduce it, without mass. The highest Ritz pairs represent the mass of
all higher modes. Directions that add nothing to the basis are dropped.

The error of the first n basis vectors V follows from the residual Q = TΦ - (I - zT)VX of the
Galerkin solution X,

    S - S_N = QᵀA(I - zT)⁻¹Q,    ‖Z - Z_N‖₂ ≤ |ω|⁴ ‖Q‖²/|sin arg z|,

since T has real eigenvalues ≥ 0: a bound at every damped frequency. Q needs the products TV, which
are known one block later.

The shift s is 0 if K is regular, or the square of a real expansion point, about which the response
converges first; Φ stays static, so that K0 and M_st are exact, and every m_i is positive
semidefinite as before. An impact on a large thin plate ends before its waves return: on a plate of
0.5 × 0.33 m × 1 mm, struck by a ball for 41 µs, 60 and 150 anti-oscillators have 120 and 36 % of
error of the peak force with s = 0, 2.5 and 0.2 % with √s = 2π · 16 kHz (measured). A shift inside
the band (s < 0) would save a fifth of the steps at most, by slower, indefinite solves.

With dampers, the shapes V span the Krylov space of A⁻¹M that starts from A⁻¹[MΦ, Gᵀ], where Gᵀ are
the dampers' force patterns; A⁻¹C leads into the same space. A relaxing layer adds A⁻¹CV of each
block. K, M and C are all projected on V: VᵀCV is semidefinite for every number of shapes, so that
every model is passive.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from antiosc.base._types import Array, ComplexArray
from antiosc.base.progress import doing
from antiosc.fem.linalg.algebra import dot, multiply
from antiosc.fem.structure import Dissipation, dashpot_patterns
from antiosc.fem.structure.structure import Structure
from antiosc.models.free_modes import EXHAUSTED_NORM, sample_frequencies
from antiosc.models.recurrence import COUPLING_ROUNDING, recurrence_of
from antiosc.reduce.extraction import SiteShapes
from antiosc.reduce.extraction.eigenmodes import Modes, polish
from antiosc.reduce.extraction.model import (
    Remainder,
    lowest_frequency_at_sites,
    semidefinite,
    shares_at_sites,
    spectral_norms,
    stiffness_at_sites,
)

#: Share of the largest θ below which the smallest θ of an eigensolver are inaccurate.
INACCURATE_THETA = 1e-8
#: θ over the largest below which it is rounding.
ROUNDED_THETA = 1e-18
#: Columns by which a basis grows.
BASIS_STEP = 16

#: Largest number of steps over anti-oscillators wanted: at symmetric sites half have no share in Z.
STEPS_PER_MODE = 3
#: Steps in addition to this number.
EXTRA_STEPS = 20


class Lanczos:
    """Block Lanczos recurrence, A = K + sM: vectors V that vanish at p ≥ 1 sites, VᵀAV = 1, H =
    VᵀMV. `load` (rows, k): next right-hand sides; `applied`: number of vectors with known A⁻¹MV."""

    def __init__(
        self,
        structure: Structure,
        static: SiteShapes,
        room: int = BASIS_STEP,
        terms: Sequence[Dissipation] = (),
    ) -> None:
        self._static = static
        self._terms = terms
        self._comm = structure.comm
        self._M = structure.M
        self._shift = static.shift
        self._solver = static.solver
        self._A = self._solver.A
        rows, self._locked = static.nodal.shape
        self._most = structure.dofs - static.load.shape[1] - self._locked
        self.steps = 0
        self.H = np.zeros((0, 0))
        self.applied = -1

        # V. In front stand the rigid-body modes that do not move the sites, which no step may pick
        # up again, and A times these.
        self._V = np.empty((rows, self._locked + room), order="F")
        self._forces = np.empty((rows, self._locked))
        if self._locked:
            scale = np.sqrt(self._shift)  # RᵀAR = s
            self._V[:, : self._locked] = static.nodal / scale
            self._forces = scale * multiply(self._M, static.nodal)
        self._c = np.zeros((0, len(static.kept)))  # VᵀMΦ
        self._ends: list[int] = []  # numbers of vectors with those of each block

        #: bounds on the norms of the parts of TΦ and of TV that were dropped or that solves missed
        self._dropped = np.zeros(2)
        self.load = static.m_phi

        #: number of loads that are inertia forces; the other loads are damping forces
        self._inertial = static.m_phi.shape[1]
        forces = dashpot_patterns(terms)
        if forces is not None:
            self.load = np.hstack([self.load, forces])

    @property
    def vectors(self) -> Array:
        """V (rows of this rank, steps)."""
        return self._V[:, self._locked : self._locked + self.steps]

    def _add(self, w: Array, load: Array, size: float) -> float:
        """Orthogonalise w = A⁻¹ load and add it to the basis (returns 0), or drop it if nothing is
        left of its energy (returns a bound on its length); `size`: least scale of energies."""
        k = self._locked + self.steps
        V = self._V[:, :k]
        w = self._held_at_sites(w)
        load_energy = max(float(dot(self._comm, w, load)), size)

        # VᵀAw = Vᵀ load but for the solver's error: V does not feel the forces that hold the sites
        w = self._held_at_sites(w - V @ dot(self._comm, V, load))
        f = multiply(self._A, w)
        h = dot(self._comm, V, f)  # twice is enough (Kahan)

        # K has no part in it for a rigid-body mode: its rounding, over s, would be a large one
        h[: self._locked] = dot(self._comm, self._forces, w)
        w = self._held_at_sites(w - V @ h)
        energy = float(dot(self._comm, w, f))
        if self.steps == self._most:  # rounding may produce directions outside the space
            return 0.0
        if not energy > EXHAUSTED_NORM**2 * load_energy:
            return EXHAUSTED_NORM * float(np.sqrt(max(load_energy, 0.0)))
        if k == self._V.shape[1]:
            self._V = np.concatenate([self._V.T, np.empty((BASIS_STEP, len(w)))]).T
        self._V[:, k] = w / np.sqrt(energy)
        self.steps += 1
        return 0.0

    def _held_at_sites(self, w: Array) -> Array:
        """w (rows,) plus the response to the forces that keep the sites at rest."""
        return self._static.constrained(self._comm, w)

    def ritz(self, n: int) -> tuple[Array, Array]:
        """(Ritz values θ = 1/(ω² + s) descending, eigenvectors) on n vectors; tiny θ become 0."""
        H = self.H[:n, :n]
        theta, eigenvectors = np.linalg.eigh(H)
        noise = int(np.sum(theta <= ROUNDED_THETA * theta[-1])) if n else 0
        resolved = theta[noise:]
        vectors = eigenvectors[:, noise:]

        if len(resolved) and resolved[0] < INACCURATE_THETA * resolved[-1]:
            poles, x = polish(vectors / np.sqrt(resolved), lambda x: x.T @ x, lambda x: x.T @ H @ x)
            order = np.argsort(-poles)
            resolved = 1 / poles[order]
            vectors = (x / np.sqrt(poles))[:, order]

        theta = np.concatenate([np.zeros(noise), resolved])
        return theta[::-1], np.column_stack([eigenvectors[:, :noise], vectors])[:, ::-1]

    def resolved(self, n: int) -> tuple[Array, Array]:
        """The Ritz pairs (`ritz`) with positive θ."""
        theta, eigenvectors = self.ritz(n)
        return theta[theta > 0], eigenvectors[:, theta > 0]

    def modes(self, n: int) -> Modes:
        """Ritz pairs of the first n vectors as modes, M-orthonormal and K-orthogonal."""
        theta, eigenvectors = self.resolved(n)
        omega = np.sqrt(np.maximum(1 / theta - self._shift, 0.0))
        return Modes(omega, self.vectors[:, :n] @ (eigenvectors / np.sqrt(theta)), self.exhausted)

    @property
    def exhausted(self) -> bool:
        """Whether the vectors span all motions that forces at the sites excite."""
        return self.load.shape[1] == 0

    def advance(self, solutions: Array) -> None:
        """Compute the next vectors and the next `load` from `solutions` = A⁻¹ load."""
        first = self.steps
        for i, (w, load) in enumerate(zip(solutions.T, self.load.T, strict=True)):
            energy = float(dot(self._comm, w, load))
            dropped_norm = self._solver.error * np.sqrt(max(energy, 0.0))
            size = energy if i >= self._inertial else 0.0
            self._dropped[int(self.applied >= 0)] += dropped_norm + self._add(w, load, size)
        self.applied = first
        if self.steps > first:
            self._ends.append(self.steps)

        new = self.vectors[:, first:]
        self.load = multiply(self._M, new)
        column = dot(self._comm, self.vectors, self.load)
        H = np.block([[self.H, column[:first]], [column.T]])
        self.H = (H + H.T) / 2
        relaxing = [multiply(term.matrix, new) for term in self._terms if term.matrix is not None]
        self._inertial = self.load.shape[1]
        self.load = np.hstack([self.load, *relaxing])
        self._c = np.vstack([self._c, dot(self._comm, new, self._static.m_phi)])

    def parameters(self, n: int) -> tuple[Array, Array, Array]:
        """(M0 (p, p), P (n, p), ω² (n,)) of the model of the first n vectors."""
        theta, eigenvectors = self.resolved(n)
        P = eigenvectors.T @ self._c[:n] / np.sqrt(theta)[:, None]
        poles = np.maximum(1 / theta - self._shift, 0.0)
        return semidefinite(self._static.mass - P.T @ P), P, poles

    def observable(self, n: int, tol: float) -> int:
        """Number of Ritz pairs of the first n vectors whose share in Z is above `tol`."""
        m0, P, poles = self.parameters(n)
        return int(np.sum(shares_at_sites(self._static.k0, m0, P, poles) > tol))

    def with_recurrence(self, modes: Modes) -> Modes:
        """The modes with their `Recurrence`, from one more step; without it if solves are inexact,
        dampers exist, an omitted rigid mode moves a site, or several sites exhaust the space."""
        static, solver = self._static, self._solver
        omitted = np.abs(static.missed * np.sqrt(static.mass.diagonal())).max(initial=0.0)
        if solver.error > COUPLING_ROUNDING or self._terms or omitted > COUPLING_ROUNDING:
            return modes
        if not self.exhausted:
            self.advance(solver.solve_block(self.load))
        elif len(static.k0) > 1:
            return modes

        W = static.W
        k0, mass, start = W @ static.k0 @ W.T, W @ static.mass @ W.T, self._c @ W.T
        dropped = float(self._dropped.sum()) if self.exhausted else None
        recurrence = recurrence_of(k0, mass, start, self.H, self._ends, self._shift, dropped)
        return replace(modes, recurrence=recurrence)

    def remainder(self, n: int) -> Remainder:
        """Function that bounds ‖Z - Z_N‖₂ at complex x = ω², for n <= `applied` vectors."""
        theta, eigenvectors = self.ritz(n)
        start = eigenvectors.T @ self._c[:n]
        truncated = self._c[n:]
        shift = self._shift
        coupling = self.H[n:, :n] @ eigenvectors
        zero_rows, dropped_norms = self._dropped

        def bound(x: ComplexArray) -> Array:
            z = x + shift
            X = start / (1 - z[:, None] * theta)[:, :, None]
            Q = spectral_norms(truncated + z[:, None, None] * (coupling @ X))
            Q += zero_rows + dropped_norms * np.abs(z) * np.linalg.norm(X, axis=(1, 2))
            return np.asarray(np.abs(x * Q) ** 2 * np.abs(z) / z.imag)

        return bound

    def error(self, n: int, band: float) -> float:
        """Bound on ‖ΔZ‖₂‖Z_N⁻¹‖₂ of the model of n vectors, for ω up to `band` [rad/s]."""
        m0, P, poles = self.parameters(n)
        k0 = self._static.k0
        P = P[poles > 0]
        poles = poles[poles > 0]
        lowest = lowest_frequency_at_sites(k0, self._static.mass, poles)
        x = sample_frequencies(band, lowest) ** 2
        Z = stiffness_at_sites(x, k0, m0, P, poles)
        inverse = spectral_norms(np.linalg.inv(Z))
        return float(np.max(self.remainder(n)(x) * inverse))


def by_krylov(
    structure: Structure,
    static: SiteShapes,
    n: int,
    tol: float,
    band: float | None,
    accuracy: float,
    terms: Sequence[Dissipation] = (),
    proof: bool = False,
) -> tuple[Modes, Remainder | None]:
    """(modes, bound on their truncation error or None without a band): `n` modes with shares above
    `tol` in Z, or with a `band` [rad/s] the fewest blocks that reach the `accuracy`. With `proof`
    the modes have their recurrence."""
    # room for a few more than are wanted: the system gives memory only to what is written
    run = Lanczos(structure, static, (n if band is None else 0) + BASIS_STEP, terms)
    count = 0 if band is None and n == 0 else None

    with doing("extracting anti-oscillators") as report:
        step = 0
        while count is None:
            step += 1
            report(f"step {step}" + f", about {n}" * (step <= n))
            before = run.steps
            run.advance(static.solver.solve_block(run.load))
            count = _kept_count(run, before, n, tol, band, accuracy, bool(terms))

    bound = None if band is None else run.remainder(count)
    modes = run.modes(count)
    return run.with_recurrence(modes) if proof else modes, bound


def _kept_count(
    run: Lanczos, before: int, n: int, tol: float, band: float | None, accuracy: float, damped: bool
) -> int | None:
    """Number of vectors to keep, None to continue; `before`: number before the last block."""
    if damped:  # also vectors that move dampers but no site
        return min(n, run.steps) if run.steps >= n or run.exhausted else None

    if band is not None:
        bounded = min(run.applied, n)  # the truncation error of these is known only now
        sufficient = bounded == n or run.exhausted
        if sufficient or (bounded and run.error(bounded, band) <= accuracy):
            return bounded
        return None

    for count in range(max(before + 1, n), run.steps + 1):
        if run.observable(count, tol) >= n:
            return count
    if run.exhausted or run.steps >= STEPS_PER_MODE * n + EXTRA_STEPS:
        return run.steps
    return None
