"""The model of p ≥ 1 sites from its anti-oscillators and shapes, and a bound on the error of Z.

All matrices are in the basis of loads of `SiteShapes`, in which the compliances of several sites
are the identity.

The error of Z at every damped frequency of a band is the sum of the truncation error of the method
(`Remainder`) and the errors from dropping unobservable modes, merging repeated ones and limiting
the number of anti-oscillators. ‖ΔZ‖₂‖Z⁻¹‖₂ (for one site |ΔZ|/|Z|) bounds the relative error of
the displacements of the sites under any forces on them. No bound is below the effect of rounding
(`LEAST_BOUND`); the checks of the modes detect larger rounding.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, cast

import numpy as np

from antiosc.base._types import Array, ComplexArray, IntArray, Numbers
from antiosc.base.errors import AccuracyError, AccuracyWarning, InputError
from antiosc.engine.damping import from_factors, in_coordinates
from antiosc.fem.linalg.algebra import dot, multiply
from antiosc.fem.platform import warn
from antiosc.fem.structure import Dissipation, projected
from antiosc.fem.structure.structure import Structure
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.body import UNKNOWN_INFO, ModelInfo
from antiosc.models.free_modes import DAMPING_RATIO, MASSLESS_ROOT, sample_frequencies
from antiosc.models.modal import Damping
from antiosc.models.motion import Inertia
from antiosc.models.parameters import parameters_by_name
from antiosc.reduce.extraction import SiteShapes
from antiosc.reduce.extraction.eigenmodes import Modes, ModeSolver, residuals, rounding_residuals
from antiosc.reduce.site.site import Functional

if TYPE_CHECKING:
    from mpi4py import MPI

    from antiosc.fem.structure.meshed import MeshedStructure

#: Least P of a mode at one site over the root of the static mass: dampers move it, the site hardly.
LEAST_SHARE = 1e-12
#: Frequencies closer than this (relatively) are one repeated frequency: only Σm_i has a meaning.
REPEATED_DISTANCE = 1e-6
#: Singular value of the P of a repeated frequency, over the largest, below which it is rounding.
DISTINCT_SHARE = 1e-8
#: Relative distance of the samples of a bound: a quarter of the half-width of a damped peak.
SAMPLE_STEP = DAMPING_RATIO / 4
#: Largest share by which the bound rises between two samples.
SAMPLE_RISE = 0.05
#: Least bound, for rounding: 1.7e-6 at most of random structures with entries over many decades.
LEAST_BOUND = 2e-6

#: Modes whose products with K and M are in memory together.
MODES_AT_ONCE = 8
#: Frequencies at which Z is computed at once, to limit the memory.
FREQUENCIES_AT_ONCE = 500
#: A stiffness of several sites, per unit mass, is rounding below this share of the largest.
ZERO_STIFFNESS = 1e-10

#: Default number of anti-oscillators.
DEFAULT_COUNT = 20
#: Most modes computed for each one wanted: a site with few observable ones gets fewer.
SEARCH_FACTOR = 10

#: Bound on the spectral norm of Z - Z_N [N/m] at complex x = ω² of shape (W,): (W,).
Remainder = Callable[[ComplexArray], Array]
#: Sites of a model.
Sites = Mapping[str, Functional]
#: The name of the site of a model of one site without a name.
UNNAMED_SITE = ""


@dataclass(frozen=True)
class ConstraintModes:
    """All computed constraint modes φ_i, and the projections P of the static shapes on them."""

    static: SiteShapes
    modes: Modes
    P: Array  # φ_iᵀMΦ of the modes, kg^½ of the basis, (n, p)
    m0: Array  # residual mass (p, p)
    residual_forces: Array  # norm of K φ - ω² M φ - site reactions over that of K φ, (n,)
    #: stiffnesses, masses: φ_iᵀKφ_j and φ_iᵀMφ_j as computed, (n, n)
    stiffnesses: Array
    masses: Array

    @property
    def poles(self) -> Array:
        """Squared circular frequencies ω_i² (n,) of the modes, rad²/s²."""
        return self.modes.omega**2

    def stiffness(self, x: ComplexArray) -> Numbers:
        """Dynamic stiffness Z (W, p, p) at x = ω² (W,), from all computed modes."""
        is_finite = self.poles > 0
        P, poles = self.P[is_finite], self.poles[is_finite]
        return stiffness_at_sites(x, self.static.k0, self.m0, P, poles)


def constraint_modes(structure: Structure, static: SiteShapes, modes: Modes) -> ConstraintModes:
    """`modes` with the projections of the static shapes, and m0 computed without cancellation."""
    comm = structure.comm
    phi = modes.phi
    residual = static.phi

    P = np.zeros((phi.shape[1], static.phi.shape[1]))
    for _ in range(2):  # twice is enough (Kahan)
        part = dot(comm, phi, multiply(structure.M, residual))
        P = P + part
        residual = residual - phi @ part

    m0 = semidefinite(dot(comm, residual, multiply(structure.M, residual)))
    massless = m0.diagonal() <= MASSLESS_ROOT**2 * static.mass.diagonal()
    m0[massless] = 0.0
    m0[:, massless] = 0.0
    parts = []
    for first in range(0, max(phi.shape[1], 1), MODES_AT_ONCE):
        columns = slice(first, first + MODES_AT_ONCE)
        k_phi, m_phi = (multiply(matrix, phi[:, columns]) for matrix in (structure.K, structure.M))
        products = [dot(comm, phi, forces) for forces in (k_phi, m_phi)]
        left = _residual_forces(structure, static, modes.omega[columns], k_phi, m_phi)
        parts.append([*products, left])
        del k_phi, m_phi  # before the next ones are made

    stiffnesses, masses, residual_forces = (
        np.concatenate(arrays, axis=-1) for arrays in zip(*parts, strict=True)
    )

    return ConstraintModes(static, modes, P, m0, residual_forces, stiffnesses, masses)


def _residual_forces(
    structure: Structure, static: SiteShapes, omega: Array, k_phi: Array, m_phi: Array
) -> Array:
    """Relative residuals (n,) ‖K φ - ω² M φ - reactions at the sites‖ / ‖K φ‖ of modes. `k_phi` and
    `m_phi` (rows, n), K φ and M φ, are overwritten."""
    sizes = static.solver.force_sizes
    size = sizes(k_phi)
    m_phi *= omega**2
    k_phi -= m_phi
    for column, reaction in zip(k_phi.T, dot(structure.comm, k_phi, static.phi), strict=True):
        column -= static.load @ reaction

    return sizes(k_phi) / np.maximum(size, np.finfo(float).tiny)


@dataclass(frozen=True)
class Selection:
    """The anti-oscillators of a model, selected from the constraint modes."""

    #: m0, P, omega: residual mass (p, p), φ_iᵀMΦ (N, p), circular frequencies (N,) [rad/s]
    m0: Array
    P: Array
    omega: Array
    phi: Array  # (rows, N) the modes of unit mass, on the rows of this rank
    #: unobservable, merged: numbers of modes that were dropped and merged
    unobservable: int
    merged: int


def select_observable(known: ConstraintModes, n: int, tol: float) -> Selection:
    """The n lowest anti-oscillators with a share above `tol` in Z; m0 takes the other masses."""
    static = known.static
    omega = known.modes.omega
    start = np.flatnonzero(np.diff(omega, prepend=-np.inf) > REPEATED_DISTANCE * omega)
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


def select_lowest(known: ConstraintModes, n: int) -> Selection:
    """The n lowest modes, observable at the sites or not, since dampers excite both kinds."""
    order = np.argsort(known.poles, kind="stable")
    order = order[known.poles[order] > 0][:n]
    P = known.P[order]
    if P.shape[1] == 1:  # of which the masses must be > 0
        least = LEAST_SHARE * np.sqrt(known.static.mass[0, 0])
        P = np.where(np.abs(P) < least, least, P)

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
    """Combinations (g, k) of g modes of equal frequency that move the sites independently."""
    if len(group) < 2:
        return np.eye(len(group))

    scale = np.sqrt(known.static.mass.diagonal())
    U, size, _ = np.linalg.svd(known.P[group] / scale)
    count = int(np.sum(size > DISTINCT_SHARE * size[0]))
    if count == len(group):
        return np.eye(count)

    U = U[:, :count]

    # their own frequencies differ by rounding, and the stiffness between them is to vanish
    _, vectors = np.linalg.eigh(U.T @ (known.poles[group][:, None] * U))
    return np.asarray(U @ vectors)


def by_modes(structure: Structure, static: SiteShapes, n: int, tol: float) -> Modes:
    """The lowest constraint modes, enough of them to contain n observable ones."""

    def enough(modes: Modes) -> bool:
        """Whether n modes are observable, or no mass is left for others."""
        known = constraint_modes(structure, static, modes)
        return len(select_observable(known, n, tol).omega) >= n or not known.m0.any()

    most = SEARCH_FACTOR * (n + DEFAULT_COUNT)
    return ModeSolver(structure, static).lowest(n + 2 if n else 0, enough, most)


def error_bound(
    known: ConstraintModes, remainder: Remainder, selected: Selection, band: float
) -> tuple[float, float]:
    """(bound on ‖HZ_true - 1‖₂ and ‖(HZ_true)⁻¹ - 1‖₂ to `band` [rad/s], ω from which it holds)."""
    static = known.static
    lowest = lowest_frequency_at_sites(static.k0, static.mass, selected.omega**2)
    x = sample_frequencies(band, lowest, SAMPLE_STEP) ** 2
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
    """Z (..., p, p) = k0 - x m0 - sum_i P_i P_i' x poles_i/(poles_i - x) [N/m] at x = omega^2."""
    with np.errstate(divide="ignore", invalid="ignore"):
        weight = poles / (poles - x[..., None])
    outer = P[:, :, None] * P[:, None, :]
    return np.asarray(k0 - x[..., None, None] * (m0 + np.tensordot(weight, outer, axes=1)))


