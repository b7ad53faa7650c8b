"""Krylov anti-oscillators: N solves for N anti-oscillators, and the most accurate Z(ω) for them.

The Lanczos recurrence for the constrained operator T = A⁻¹M - y yᵀM/(bᵀy), A = K + sM, y = A⁻¹b,
starts at T φ_st and runs in the inner product of A, in which T is symmetric. Its Ritz pairs are
those of (K, M) on the space {T φ_st, …, Tᴺφ_st}: a Galerkin model, so every m_i is positive and
Σm_i ≤ m_st. With z = ω² + s,

    Z = k0 - ω² m_st - ω⁴ g,    g = φ_stᵀM (I - zT)⁻¹T φ_st = Σ_j z^j φ_stᵀM T^(j+1) φ_st,

and N steps match the first 2N of these moments (Gauss quadrature of g: Golub and Meurant,
*Matrices, Moments and Quadrature*, 2010, ch. 6). An unobservable mode is orthogonal to the start
vector: only rounding may introduce it, without mass. The highest Ritz pairs represent the mass of
all higher modes.

The truncation error of N steps is a quadratic form of the next basis vector v, g - g_N = q² vᵀA(I -
zT)⁻¹v with q = z β_N e_Nᵀ(I - zH)⁻¹e_1 ‖Tφ_st‖. As vᵀAv = 1 and T has real positive eigenvalues
only, |g - g_N| ≤ |q|²/|sin arg z|: a bound at every damped frequency, at no cost.

The shift s is 0 if K is regular. A shift inside the band (s < 0) would save at most a fifth of the
steps (bracket of 21 300 dofs, 16 antiresonances in the band: 26 to 31 steps against 32 for 1e-3),
but requires a second, indefinite factorization, whose solves are slower.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence

import numpy as np

from antiosc._types import Array, ComplexArray
from antiosc.fem.extraction.eigenmodes import Modes
from antiosc.fem.extraction.ritz_basis import BASIS_STEP, Remainder, RitzBasis
from antiosc.fem.extraction.static_mode import StaticMode
from antiosc.fem.structure.structure import Structure
from antiosc.models import driving_point as bands
from antiosc.progress import doing

#: The largest number of steps is STEPS_PER_ONE times the number of anti-oscillators wanted, plus
#: MORE: some pairs may have no share in Z (at a site of symmetry rounding introduces as many
#: again).
STEPS_PER_ONE, MORE = 3, 20

log = logging.getLogger(__name__)


class Lanczos:
    """The recurrence of one site, held by `static`. `load` is the next right-hand side, and
    `advance` takes its solution."""

    def __init__(self, structure: Structure, static: StaticMode, room: int = BASIS_STEP) -> None:
        self._shift, self._static = structure.shift, static
        self._basis = RitzBasis(structure, static, room)
        #: β_N: norm of the next vector; known one solve after the last vector
        self.beta: float | None = None
        self.exhausted = False
        self._norm = 0.0  # ‖Tφ_st‖, the length of the first vector
        self.load = static.m_phi

    @property
    def steps(self) -> int:
        """Number of basis vectors."""
        return self._basis.steps

    def advance(self, w: Array) -> None:
        """Make the next basis vector and the next `load` from w = A⁻¹ load."""
        first = not self.steps
        added, length = self._basis.add(w, self.load)
        if first:
            self._norm = length
        else:
            self.beta = length
        self.exhausted = not added
        if added:
            self.load = self._basis.project()[:, 0]

    def release(self) -> None:
        """Release the memory of the basis."""
        self._basis.release()

    def shares(self, n: int) -> Array:
        """Shares in Z of the pairs of the first n steps."""
        theta, _ = self._basis.resolved(n)
        m = self.masses(n)
        left = max(self._static.mass - float(m.sum()), 0.0)
        return bands.shares(self._static.k0, left, m, np.maximum(1 / theta - self._shift, 0.0))

    def masses(self, n: int) -> Array:
        """m_i of the first n steps, kg."""
        theta, turn = self._basis.resolved(n)
        return np.asarray((self._norm * turn[0]) ** 2 / theta)

    def modes(self, n: int) -> Modes:
        """The Ritz pairs of the first n steps; M-orthonormal, and orthogonal through K too."""
        return self._basis.modes(n, self.exhausted)

    def remainder(self, n: int) -> Remainder:
        """Bound on |Z - Z_N| of the model of n steps, at complex x = ω².

        n is `steps` or one less: the next step must have been computed.
        """
        theta, _ = self._basis.ritz(n)
        beta = np.append(self._basis.H.diagonal(-1), self.beta or 0.0)[:n]
        # the factors of det(I - zH) beside those of e_Nᵀ adj(I - zH) e_1: nothing cancels
        norm, shift = self._norm, self._shift

        def bound(x: ComplexArray) -> Array:
            z = x + shift
            q = np.full(len(x), norm)
            for b, t in zip(beta, theta, strict=True):
                q *= np.abs(z * b / (1 - z * t))
            return np.asarray(np.abs(x * q) ** 2 * np.abs(z) / z.imag)

        return bound

    def error(self, n: int, band: float) -> float:
        """Bound on |Z - Z_N|/|Z_N| of the model of n steps over the band up to `band` [rad/s]."""
        theta, _ = self._basis.resolved(n)
        poles, m = 1 / theta - self._shift, self.masses(n)
        k0, mass = self._static.k0, self._static.mass
        m, poles = m[poles > 0], poles[poles > 0]
        x = bands.samples(band, bands.lowest_frequency(k0, mass, np.sqrt(poles))) ** 2
        Z = bands.driving_point(x, k0, max(mass - float(m.sum()), 0.0), m, poles)
        return float(np.max(self.remainder(n)(x) / np.abs(Z)))


def by_krylov(
    structure: Structure,
    statics: Sequence[StaticMode],
    counts: Sequence[int],
    tol: float,
    band: float | None,
    accuracy: float,
) -> list[tuple[Modes, Remainder | None]]:
    """(Ritz pairs, with a band the bound of their truncation error) of each site, all sites
    together.

    Without a band there are as many pairs as `counts` says with more than the share `tol` in Z,
    if the structure has so many and the largest number of steps finds them. With a band, it is the
    smallest number for which the error of Z is at most `accuracy`, and at most `counts`. Each step
    solves one block of right-hand sides.
    """
    runs = [
        Lanczos(structure, static, n + 1 if band is None else BASIS_STEP)
        for static, n in zip(statics, counts, strict=True)
    ]
    done: dict[int, tuple[Modes, Remainder | None]] = {}
    if band is None:
        done = {i: (run.modes(0), None) for i, run in enumerate(runs) if counts[i] == 0}
    with doing("extracting anti-oscillators", structure.comm.rank) as further:
        step = 0
        while len(done) < len(runs):
            step += 1
            further(f"step {step}, about {max(counts)}; {len(done)} of {len(runs)} sites done")
            active = [i for i in range(len(runs)) if i not in done]
            loads = np.column_stack([runs[i].load for i in active])
            shapes = structure.factorize().solve_block(loads)
            for i, w in zip(active, shapes.T, strict=True):
                runs[i].advance(w)
                kept = _finished(runs[i], counts[i], tol, band, accuracy)
                if kept is not None:
                    done[i] = runs[i].modes(kept), None if band is None else runs[i].remainder(kept)
                    runs[i].release()
            log.debug("Krylov step: %d of %d sites done", len(done), len(runs))
    return [done[i] for i in range(len(runs))]


def _finished(run: Lanczos, n: int, tol: float, band: float | None, accuracy: float) -> int | None:
    """How many steps to keep, or None to continue."""
    if run.exhausted:
        return run.steps
    if band is None:
        wanting = run.steps < n or np.sum(run.shares(run.steps) > tol) < n
        return None if wanting and run.steps < STEPS_PER_ONE * n + MORE else run.steps
    tried = run.steps - 1  # the truncation error of this number of steps is known only now
    return tried if tried == n or (tried and run.error(tried, band) <= accuracy) else None
