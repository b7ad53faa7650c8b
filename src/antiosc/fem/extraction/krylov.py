"""Krylov anti-oscillators: N solves for N anti-oscillators, and the most accurate Z(ω) for them.

With the shapes Φ of unit displacements at p ≥ 1 sites (`site_shapes`), A = K + sM and the operator
T = A⁻¹M - Y(loadᵀY)⁻¹YᵀM under the constraint that all sites are held, the block Lanczos recurrence
starts at TΦ and runs in the inner product of A, in which T is symmetric. Its Ritz pairs are those
of (K, M) on the space {TΦ, …, TᴺΦ}: a Galerkin model, so every m_i is positive semidefinite and
Σm_i ≤ M_st. With z = ω² + s,

    Z = K0 - ω²M_st - ω⁴G,    G = ΦᵀM (I - zT)⁻¹TΦ = Σ_j z^j ΦᵀM T^(j+1) Φ,

and N steps match the first 2N of these moments (Gauss quadrature of G: Golub and Meurant,
*Matrices, Moments and Quadrature*, 2010, ch. 6). An unobservable mode is orthogonal to the start
block: only rounding may introduce it, without mass. The highest Ritz pairs represent the mass of
all higher modes. Directions that the block does not add to the basis are dropped, so that its width
falls.

What the first n basis vectors V leave out is the residual Q = TΦ - (I - zT)VX of the Galerkin
solution X,

    G - G_N = QᵀA(I - zT)⁻¹Q,    ‖Z - Z_N‖₂ ≤ |ω|⁴ ‖Q‖²/|sin arg z|,

since T has real eigenvalues ≥ 0: a bound at every damped frequency. Q needs the products TV, which
are known one block later.

The shift s is 0 if K is regular. A shift inside the band (s < 0) would save at most a fifth of the
steps (bracket of 21 300 dofs, 16 antiresonances in the band: 26 to 31 steps against 32 for 1e-3),
but requires a second, indefinite factorization, whose solves are slower.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence

import numpy as np

from antiosc.base._types import Array, ComplexArray
from antiosc.base.progress import doing
from antiosc.fem.extraction.dampers import Reached, band_error
from antiosc.fem.extraction.eigenmodes import Modes
from antiosc.fem.extraction.ritz_basis import BASIS_STEP, Remainder, RitzBasis
from antiosc.fem.extraction.site_shapes import SiteShapes
from antiosc.fem.linalg.algebra import dot, multiply
from antiosc.fem.structure.matrices import Dissipation, ends
from antiosc.fem.structure.structure import Structure
from antiosc.models import driving_point

#: The largest number of steps is STEPS_PER_ONE times the number of anti-oscillators wanted, plus
#: MORE: some pairs may have no share in Z (at a site of symmetry rounding introduces as many
#: again).
STEPS_PER_ONE, MORE = 3, 20

log = logging.getLogger(__name__)


class Lanczos:
    """The recurrence of one model of p >= 1 sites.

    `load` are the next right-hand sides (rows, k), and `advance` takes their solutions.
    """

    def __init__(
        self,
        structure: Structure,
        static: SiteShapes,
        room: int = BASIS_STEP,
        terms: Sequence[Dissipation] = (),
    ) -> None:
        self._structure, self._terms = structure, terms
        self._comm, self._shift, self._static = structure.comm, structure.shift, static
        self._basis = RitzBasis(structure, static, room)
        #: how many of the basis vectors T has been applied to
        self.applied = -1
        self._c = np.zeros((0, len(static.kept)))  # VᵀMΦ
        #: lengths of what was dropped of TΦ and of TV
        self._dropped = np.zeros(2)
        self.load = static.m_phi
        #: how many of the loads are inertia, the others those of damping
        self._inertial = static.m_phi.shape[1]
        forces = ends(terms)
        if forces is not None:
            self.load = np.hstack([self.load, forces])

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
        for i, (w, load) in enumerate(zip(solutions.T, self.load.T, strict=True)):
            size = float(dot(self._comm, w, load)) if i >= self._inertial else 0.0
            added, length = self._basis.add(w, load, size)
            if not added:
                self._dropped[int(self.applied >= 0)] += length
        self.applied = first
        self.load = self._basis.project()
        new = self._basis.vectors[:, first:]
        relaxing = [multiply(one.matrix, new) for one in self._terms if one.matrix is not None]
        self._inertial = self.load.shape[1]
        self.load = np.hstack([self.load, *relaxing])
        self._c = np.vstack([self._c, dot(self._comm, new, self._static.m_phi)])

    def parameters(self, n: int) -> tuple[Array, Array, Array]:
        """(M0 (p, p) without cancellation below rounding, P (n, p), ω² (n,)) of the first n."""
        theta, turn = self._basis.resolved(n)
        P = turn.T @ self._c[:n] / np.sqrt(theta)[:, None]
        poles = np.maximum(1 / theta - self._shift, 0.0)
        return driving_point.semidefinite(self._static.mass - P.T @ P), P, poles

    def observable(self, n: int, tol: float) -> int:
        """How many pairs of the first n vectors have more than the share `tol` in Z."""
        m0, P, poles = self.parameters(n)
        return int(np.sum(driving_point.shares_at_sites(self._static.k0, m0, P, poles) > tol))

    def release(self) -> None:
        """Release the memory of the basis."""
        self._basis.release()

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
            Q = driving_point.spectral_norms(rest + z[:, None, None] * (following @ X))
            Q += none + beside * np.abs(z) * np.linalg.norm(X, axis=(1, 2))
            return np.asarray(np.abs(x * Q) ** 2 * np.abs(z) / z.imag)

        return bound

    def damped_error(self, n: int, band: float) -> Reached:
        """The bound on the error of the receptance with damping (`dampers.band_error`)."""
        return band_error(self._structure, self._static, self._basis, self._c, n, band, self._terms)

    def error(self, n: int, band: float) -> float:
        """Bound on ‖ΔZ‖₂‖Z_N⁻¹‖₂ of the model of n vectors over the band up to `band` [rad/s]."""
        m0, P, poles = self.parameters(n)
        k0 = self._static.k0
        P, poles = P[poles > 0], poles[poles > 0]
        lowest = driving_point.lowest_frequency_at_sites(k0, self._static.mass, poles)
        x = driving_point.samples(band, lowest) ** 2
        Z = driving_point.stiffness_at_sites(x, k0, m0, P, poles)
        inverse = driving_point.spectral_norms(np.linalg.inv(Z))
        return float(np.max(self.remainder(n)(x) * inverse))


def by_krylov(
    structure: Structure,
    statics: Sequence[SiteShapes],
    counts: Sequence[int],
    tol: float,
    band: float | None,
    accuracy: float,
    terms: Sequence[Dissipation] = (),
) -> list[tuple[Modes, Remainder | Reached | None]]:
    """(Ritz pairs, with a band the bound of their truncation error) of each model.

    Without a band there are as many pairs as `counts` says with more than the share `tol` in Z,
    if the structure has so many and the largest number of steps finds them. With a band, it is the
    least number of blocks for which the error of Z is at most `accuracy`, and at most `counts`.
    Each step solves one block of right-hand sides.
    """
    runs = [
        Lanczos(structure, static, n + len(static.kept) if band is None else BASIS_STEP, terms)
        for static, n in zip(statics, counts, strict=True)
    ]
    done: dict[int, tuple[Modes, Remainder | Reached | None]] = {}
    if band is None:
        done = {i: (run.modes(0), None) for i, run in enumerate(runs) if counts[i] == 0}
    with doing("extracting anti-oscillators", structure.comm.rank) as further:
        step = 0
        while len(done) < len(runs):
            step += 1
            further(f"step {step}, about {max(counts)}; {len(done)} of {len(runs)} models done")
            active = [i for i in range(len(runs)) if i not in done]
            loads = [runs[i].load for i in active]
            shapes = structure.factorize().solve_block(np.hstack(loads))
            ends = np.cumsum([load.shape[1] for load in loads])
            for i, own in zip(active, np.split(shapes, ends[:-1], axis=1), strict=True):
                before = runs[i].steps
                runs[i].advance(own)
                bound: Remainder | Reached | None = None
                if terms:
                    kept, bound = _enough(runs[i], counts[i], band, accuracy)
                else:
                    kept = _finished(runs[i], before, counts[i], tol, band, accuracy)
                    bound = None if band is None or kept is None else runs[i].remainder(kept)
                if kept is not None:
                    done[i] = runs[i].modes(kept), bound
                    runs[i].release()
            log.debug("Krylov step: %d of %d models done", len(done), len(runs))
    return [done[i] for i in range(len(runs))]


def _enough(
    run: Lanczos, n: int, band: float | None, accuracy: float
) -> tuple[int | None, Reached | None]:
    """How many vectors of a damped model to keep, or None to continue, and their bound."""
    if band is None:
        return (min(n, run.steps) if run.steps >= n or run.exhausted else None), None
    tried = min(run.steps if run.exhausted else run.applied, n)
    if not tried:
        return None, None
    found = run.damped_error(tried, band)
    enough = tried == n or run.exhausted or found.error <= accuracy
    return (tried if enough else None), found


def _finished(
    run: Lanczos, before: int, n: int, tol: float, band: float | None, accuracy: float
) -> int | None:
    """How many vectors to keep, or None to continue; the last block added those after `before`."""
    if band is not None:
        tried = min(run.applied, n)  # the truncation error of these is known only now
        enough = tried == n or run.exhausted
        return tried if enough or (tried and run.error(tried, band) <= accuracy) else None
    for count in range(max(before + 1, n), run.steps + 1):
        if run.observable(count, tol) >= n:
            return count
    return run.steps if run.exhausted or run.steps >= STEPS_PER_ONE * n + MORE else None