def shares_at_sites(k0: Array, m0: Array, P: Array, poles: Array) -> Array:
    """Spectral radius (N,) of Z⁻¹ΔZ at each damped pole, ΔZ of moving its mode's mass to m0."""
    share = np.zeros(len(poles))
    positive = np.flatnonzero(poles > 0)
    for i in np.split(positive, range(FREQUENCIES_AT_ONCE, len(positive), FREQUENCIES_AT_ONCE)):
        x = poles[i] * (1 + 1j * DAMPING_RATIO) ** 2
        Z = stiffness_at_sites(x, k0, m0, P[positive], poles[positive])
        shares = np.einsum("ip,ip->i", P[i], np.linalg.solve(Z, P[i, :, None])[:, :, 0])
        share[i] = np.abs(x**2 / (poles[i] - x) * shares)

    return share


def lowest_frequency_at_sites(k0: Array, m_st: Array, poles: Array) -> float:
    """Lowest frequency [rad/s]: of the poles, or of k0 on the masses m_st; inf for a rigid mass."""
    lowest = [float(x) for x in poles[:1]]
    scale = 1 / np.sqrt(np.maximum(m_st.diagonal(), np.finfo(float).tiny))
    values = np.linalg.eigvalsh(k0 * scale[:, None] * scale)
    lowest += [float(x) for x in values[values > ZERO_STIFFNESS * values.max(initial=0.0)][:1]]
    return float(np.sqrt(min(lowest, default=np.inf)))


