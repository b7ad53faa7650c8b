"""Anti-oscillators of p ≥ 1 sites from their constraint modes, and a bound on the error of Z.

All matrices are in the basis of loads of `SiteShapes`, in which the compliances of several sites
are the identity.

The error of Z at every damped frequency of a band is the sum of the truncation error of the method
(`Remainder`), of the unobservable modes that were dropped and the repeated ones that were merged,
and of the limited number of anti-oscillators. ‖ΔZ‖₂‖Z⁻¹‖₂ bounds the relative error of the
displacements of the sites under any forces on them, for one site |ΔZ|/|Z|. No bound is
below what rounding leaves (`LEAST_BOUND`); the checks of the modes tell of more.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from antiosc.base._types import Array, ComplexArray, IntArray, Numbers
from antiosc.fem.linalg.algebra import dot, multiply
from antiosc.fem.structure.structure import Structure
from antiosc.models.free_modes import DAMPING, MASSLESS, samples
from antiosc.reduce.extraction import SiteShapes
from antiosc.reduce.extraction.eigenmodes import Modes, ModeSolver

#: Least P of a mode at one site over the root of the static mass: dampers move it, the site hardly.
LEAST_SHARE = 1e-12
#: Frequencies closer than this (relatively) are one repeated frequency: only Σm_i has a meaning.
REPEATED = 1e-6
#: Singular value of the P of a repeated frequency, over the largest, below which it is rounding.
DISTINCT = 1e-8
#: Relative distance of the samples of a bound: a quarter of the half-width of a damped peak.
SAMPLE_STEP = DAMPING / 4
#: Largest share by which the bound rises between two samples.
SAMPLE_RISE = 0.05
#: Least bound, for rounding: 1.7e-6 at most of random structures with entries over many decades.
LEAST_BOUND = 2e-6

#: Modes whose products with K and M are in memory together.
TOGETHER = 8
#: Frequencies at which Z is computed at once, to limit the memory.
AT_ONCE = 500
#: A stiffness of several sites, per unit mass, is rounding below this share of the largest.
UNSTRAINED = 1e-10

#: Default number of anti-oscillators.
DEFAULT_COUNT = 20
#: Largest number of modes computed for each one wanted: a site with fewer observable ones gets
#: fewer.
SEARCHED = 10

#: Bound on the spectral norm of Z - Z_N [N/m] at complex x = ω² of shape (W,): (W,).
Remainder = Callable[[ComplexArray], Array]


@dataclass(frozen=True)
class ConstraintModes:
    """All computed constraint modes φ_i, and the static shapes Φ projected on them.

    Attributes
    ----------
    P : φ_iᵀMΦ of the modes, kg^½ of the basis, (n, p).
    m0 : residual mass (p, p).
    off : residual forces of the modes over their elastic ones, (n,).
    stiffnesses, masses : φ_iᵀKφ_j and φ_iᵀMφ_j as computed, (n, n).
    """

    static: SiteShapes
    modes: Modes
    P: Array
    m0: Array
    off: Array
    stiffnesses: Array
    masses: Array

    @property
    def poles(self) -> Array:
        """ω_i², rad²/s²."""
        return self.modes.omega**2

    def stiffness(self, x: ComplexArray) -> Numbers:
        """Z (W, p, p) with all computed modes."""
        is_finite = self.poles > 0
        return stiffness_at_sites(
            x, self.static.k0, self.m0, self.P[is_finite], self.poles[is_finite]
        )


def lumped(structure: Structure, static: SiteShapes, modes: Modes) -> ConstraintModes:
    """The constraint modes with the static shapes projected on them, computed without
    cancellation.
    """
    comm = structure.comm
    phi = modes.phi
    residual = static.phi
    P = np.zeros((phi.shape[1], static.phi.shape[1]))
    for _ in range(2):  # twice is enough (Kahan)
        part = dot(comm, phi, multiply(structure.M, residual))
        P = P + part
        residual = residual - phi @ part
    m0 = semidefinite(dot(comm, residual, multiply(structure.M, residual)))
    massless = m0.diagonal() <= MASSLESS**2 * static.mass.diagonal()
    m0[massless] = 0.0
    m0[:, massless] = 0.0
    parts = []
    for columns in _slices(phi.shape[1]):
        k_phi, m_phi = (multiply(matrix, phi[:, columns]) for matrix in (structure.K, structure.M))
        products = [dot(comm, phi, forces) for forces in (k_phi, m_phi)]
        parts.append(
            [*products, _forces_left(structure, static, modes.omega[columns], k_phi, m_phi)]
        )
        del k_phi, m_phi  # before the next ones are made
    stiffnesses, masses, residual_forces = (
        np.concatenate(arrays, axis=-1) for arrays in zip(*parts, strict=True)
    )
    return ConstraintModes(
        static=static,
        modes=modes,
        P=P,
        m0=m0,
        stiffnesses=stiffnesses,
        masses=masses,
        off=residual_forces,
    )


def _slices(count: int) -> list[slice]:
    """Slices of at most `TOGETHER` of `count` columns; at least one slice."""
    return [slice(k, k + TOGETHER) for k in range(0, max(count, 1), TOGETHER)]


def _forces_left(
    structure: Structure, static: SiteShapes, omega: Array, k_phi: Array, m_phi: Array
) -> Array:
    """Residual forces of the modes relative to their elastic forces (n,); KΦ and MΦ are
    overwritten.

    The reactions fix the sites: Kφ - ω²Mφ = load μ, and loadᵀΦ = 1 gives μ.
    """
    sizes = static.solver.force_sizes
    size = sizes(k_phi)
    m_phi *= omega**2
    k_phi -= m_phi
    for column, reaction in zip(k_phi.T, dot(structure.comm, k_phi, static.phi), strict=True):
        column -= static.load @ reaction
    return sizes(k_phi) / np.maximum(size, np.finfo(float).tiny)


@dataclass(frozen=True)
class Selection:
    """The selected anti-oscillators of a model.

    Attributes
    ----------
    m0, P, omega : residual mass (p, p), P (N, p) and circular frequencies (N,).
    phi : (rows, N) the modes of unit mass, on the rows of this rank.
    unobservable, merged : numbers of modes that were dropped and merged.
    """

    m0: Array
    P: Array
    omega: Array
    phi: Array
    unobservable: int
    merged: int


def oscillators(known: ConstraintModes, n: int, tol: float) -> Selection:
    """The n lowest anti-oscillators with a share in Z above `tol`.

    Modes of one frequency are reduced to those that move the sites differently, at most p. The
    masses of all others are added to m0.
    """
    static = known.static
    omega = known.modes.omega
    start = np.flatnonzero(np.diff(omega, prepend=-np.inf) > REPEATED * omega)
    groups = np.split(np.arange(len(omega)), start[1:]) if len(omega) else []
    mixed = [(group, u) for group in groups for u in _distinct_motions(known, group).T]
    P = np.array([u @ known.P[group] for group, u in mixed]).reshape(-1, known.P.shape[1])
    poles = np.array([u**2 @ known.poles[group] for group, u in mixed])
    # ω = 0 is left only by rounding: rigid modes that do not move the sites are deflated.
    observable = np.flatnonzero(shares_at_sites(static.k0, known.m0, P, poles) > tol)
    modes = sum({group[0]: len(group) for group, _ in (mixed[i] for i in observable)}.values())
    order = observable[np.argsort(poles[observable], kind="stable")[:n]]
    combination = np.zeros((len(omega), len(order)))
    for column, i in enumerate(order):
        combination[mixed[i][0], column] = mixed[i][1]
    lumped_rows = known.P - combination @ P[order]  # what is not kept goes back to m0
    return Selection(
        m0=semidefinite(known.m0 + lumped_rows.T @ lumped_rows),
        P=P[order],
        omega=np.sqrt(poles[order]),
        phi=known.modes.phi @ combination,
        unobservable=len(omega) - modes,
        merged=modes - len(observable),
    )


def every_mode(known: ConstraintModes, n: int) -> Selection:
    """A selection of the n lowest modes, also of those that move dampers but no site."""
    order = np.argsort(known.poles, kind="stable")
    order = order[known.poles[order] > 0][:n]
    P = known.P[order].copy()
    if P.shape[1] == 1:
        threshold = LEAST_SHARE * np.sqrt(known.static.mass[0, 0])
        P = np.where(np.abs(P) < threshold, threshold, P)
    lumped_rows = np.delete(known.P, order, axis=0)
    return Selection(
        m0=semidefinite(known.m0 + lumped_rows.T @ lumped_rows),
        P=P,
        omega=known.modes.omega[order],
        phi=known.modes.phi[:, order],
        unobservable=0,
        merged=0,
    )


def _distinct_motions(known: ConstraintModes, group: IntArray) -> Array:
    """Combinations (g, k) of g modes of equal frequency that move the sites differently."""
    if len(group) < 2:
        return np.eye(len(group))
    scale = np.sqrt(known.static.mass.diagonal())
    U, size, _ = np.linalg.svd(known.P[group] / scale)
    count = int(np.sum(size > DISTINCT * size[0]))
    if count == len(group):
        return np.eye(count)
    U = U[:, :count]
    # their own frequencies differ by rounding, and the stiffness between them is to vanish
    _, vectors = np.linalg.eigh(U.T @ (known.poles[group][:, None] * U))
    return np.asarray(U @ vectors)


def by_modes(structure: Structure, static: SiteShapes, n: int, tol: float) -> Modes:
    """The lowest constraint modes until n of them are observable."""
    solver = ModeSolver(structure, static)
    limit = min(solver.limit, SEARCHED * (n + DEFAULT_COUNT))
    count = n + 2 if n else 0
    while True:
        modes = solver.lowest(count)
        known = lumped(structure, static, modes)
        found = len(oscillators(known, n, tol).omega)
        if modes.complete or count >= limit or found >= n or not known.m0.any():
            return modes
        count = min(limit, len(modes.omega) + max(8, len(modes.omega) // 2))


def error_bound(
    known: ConstraintModes,
    remainder: Remainder,
    selected: Selection,
    band: float,
) -> tuple[float, float]:
    """(bound on ‖HZ_true - 1‖₂ and its inverse, lowest frequency) of the band up to `band` [rad/s].

    Below that frequency Z is quasi-static.
    """
    static = known.static
    lowest = lowest_frequency_at_sites(static.k0, static.mass, selected.omega**2)
    x = samples(band, lowest, SAMPLE_STEP) ** 2
    elastic = stiffness_at_sites(x, static.k0, selected.m0, selected.P, selected.omega**2)
    change = spectral_norms(known.stiffness(x) - elastic)
    sizes = np.linalg.svd(elastic, compute_uv=False)
    share = (1 + SAMPLE_RISE) * (remainder(x) + change) / sizes[:, -1]
    error = np.where(share < 1, share / np.where(share < 1, 1 - share, 1.0), np.inf)

    # rigid-body modes that hardly move the sites: H = H_e - a aᵀ/x
    hidden = spectral_norms(static.missed[None])
    error = error + spectral_norms(elastic) / np.abs(x) * hidden**2
    return max(float(np.max(error)), LEAST_BOUND), float(np.sqrt(x[0]).real)


# -- p >= 1 sites: Z, K0, M0 are (p, p), and mode i has P_i (p,), its inertia at the sites


def stiffness_at_sites(x: Numbers, k0: Array, m0: Array, P: Array, poles: Array) -> Numbers:
    """Z (..., p, p) = k0 - x m0 - sum_i P_i P_i' x poles_i/(poles_i - x) [N/m] at x = omega^2.

    k0, m0 : (p, p) [N/m], [kg]. P : (N, p) [kg^1/2]. poles : (N,) omega_i^2 [rad^2/s^2].
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        weight = poles / (poles - x[..., None])
    outer = P[:, :, None] * P[:, None, :]
    return np.asarray(k0 - x[..., None, None] * (m0 + np.tensordot(weight, outer, axes=1)))


