"""Anti-oscillators from constraint modes, and a bound on the error of Z.

The error of Z at every damped frequency of a band is the sum of the truncation error of the method
(`Remainder`), of the unobservable modes that were dropped and the repeated ones that were merged,
of the limited number of anti-oscillators, and of rounding. The latter is the effect of a relative
change ε of every entry of K and M on Z, |φ|ᵀ(|K| + |x||M|)|φ| ε with the shape φ(x) of the
structure at that frequency, estimated with the diagonals of K and M.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from antiosc._types import Array, ComplexArray, Numbers
from antiosc.fem.extraction.eigenmodes import Modes
from antiosc.fem.extraction.ritz_basis import Remainder, mass_above
from antiosc.fem.extraction.static_mode import StaticMode
from antiosc.fem.linalg.algebra import by_strains, diagonal, dot, multiply
from antiosc.fem.structure.structure import Structure
from antiosc.models import driving_point as bands
from antiosc.models.batched_modes import MASSLESS
from antiosc.models.rigid_share import with_rigid

#: Frequencies closer than this (relatively) are one repeated frequency: only Σm_i has a meaning.
REPEATED = 1e-6
#: Distance of the samples of a bound, and the largest share by which it rises between two of them.
SAMPLE_STEP, SAMPLE_RISE = bands.DAMPING / 4, 0.05
#: Rounding of the solves, in units of ε for every entry of the matrices.
SOLVE_ROUNDING = 64.0


@dataclass(frozen=True)
class Projected:
    """Constraint modes φ_i, and the static shapes projected on them; one site: without the axis p.

    Attributes
    ----------
    c : φ_iᵀMφ_st of the modes, kg^½, (n,) or (n, p).
    residual : the shapes that move with m0, on the rows of this rank, (rows,) or (rows, p).
    k_phi, m_phi : Kφ_i and Mφ_i on the rows of this rank, (rows, n).
    stiffnesses, masses : φ_iᵀKφ_j and φ_iᵀMφ_j as they are, (n, n).
    coupling : φ_iᵀKφ_st as it is, (n,) or (n, p).
    """

    modes: Modes
    c: Array
    residual: Array
    k_phi: Array
    m_phi: Array
    stiffnesses: Array
    masses: Array
    coupling: Array

    @property
    def poles(self) -> Array:
        """ω_i², rad²/s²."""
        return self.modes.omega**2


def project(structure: Structure, static: Array, modes: Modes) -> Projected:
    """The static shapes (rows,) or (rows, p) without the M-orthonormal modes."""
    comm, phi = structure.comm, modes.phi
    k_phi, m_phi = multiply(structure.K, phi), multiply(structure.M, phi)
    residual, c = static, np.zeros(phi.shape[1:] + static.shape[1:])
    for _ in range(2):  # twice is enough (Kahan)
        part = dot(comm, m_phi, residual)
        c, residual = c + part, residual - phi @ part
    products = dot(comm, phi, k_phi), dot(comm, phi, m_phi), dot(comm, k_phi, static)
    return Projected(modes, c, residual, k_phi, m_phi, *products)


@dataclass(frozen=True)
class Found(Projected):
    """All modes found at a site, as parameters of its elastic motions; m0 its residual mass, kg."""

    static: StaticMode
    m0: float

    def stiffness(self, x: ComplexArray) -> Numbers:
        """Z with all modes found."""
        real = self.poles > 0
        m, poles = self.c[real] ** 2, self.poles[real]
        return bands.driving_point(x, self.static.k0, self.m0, m, poles)


def lumped(structure: Structure, static: StaticMode, modes: Modes) -> Found:
    """Residual mass and shape of φ_st without the M-orthonormal modes, free of cancellation."""
    found = project(structure, static.phi, modes)
    m0 = float(dot(structure.comm, found.residual, multiply(structure.M, found.residual)))
    return Found(**vars(found), static=static, m0=0.0 if m0 <= MASSLESS**2 * static.mass else m0)


@dataclass(frozen=True)
class Oscillators:
    """The parameters of a model, its shapes on the rows of this rank, and the dropped modes.

    Attributes
    ----------
    k0, m0, omega, m : as of `AntiOscillators`.
    residual, psi : (rows,) and (rows, N) the shapes that move with m0 and with the m_i.
    hidden : (rows, h) rigid-body modes that are not in the model.
    chain : (k0, m0, m, poles) of the elastic motions alone.
    unobservable, merged : numbers of modes that were dropped and merged.
    """

    k0: float
    m0: float
    omega: Array
    m: Array
    residual: Array
    psi: Array
    hidden: Array
    chain: tuple[float, float, Array, Array]
    unobservable: int
    merged: int


def wanted(static: StaticMode, n: int) -> int:
    """Number of elastic anti-oscillators of n: a separate rigid-body motion takes one."""
    return n - 1 if static.apart is not None and n else n


def oscillators(known: Found, n: int, tol: float) -> Oscillators:
    """The n lowest anti-oscillators with more than the share `tol` in Z.

    m_i = (φ_stᵀMφ_i)² of M-orthonormal modes (Article (12)); repeated frequencies are merged; a
    rigid-body motion that is modelled separately is added.
    """
    static, c = known.static, known.c
    # ω = 0 is left only by rounding: rigid modes that vanish at the site are deflated.
    real = known.poles > 0
    first = np.diff(known.modes.omega, prepend=-np.inf) > REPEATED * known.modes.omega
    group = np.cumsum(first) - 1  # its mass is split by the basis: it is observable as a whole
    mass = np.asarray(np.bincount(group, np.where(real, c**2, 0.0)), dtype=float)
    seen = real & (bands.shares(static.k0, known.m0, mass, known.poles[first]) > tol)[group]
    omega, psi, c = known.modes.omega[seen], known.modes.phi[:, seen] * c[seen], c[seen]
    start = np.flatnonzero(np.diff(omega, prepend=-np.inf) > REPEATED * omega)
    merged = len(omega) - len(start)
    m = c**2
    if merged:
        m, k = (np.add.reduceat(v, start) for v in (m, m * omega**2))
        omega, psi = np.sqrt(k / m), np.add.reduceat(psi, start, axis=1)
    few = wanted(static, n)
    # what is not kept goes back to m0, with its shape
    lost = known.c.copy()
    lost[np.flatnonzero(seen)[: start[few] if few < len(start) else len(lost)]] = 0.0
    m0 = known.m0 + float(lost @ lost)
    residual = known.residual + known.modes.phi @ lost
    omega, m, psi = omega[:few], m[:few], psi[:, :few]
    chain = (static.k0, m0, m, omega**2)
    k0, hidden = static.k0, static.nodal
    if static.apart is not None and n:
        shapes = np.column_stack([static.apart, residual + psi.sum(axis=1), psi])
        m0, m, omega, own, turn = with_rigid(k0, m0, m, omega, static.along)
        k0, residual, psi, hidden = 0.0, shapes @ own, shapes @ turn, static.beside
    unobservable = int(np.sum(~seen))
    return Oscillators(k0, m0, omega, m, residual, psi, hidden, chain, unobservable, merged)


def error_bound(
    structure: Structure, known: Found, remainder: Remainder, kept: Oscillators, band: float
) -> float:
    """Bound on |ΔZ|/|Z| of the parameters over the band up to `band` [rad/s]."""
    static = known.static
    lowest = bands.lowest_frequency(kept.k0, kept.m0 + float(kept.m.sum()), kept.omega)
    x = bands.samples(band, lowest, SAMPLE_STEP) ** 2
    elastic = bands.driving_point(x, *kept.chain)
    left = remainder(x) + np.abs(known.stiffness(x) - elastic) + _rounding(structure, known, x)
    off = (1 + SAMPLE_RISE) * left / np.abs(elastic)
    # |1/Z - 1/Z_e| |Z_e| of the true elastic Z and this one
    off = np.where(off < 1, off / np.where(off < 1, 1 - off, 1.0), np.inf)
    Z = bands.driving_point(x, kept.k0, kept.m0, kept.m, kept.omega**2)
    off = off * np.abs(Z / elastic)
    # the displacement of the site in the rigid-body motion: its rounding, or all of it if left out
    known_a = static.along if kept.k0 == 0 else 0.0
    off = off + np.abs(Z / x) * ((static.along + static.doubt) ** 2 - known_a**2)
    return float(np.max(off))


def left_out(known: Found) -> Remainder:
    """Bound on the effect of the truncated modes on Z: their mass, on poles above the last.

    Without them their mass is in m0.
    """
    mass = 0.0 if known.modes.complete else known.m0
    return mass_above(float(known.poles.max(initial=0.0)), mass)


def _rounding(structure: Structure, known: Found, x: ComplexArray) -> Array:
    """Rounding error of Z at complex x = ω²: (W,).

    From the entries, the solves, and the measured orthogonality of the modes.
    """
    real = known.poles > 0
    poles, c = known.poles[real], known.c[real]
    shapes = np.column_stack([known.residual, known.modes.phi[:, real]])
    weight = np.column_stack([np.ones(len(x)), c * poles / (poles - x[:, None])])
    parts = []
    for matrix in (structure.K, structure.M):
        gram = dot(structure.comm, shapes, diagonal(matrix)[:, None] * shapes)
        parts.append(np.einsum("wi,wi->w", weight @ gram, weight.conj()).real)
    if by_strains(structure.K):  # a sum of squares of strains, each to ε of its own terms
        energy = known.static.k0 + np.abs(weight[:, 1:] * x[:, None] / poles) ** 2 @ poles
        parts[0] = np.sqrt(parts[0] * energy)
    left = SOLVE_ROUNDING * np.finfo(float).eps * (parts[0] + np.abs(x) * parts[1])
    # amplitudes of the modes beside the residual shape, and beside the static one
    size = np.abs(weight[:, 1:])
    bent = size * np.abs(x)[:, None] / poles
    left += 2 * bent @ np.abs(known.coupling[real])
    for matrix, own, times in (
        (known.stiffnesses - np.diag(known.poles), bent, np.ones(len(x))),
        (known.masses - np.eye(len(known.c)), size, np.abs(x)),
    ):
        left += times * np.einsum("wi,wi->w", own @ np.abs(matrix[real][:, real]), own)
    return left