def spectral_norms(matrices: Numbers) -> Array:
    """2-norms (W,) of matrices (W, m, n); 0 for empty matrices."""
    if 0 in matrices.shape:
        return np.zeros(len(matrices))
    return np.asarray(np.linalg.norm(matrices, 2, axis=(1, 2)))


def semidefinite(matrix: Array) -> Array:
    """The symmetric matrix (p, p) with its negative eigenvalues (rounding) set to zero."""
    scale = np.sqrt(np.maximum(matrix.diagonal(), 0.0))
    unit = matrix / np.where(scale > 0, scale, 1.0)[:, None] / np.where(scale > 0, scale, 1.0)
    unit[scale == 0] = 0.0
    unit[:, scale == 0] = 0.0
    values, vectors = np.linalg.eigh((unit + unit.T) / 2)
    if values.size and values[0] < 0:
        unit = (vectors * np.maximum(values, 0.0)) @ vectors.T
    return np.asarray((unit + unit.T) / 2 * scale[:, None] * scale)


def info_of_model(
    structure: Structure, sites: Sites, known: ConstraintModes, selected: Selection, method: str
) -> ModelInfo:
    """The record of an extraction, for `info` of the model."""
    measured, converged = mode_errors(structure, known, method)
    cells = {name: site.cell for name, site in sites.items() if site.cell is not None}
    info = UNKNOWN_INFO.having(
        structure=structure.describe(),
        dofs=structure.dofs,
        method=method,
        modes_computed=len(known.modes.omega),
        converged=converged,
        modes_unobservable=selected.unobservable,
        modes_merged=selected.merged,
        rigid_modes=int(structure.rigid_modes.shape[1]),
        rigid_share=known.static.share,
        checks=measured,
        solver=known.static.solver.description,
        cells=cells or None,
        **structure.matrices.plausibility,
    )
    if info.thickness is None:
        return info

    # the least thickness of the sheets at the sites, or of the structure
    least = info.thickness
    materials = [site.place.material for site in sites.values() if site.place is not None]
    found = [getattr(getattr(one, "section", None), "thickness", least) for one in materials]
    return replace(info, thickness=min(found, default=least))