def shares_at_sites(k0: Array, m0: Array, P: Array, poles: Array) -> Array:
    """Spectral radius (N,) of Z^-1 times the change of Z at each damped pole if its mass is added
    to m0.

    Arguments as for `stiffness_at_sites`; 0 for a pole <= 0. The result does not depend on units
    and combinations of the sites.
    """
    share = np.zeros(len(poles))
    positive = np.flatnonzero(poles > 0)
    for i in np.split(positive, range(AT_ONCE, len(positive), AT_ONCE)):
        x = poles[i] * (1 + 1j * DAMPING) ** 2
        Z = stiffness_at_sites(x, k0, m0, P[positive], poles[positive])
        shares = np.einsum("ip,ip->i", P[i], np.linalg.solve(Z, P[i, :, None])[:, :, 0])
        share[i] = np.abs(x**2 / (poles[i] - x) * shares)
    return share


def lowest_frequency_at_sites(k0: Array, m_st: Array, poles: Array) -> float:
    """Frequency [rad/s] at which Z begins to vary: the lowest of k0 on m_st, or the first pole.

    inf for a rigid mass, whose Z has no such frequency.
    """
    lowest = [float(x) for x in poles[:1]]
    scale = 1 / np.sqrt(np.maximum(m_st.diagonal(), np.finfo(float).tiny))
    values = np.linalg.eigvalsh(k0 * scale[:, None] * scale)
    lowest += [float(x) for x in values[values > UNSTRAINED * values.max(initial=0.0)][:1]]
    return float(np.sqrt(min(lowest, default=np.inf)))


def spectral_norms(matrices: Numbers) -> Array:
    """2-norms (W,) of matrices (W, m, n); 0 of empty ones."""
    if 0 in matrices.shape:
        return np.zeros(len(matrices))
    if 1 in matrices.shape[1:]:
        return np.sqrt(np.sum(np.abs(matrices) ** 2, axis=(1, 2)))
    return np.asarray(np.linalg.norm(matrices, 2, axis=(1, 2)))


def semidefinite(matrix: Array) -> Array:
    """The symmetric matrix (p, p) without negative eigenvalues due to rounding."""
    scale = np.sqrt(np.maximum(matrix.diagonal(), 0.0))
    unit = matrix / np.where(scale > 0, scale, 1.0)[:, None] / np.where(scale > 0, scale, 1.0)
    unit[scale == 0] = 0.0
    unit[:, scale == 0] = 0.0
    values, vectors = np.linalg.eigh((unit + unit.T) / 2)
    if values.size and values[0] < 0:
        unit = (vectors * np.maximum(values, 0.0)) @ vectors.T
    return np.asarray((unit + unit.T) / 2 * scale[:, None] * scale)
