"""Anti-oscillators of several sites from their constraint modes, and a bound on the error of Z.

All matrices are in the basis of loads of `SiteShapes`, in which the compliances of the sites are
the identity; `Parameters` are those of the sites themselves.

The error of Z at every damped frequency of a band is the sum of the truncation error of the method
(`Remainder`), of the modes that were dropped and merged, of the limited number of anti-oscillators,
and of rounding (`antiosc.fem.extraction.oscillators`). ‖ΔZ‖₂‖Z⁻¹‖₂ bounds the relative error of the
displacements of the sites under any forces on them, in the basis named.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from antiosc._types import Array, ComplexArray, IntArray, Numbers
from antiosc.fem.extraction.eigenmodes import Modes
from antiosc.fem.extraction.oscillators import (
    REPEATED,
    SAMPLE_RISE,
    SAMPLE_STEP,
    SOLVE_ROUNDING,
    Projected,
    project,
)
from antiosc.fem.extraction.ritz_basis import Remainder, mass_above
from antiosc.fem.extraction.site_shapes import SiteShapes
from antiosc.fem.linalg.algebra import by_strains, diagonal, dot, multiply
from antiosc.fem.structure.structure import Structure
from antiosc.models import driving_point as bands

#: Singular value of the P of a repeated frequency, over the largest, below which it is rounding.
TOLD_APART = 1e-8


@dataclass(frozen=True)
class Found(Projected):
    """All constraint modes found, as parameters of the sites; m0 (p, p) the residual mass."""

    static: SiteShapes
    m0: Array

    @property
    def P(self) -> Array:
        """φ_iᵀMΦ, (n, p)."""
        return self.c

    def stiffness(self, x: ComplexArray) -> Numbers:
        """Z (W, p, p) with all modes found."""
        real = self.poles > 0
        return bands.stiffness_at_sites(x, self.static.k0, self.m0, self.P[real], self.poles[real])


def lumped(structure: Structure, static: SiteShapes, modes: Modes) -> Found:
    """Residual masses and shapes: Φ without the M-orthonormal modes, free of cancellation."""
    found = project(structure, static.phi, modes)
    m0 = dot(structure.comm, found.residual, multiply(structure.M, found.residual))
    return Found(**vars(found), static=static, m0=bands.semidefinite(m0))


@dataclass(frozen=True)
class Kept:
    """The anti-oscillators of a model.

    Attributes
    ----------
    m0, P, omega : residual mass (p, p), P (N, p) and circular frequencies (N,).
    phi : (rows, N) their shapes on the rows of this rank.
    unobservable, merged : numbers of modes that were dropped and merged.
    """

    m0: Array
    P: Array
    omega: Array
    phi: Array
    unobservable: int
    merged: int


def oscillators(known: Found, n: int, tol: float) -> Kept:
    """The n lowest anti-oscillators with more than the share `tol` in Z.

    Of a repeated frequency as many are kept as the sites can tell apart, at most p. The masses of
    all others are added to m0.
    """
    static = known.static
    # ω = 0 is left only by rounding: rigid modes that do not move the sites are deflated.
    shares = bands.shares_at_sites(static.k0, known.m0, known.P, known.poles)
    seen = np.flatnonzero(shares > tol)
    omega = known.modes.omega[seen]
    start = np.flatnonzero(np.diff(omega, prepend=-np.inf) > REPEATED * omega)
    turns = [_told_apart(known, group) for group in np.split(seen, start[1:])]
    turn = np.column_stack([np.zeros((len(known.P), 0)), *turns])
    P = turn.T @ known.P
    poles = np.einsum("ij,i,ij->j", turn, known.poles, turn)
    order = np.argsort(poles, kind="stable")[:n]
    turn, P = turn[:, order], P[order]
    lost = known.P - turn @ P  # what is not kept goes back to m0
    return Kept(
        m0=bands.semidefinite(known.m0 + lost.T @ lost),
        P=P,
        omega=np.sqrt(poles[order]),
        phi=known.modes.phi @ turn,
        unobservable=len(known.P) - len(seen),
        merged=len(seen) - sum(each.shape[1] for each in turns),
    )


def _told_apart(known: Found, group: IntArray) -> Array:
    """Combinations (n, k) of the modes `group` of one frequency that the sites can distinguish."""
    turn = np.zeros((len(known.P), len(group)))
    turn[group, np.arange(len(group))] = 1.0
    if len(group) < 2:
        return turn
    scale = np.sqrt(known.static.mass.diagonal())
    U, size, _ = np.linalg.svd(known.P[group] / scale)
    count = int(np.sum(size > TOLD_APART * size[0]))
    if count == len(group):
        return turn
    U = U[:, :count]
    # their own frequencies differ by rounding, and the stiffness between them is to vanish
    _, own = np.linalg.eigh(U.T @ (known.poles[group][:, None] * U))
    return np.asarray(turn @ (U @ own))


def error_bound(
    structure: Structure, known: Found, remainder: Remainder, kept: Kept, band: float
) -> tuple[float, float]:
    """(bound on ‖HZ_true - 1‖₂ and its inverse, lowest frequency) of the band up to `band` [rad/s].

    Below that frequency Z is quasi-static.
    """
    static = known.static
    lowest = bands.lowest_frequency_at_sites(static.k0, static.mass, kept.omega**2)
    x = bands.samples(band, lowest, SAMPLE_STEP) ** 2
    elastic = bands.stiffness_at_sites(x, static.k0, kept.m0, kept.P, kept.omega**2)
    change = bands.spectral_norms(known.stiffness(x) - elastic)
    sizes = np.linalg.svd(elastic, compute_uv=False)
    # the numbers of the sites themselves are rounded, of Z = W (this one) Wᵀ
    spread = np.linalg.norm(np.abs(np.linalg.inv(static.W)) @ np.abs(static.W), 2)
    stored = np.finfo(float).eps * len(static.W) * spread**2 * sizes[:, 0]
    left = remainder(x) + change + stored + _rounding(structure, known, x)
    off = (1 + SAMPLE_RISE) * left / sizes[:, -1]
    off = np.where(off < 1, off / np.where(off < 1, 1 - off, 1.0), np.inf)
    # the rigid-body motions beside: H = H_e - a aᵀ/x
    moved = static.beside.T @ static.beside / x[:, None, None]
    whole = np.linalg.inv(np.eye(len(static.W)) - moved @ elastic)  # H_e⁻¹ H, its inverse
    off = off * bands.spectral_norms(whole)
    # displacements of the sites in rigid-body motions: their rounding, and what is left out
    rounding = bands.spectral_norms(static.doubt[None])
    largest = static.moved.max(initial=0.0) + bands.spectral_norms(static.beside[None])
    hidden = bands.spectral_norms(static.missed[None]) + rounding
    off = off + bands.spectral_norms(elastic @ whole) / np.abs(x) * (
        hidden**2 + 2 * largest * rounding
    )
    return float(np.max(off)), float(np.sqrt(x[0]).real)


def left_out(known: Found) -> Remainder:
    """Bound on the effect of the truncated modes on Z: their mass, on poles above the last.

    Without them their mass is in m0.
    """
    mass = 0.0 if known.modes.complete else float(np.linalg.norm(known.m0, 2))
    return mass_above(float(known.poles.max(initial=0.0)), mass)


def _rounding(structure: Structure, known: Found, x: ComplexArray) -> Array:
    """Norm of the rounding error of Z at complex x = ω²: (W,).

    From the entries, the solves, and the measured orthogonality of the modes.
    """
    real = known.poles > 0
    poles, P = known.poles[real], known.P[real]
    count = P.shape[1]
    shapes = np.column_stack([known.residual, known.modes.phi[:, real]])
    lever = poles / (poles - x[:, None])
    sized = np.broadcast_to(np.eye(count), (len(x), count, count))
    weight = np.concatenate([sized, lever[:, :, None] * P], axis=1)
    parts = []
    for matrix in (structure.K, structure.M):
        gram = dot(structure.comm, shapes, diagonal(matrix)[:, None] * shapes)
        parts.append(bands.spectral_norms(weight.conj().transpose(0, 2, 1) @ (gram @ weight)))
    if by_strains(structure.K):  # a sum of squares of strains, each to ε of its own terms
        bent = (x / np.sqrt(poles)[:, None]).T[:, :, None] * weight[:, count:]
        bent = np.abs(bent).transpose(0, 2, 1) @ np.abs(bent)
        energy = bands.spectral_norms(known.static.k0 + bent)
        parts[0] = np.sqrt(parts[0] * energy)
    left = SOLVE_ROUNDING * np.finfo(float).eps * (parts[0] + np.abs(x) * parts[1])
    # amplitudes of the modes beside the residual shapes, and beside the static ones
    size = np.abs(weight[:, count:])
    bent = size * (np.abs(x)[:, None] / poles)[:, :, None]
    left += 2 * bands.spectral_norms(bent.transpose(0, 2, 1) @ np.abs(known.coupling[real]))
    for matrix, own, times in (
        (known.stiffnesses - np.diag(known.poles), bent, np.ones(len(x))),
        (known.masses - np.eye(len(known.P)), size, np.abs(x)),
    ):
        off = np.abs(matrix[np.ix_(real, real)]) @ own
        left += times * bands.spectral_norms(own.transpose(0, 2, 1) @ off)
    return left