def model_of(
    structure: Structure, sites: Sites, static: SiteShapes, selected: Selection, info: ModelInfo
) -> AntiOscillators:
    """The model of p ≥ 1 sites; for one site the shapes of `selected` are scaled in place."""
    found = list(sites.values())
    names = () if UNNAMED_SITE in sites else tuple(sites)
    directions = [site.directions for site in found if site.directions is not None]
    has_directions = len(directions) == len(found)
    points = {name: x.point.tolist() for name, x in sites.items() if x.point is not None}

    P = static.W @ selected.P.T
    if not names:  # m_i moves with its site: lambda_i = lambda_0 + an amplitude
        phi = selected.phi
        phi *= P[0]  # in place: as large as the shapes

    shapes = np.hstack([static.phi @ static.W.T, selected.phi])
    k0, m0 = (semidefinite(static.W @ one @ static.W.T) for one in (static.k0, selected.m0))

    inertia = inertia_of(structure, shapes, static.nodal)
    participation = participations(structure, shapes) if has_directions else None
    if info.thickness is not None and len(k0) == len(sites):
        info = info.having(second_order=_stiffening(structure, list(sites), k0, shapes))

    # the sites
    columns = np.split(np.arange(len(static.dependence)), np.cumsum([s.B.shape[1] for s in found]))
    parameters = parameters_by_name(
        names,
        k0=k0,
        m0=m0,
        P=P,
        direction=np.vstack(directions) if has_directions else None,
        participation=participation,
        local_compliance=np.array([site.local_compliance for site in found]),
        radius=tuple(site.radius for site in found),
        columns=dict(zip(names, (tuple(c.tolist()) for c in columns), strict=False)),
        dependence=static.dependence,
        rigid=static.rigid,
    )

    if names:
        info = info.having(independent=static.kept.tolist())
        info = replace(info, points=points) if has_directions else info
    else:
        info = info.having(meshed=structure.matrices.meshed and not structure.matrices.assembled)
        if points and has_directions:
            direction = directions[0][0].tolist()
            info = replace(info, point=points[UNNAMED_SITE], direction=direction)

    return AntiOscillators(
        **parameters,
        omega=selected.omega,
        shapes=shapes,
        inertia=inertia,
        hidden=None if inertia is None else static.nodal,
        info=info,
    )


def _stiffening(
    structure: Structure, sites: Sequence[str], k0: Array, shapes: Array
) -> dict[str, float] | None:
    """Relative stiffness change per metre, by site; None except for supported curved sheets."""
    matrices = structure.matrices
    if not matrices.meshed or matrices.assembled or structure.rigid_modes.shape[1]:
        return None
    part = cast("MeshedStructure", matrices)
    if not part.kind.sheet:
        return None
    from antiosc.fem.elements.second_order import relative_stiffening  # needs dolfinx

    C = np.linalg.inv(k0)
    deflections = shapes[:, : len(C)] @ C / C.diagonal()
    by_site = {
        site: relative_stiffening(part, deflections[:, i], 1 / C[i, i])
        for i, site in enumerate(sites)
    }
    return by_site if any(by_site.values()) else None


def inertia_of(structure: Structure, *shapes: Array) -> Inertia | None:
    """Inertia with the momenta of `shapes`; None for a body without rigid-body motion."""
    if structure.rigid_inertia is None:
        return None
    inertia, loads = structure.rigid_inertia
    return inertia.along(np.vstack([dot(structure.comm, block, loads) for block in shapes]))


def participations(structure: Structure, shapes: Array) -> Array | None:
    """Participations φᵀMe (k, 3) of shapes in accelerations along x, y, z; None if unknown."""
    loads = [structure.uniform_inertia(axis) for axis in np.eye(3)]
    if any(load is None for load in loads):
        return None
    return np.asarray(dot(structure.comm, shapes, np.column_stack(loads)))  # type: ignore[arg-type]


#: Largest damping of motions that the model lacks, as a share of the model's damping.
UNDAMPED_SHARE = 1e-12


def with_damping(
    structure: Structure, model: AntiOscillators, static: SiteShapes, terms: Sequence[Dissipation]
) -> AntiOscillators:
    """The model with damping `terms`, and loss factors by modal strain energy, ζ_j = Σ η_m U_jm/(2
    U_j) (E. Ungar, E. Kerwin, *J. Acoust. Soc. Am.* 34 (1962) 954). InputError if a damper brakes a
    rigid-body motion that the model lacks."""
    body = model.free_modes
    assert body.basis is not None
    assert body.shape is not None
    phi = body.amplitudes(body.shape.T)
    elastic = body.omega > 0
    losses = structure.matrices.loss_stiffness(np.column_stack(body.basis))
    ratio = np.zeros(int(elastic.sum()))
    if losses is not None:
        energies = np.einsum("ja,ab,jb->j", phi, losses, phi)
        ratio = np.maximum(energies[elastic] / (2 * body.omega[elastic] ** 2), 0.0)
    if not terms:
        return replace(model, damping=Damping(ratio=ratio.tolist()))

    assert model.shapes is not None
    V = np.column_stack([model.shapes * model.unit, static.nodal])
    damping = projected(structure.comm, terms, V)
    kept = slice(V.shape[1] if model.hidden is not None else model.unit.size)
    braked = damping.matrix.diagonal()
    if braked[kept.stop :].sum() > UNDAMPED_SHARE * braked[kept].sum():
        raise InputError(
            "a damper brakes a rigid-body motion that the site does not see, and that matrices "
            "without coordinates do not tell: give them a map with coordinates."
        )

    damping = in_coordinates(damping, np.eye(len(braked))[:, kept])
    if losses is None:
        return replace(model, damping=damping)

    # in the coordinates of the matrix: q of what moves, by the inverse of the modes
    amplitude = phi.T.copy()
    amplitude[: model.unit.size] /= model.unit[:, None]
    modes = np.linalg.pinv(amplitude)[elastic]
    by_losses = np.sqrt(2 * ratio * body.omega[elastic])[:, None] * modes
    factor = np.vstack([damping.factor, by_losses])
    return replace(model, damping=from_factors(factor, damping.factors))


#: Limits of the self-check, relative: residual, M-orthogonality, constraint, mass balance.
CHECK_LIMIT = 1e-6
#: Up to this many times a limit a result is usable, with a warning; beyond, it is refused.
USABLE_FACTOR = 100
#: Limit of the residual, of ω² its square: rounding in K is 1e-6 of Kφ for a mode on soft springs.
RESIDUAL_LIMIT = 1e-5
#: ω² over the shift below which a mode is a mechanism: the shift has the size of the first elastic.
MECHANISM_SHARE = 1e-9
#: A Ritz pair of a smaller residual is an antiresonance, right to about the square of this.
CONVERGED_RESIDUAL = 1e-3


def check_limit(name: str, value: float, limit: float, comm: MPI.Comm) -> None:
    """Warn of a measured error above `limit`; AccuracyError above `USABLE_FACTOR` × `limit`."""
    if value <= limit:
        return

    reason = (
        "the matrices are ill-conditioned by very slender or thin parts, penalties, very uneven "
        "elements or materials: take fewer elements, more even ones, smaller penalties."
    )
    if not value <= USABLE_FACTOR * limit:
        raise AccuracyError(
            f"the constraint modes fail their own check: {name} {value:.1e}, limit "
            f"{USABLE_FACTOR * limit:.0e}; {reason}"
        )

    warn(
        comm,
        f"the constraint modes satisfy their check only to {value:.1e} ({name}, usually below "
        f"{limit:.0e}): {reason}",
        AccuracyWarning,
    )


def mode_errors(
    structure: Structure, known: ConstraintModes, method: str
) -> tuple[dict[str, float], int]:
    """(measured errors by name, number of converged modes); AccuracyError for large errors."""
    modes = known.modes
    static = known.static
    comm = structure.comm
    if len(modes.omega) and modes.omega[0] ** 2 < MECHANISM_SHARE * structure.shift:
        raise AccuracyError(
            f"the structure moves without strain (ω = {modes.omega[0]:.1e} rad/s), but not as a "
            "rigid body: join parts along faces, not at a hinge, a point or a line."
        )

    residual_forces = known.residual_forces
    scale = np.sqrt(modes.omega**2 + structure.shift)
    projection = (known.stiffnesses - np.diag(modes.omega**2)) / np.outer(scale, scale)
    strain = dot(comm, static.phi, multiply(structure.K, static.phi)) - static.k0
    sites = np.sqrt((static.k0 + structure.shift * static.mass).diagonal())

    # displacements of the sites in the modes, and the excess of the modes over the static masses
    squares = [comm.allreduce(np.einsum("ij,ij->j", x, x)) for x in (static.load, modes.phi)]
    moved = dot(comm, static.load, modes.phi) / np.sqrt(np.outer(*squares))
    unit = 1 / np.sqrt(np.maximum(static.mass.diagonal(), np.finfo(float).tiny))
    remaining_mass = (static.mass - known.P.T @ known.P) * unit[:, None] * unit
    equation = {"residual": residual_forces} if method == "modes" else {"projection": projection}
    overlap = known.masses - np.eye(len(residual_forces))
    errors = {**equation, "orthogonality": overlap, "constraint": moved}
    measured = {
        **{name: float(np.abs(value).max(initial=0.0)) for name, value in errors.items()},
        "mass": max(0.0, -float(np.linalg.eigvalsh(remaining_mass)[0])),
        "stiffness": float(np.abs(strain / np.outer(sites, sites)).max()),
    }
    for name, value in measured.items():
        check_limit(name, value, RESIDUAL_LIMIT if name == "residual" else CHECK_LIMIT, comm)
    return measured, int(np.sum(residual_forces < CONVERGED_RESIDUAL))


def check_modes(structure: Structure, modes: Modes) -> None:
    """AccuracyError if M-orthogonality or residual exceed `CHECK_LIMIT` and rounding."""
    gram = dot(structure.comm, modes.phi, multiply(structure.M, modes.phi))
    worst = {
        "orthogonality": np.abs(gram - np.eye(len(gram))).max(initial=0.0),
        "residual": CHECK_LIMIT
        * (residuals(structure, modes) / rounding_residuals(structure, modes)).max(initial=0.0),
    }
    for name, value in worst.items():
        if not value <= CHECK_LIMIT:
            raise AccuracyError(
                f"the natural modes fail their own check: {name} {value:.1e}, limit "
                f"{CHECK_LIMIT:.0e}; elements or materials may be very uneven."
            )
