"""`extract`: a structure and a site into anti-oscillators."""

from __future__ import annotations

import logging
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal, get_args

import numpy as np
from mpi4py import MPI

from antiosc import band as bands
from antiosc.checks import choice, flag, instance, positive, whole, within_range
from antiosc.errors import AccuracyError, AccuracyWarning, InputError, warn
from antiosc.fem import parallel
from antiosc.fem.algebra import Array, dot, multiply
from antiosc.fem.krylov import CHUNK, by_krylov
from antiosc.fem.modes import Modes, ModeSolver
from antiosc.fem.site import Functional, Site, functionals
from antiosc.fem.static import StaticMode, static_modes
from antiosc.fem.structure import Structure
from antiosc.model import AntiOscillators
from antiosc.motion import Inertia
from antiosc.threads import one_thread

#: A constraint mode whose m_i is below this share of m_st cannot be seen from the site.
UNSEEN = 1e-8
#: Frequencies closer than this (relatively) are one repeated frequency: only Σm_i has a meaning.
REPEATED = 1e-6
#: Limits of the self-check, relative: residual, M-orthogonality, constraint, mass balance.
CHECK = 1e-6
#: A result off by up to this many times a limit is usable, and warned of; beyond it is refused.
USABLE = 100
#: That of the residual: rounding in K alone makes 1e-6 of Kφ where a mode on soft springs strains
#: little; its ω² is off by the square of it.
FORCES = 1e-5
#: ω² over the shift below which a mode is a mechanism: the shift has the size of the first elastic.
MECHANISM = 1e-9
#: A Ritz pair with a smaller residual (of forces, relative) is an antiresonance: its frequency is
#: then right to about the square of this.
CONVERGED = 1e-3
#: Of this many Krylov anti-oscillators the lowest is an antiresonance, or something is amiss.
SETTLED = 10
#: Anti-oscillators taken where the caller names no number, and the most that a band may take.
DEFAULT, MOST = 20, 400
#: Bytes of basis vectors that the sites worked on at once may fill.
SLICE = 5e8

Method = Literal["krylov", "modes"]

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class _Oscillators:
    """Anti-oscillators with their shapes ψ_i = c_i φ_i (rows of this rank, N)."""

    omega: Array
    m: Array
    psi: Array
    unseen: int
    merged: int


@parallel.collective()
@within_range
@one_thread()
def extract(
    structure: Structure,
    site: Site | Sequence[Site],
    n: int | None = None,
    method: Method = "krylov",
    tol: float = UNSEEN,
    *,
    band: float | None = None,
    accuracy: float = 1e-3,
    shapes: bool = True,
) -> Any:
    """The anti-oscillator model of a structure at a site, or the models at several.

    Parameters
    ----------
    structure : Structure
    site : Site or sequence of Site
        All sites share one factorization and are solved for together.
    n : int, optional
        Anti-oscillators wanted, 20 by default; with `band` the most that may be taken. Fewer come
        back where the structure has fewer that carry mass at the site.
    method : "krylov" or "modes"
        "krylov": the best Z(ω) for n solves; the lower anti-oscillators (`info["converged"]` of
        them) are antiresonances of the structure, the upper ones stand for all those above.
        "modes": the n lowest antiresonances, by SLEPc, as in the article.
    tol : float
        Share of m_st below which a mode counts as massless at the site; its mass stays in m0.
    band : float, optional
        Highest circular frequency of interest, rad/s (see `impact_band`): as many
        anti-oscillators are taken as bring the error of Z(ω) below it to `accuracy`.
    accuracy : float
        Largest |ΔZ|/|Z| over the band, at one per cent of damping; a bound, not an estimate.
    shapes : bool
        Keep the shapes that recover displacement fields, n + 1 vectors a site.

    Returns
    -------
    AntiOscillators, or a list of them for a sequence of sites
        With `info` on what was found, dropped and checked.

    Raises
    ------
    InputError
        A site off the structure or held by its supports, n above the dofs.
    NotConvergedError, AccuracyError
        A solver that failed, or a result that fails its own check.

    Notes
    -----
    Article (12), (15), (20), (23); with a rigid-body mode its section 3.3. The method "krylov":
    `antiosc.fem.krylov`.
    """
    sites = _sites(structure, site)
    flag("shapes", shapes)
    wish = _wish(structure, n, method, tol, band, accuracy)
    started = time.perf_counter()
    places = functionals(structure, sites)
    factored = "factorization" in structure.seconds
    structure.factorization  # noqa: B018  (timed on its own)
    spent = time.perf_counter() - started
    if not factored:
        spent -= structure.seconds["factorization"]
    models: list[AntiOscillators] = []
    width = _together(structure, wish)
    for first in range(0, len(places), width):
        models += _extracted(structure, places[first : first + width], wish, shapes, spent)
        if len(places) > width:
            log.info("extracted %d of %d sites", len(models), len(places))
    return models[0] if isinstance(site, Site) else models


def _sites(structure: Any, site: Any) -> list[Site]:
    """The sites as a list, once both arguments are what they should be."""
    instance("structure", structure, Structure, "a Structure")
    sites = list(site) if isinstance(site, list | tuple) else [site]
    for one in sites:
        instance("site", one, Site, "a Site(point, direction)")
    return sites


@dataclass(frozen=True)
class _Wish:
    """What the caller asked for, checked."""

    n: int
    method: Method
    tol: float
    band: float | None
    accuracy: float


def _wish(structure: Structure, n: Any, method: Any, tol: Any, band: Any, accuracy: Any) -> _Wish:
    choice("method", method, get_args(Method))
    if n is None:
        n = min(DEFAULT if band is None else MOST, structure.dofs - 1)
    n = whole("n", n, least=0 if band is None else 1)
    if n >= structure.dofs:
        raise InputError(
            f"n must be below the structure's {structure.dofs} dofs; got {n}: refine the mesh or "
            "ask for fewer anti-oscillators."
        )
    if band is not None:
        band = positive("band", band, "rad/s")
    return _Wish(n, method, positive("tol", tol), band, positive("accuracy", accuracy))


def _together(structure: Structure, wish: _Wish) -> int:
    """Sites that are worked on at once: as many as share SLICE bytes of basis vectors."""
    if wish.method == "modes":
        return 1
    columns = wish.n + 2 if wish.band is None else 2 * CHUNK
    return max(1, int(SLICE / (16 * columns * structure.K.getSize()[0])))


def _extracted(
    structure: Structure, places: list[Functional], wish: _Wish, shapes: bool, spent: float
) -> list[AntiOscillators]:
    """The models of a few sites."""
    started = time.perf_counter()
    statics = static_modes(structure, places)
    if wish.method == "krylov":
        found = by_krylov(structure, places, statics, wish.n, wish.tol, wish.band, wish.accuracy)
    else:
        found = [_observable(structure, places[0], statics[0], wish)]
    models: list[AntiOscillators] = []
    for where, static, (modes, error) in zip(places, statics, found, strict=True):
        oscillators = _oscillators(structure, static, modes, wish.tol)
        worst = _check(structure, where, static, modes, wish.method)
        seconds = {
            **structure.seconds,
            "site": spent,
            "modes": (time.perf_counter() - started) / (len(models) + 1),
        }
        model = _model(
            structure, where, static, _first(oscillators, wish.n), modes, worst, wish, seconds
        )
        if wish.band is not None and error is not None:
            model.info["band"] = {"top": wish.band, "error_bound": error}
        parallel.on_root(structure.comm, partial(_tell, model, wish))
        models.append(model if shapes else replace(model, shapes=None, hidden=None))
    return models


def _tell(model: AntiOscillators, wish: _Wish) -> None:
    """Warn of frequencies that have not settled, of a band not reached, or one that holds none."""
    if model.info["converged"] == 0 and model.n >= SETTLED:
        warn(
            f"none of the {model.n} anti-oscillators has settled on an antiresonance: their "
            "frequencies are not to be trusted; some part may be very slender.",
            AccuracyWarning,
        )
    if wish.band is None or "band" not in model.info:
        return
    error = model.info["band"]["error_bound"]
    if error > wish.accuracy:
        warn(
            f"{model.n} anti-oscillators know Z up to {wish.band:g} rad/s to {error:.1e}, not to "
            f"the accuracy {wish.accuracy:g} asked: raise n or lower the band.",
            AccuracyWarning,
        )
    elif model.n and wish.band < model.omega[0]:
        warn(
            f"the band ends at {wish.band:g} rad/s, below the first antiresonance "
            f"{model.omega[0]:g} rad/s: the model is little more than its static stiffness and "
            "mass; raise the band if the impact is shorter than that.",
            AccuracyWarning,
        )


def _observable(
    structure: Structure, where: Functional, static: StaticMode, wish: _Wish
) -> tuple[Modes, float | None]:
    """Constraint modes from below until n of them carry mass (or Z is known over the band)."""
    solver = ModeSolver(structure, where, static)
    n = wish.n
    asked = n + 2 if n and wish.band is None else min(n, DEFAULT)
    while True:
        modes = solver.lowest(asked)
        found = _oscillators(structure, static, modes, wish.tol)
        left = static.mass - float(found.m.sum())
        error = None if wish.band is None else _left_out(static, found, left, wish.band)
        enough = len(found.m) > n or left <= wish.tol * static.mass or modes.complete
        if enough or asked >= solver.limit or n == 0:
            return modes, error
        if error is not None and error <= wish.accuracy:
            return modes, error
        asked = min(solver.limit, len(modes.omega) + max(8, n // 2))


def _left_out(static: StaticMode, found: _Oscillators, left: float, band: float) -> float:
    """Bound on |ΔZ|/|Z| over the band when mass `left` hangs on poles above those found."""
    poles = found.omega**2
    lowest = bands.lowest_frequency(static.k0, static.mass, found.omega)
    x = bands.samples(band, lowest) ** 2
    hung = np.sum(found.m * poles / (poles - x[:, None]), axis=1)
    stiffness = static.k0 - x * left - x * hung
    top = poles[-1] if len(poles) else 0.0
    nearest = np.where(x.real > top, x.imag, np.abs(top - x))
    return float(np.max(np.abs(x) ** 2 * left / nearest / np.abs(stiffness)))


def _oscillators(
    structure: Structure, static: StaticMode, modes: Modes, tol: float
) -> _Oscillators:
    """m_i = (φ_stᵀMφ_i)² of M-orthonormal modes (Article (12)), repeated frequencies merged."""
    c = dot(structure.comm, modes.phi, static.m_phi)
    m = c**2
    # ω = 0 is left only by rounding: rigid modes that vanish at the site are deflated.
    seen = (m > tol * static.mass) & (modes.omega > 0)
    omega, c = modes.omega[seen], c[seen]
    psi = modes.phi[:, seen] * c
    if not len(omega):
        return _Oscillators(omega, c**2, psi, int(np.sum(~seen)), 0)
    start = np.flatnonzero(np.diff(omega, prepend=-np.inf) > REPEATED * omega)
    masses = np.add.reduceat(c**2, start)
    stiffnesses = np.add.reduceat(c**2 * omega**2, start)
    return _Oscillators(
        np.sqrt(stiffnesses / masses),
        masses,
        np.add.reduceat(psi, start, axis=1),
        int(np.sum(~seen)),
        len(omega) - len(start),
    )


def _first(found: _Oscillators, n: int) -> _Oscillators:
    return _Oscillators(found.omega[:n], found.m[:n], found.psi[:, :n], found.unseen, found.merged)


def _check(
    structure: Structure, where: Functional, static: StaticMode, modes: Modes, method: Method
) -> dict[str, Any]:
    """Measure the modes against what they must satisfy; AccuracyError far beyond CHECK.

    Ritz pairs need no small residual, but are orthogonal through K as well as through M.
    """
    comm, phi = structure.comm, modes.phi
    if len(modes.omega) and modes.omega[0] ** 2 < MECHANISM * structure.shift:
        raise AccuracyError(
            f"the structure moves without strain (ω = {modes.omega[0]:.1e} rad/s) though not as a "
            "rigid body: some part hangs on a hinge, where pieces meet in one point or line; join "
            "it."
        )
    k_phi, m_phi = multiply(structure.K, phi), multiply(structure.M, phi)
    # The constraint's reaction μ b balances K φ - ω²M φ at the site: φ_stᵀb = 1 gives μ.
    residual = k_phi - m_phi * modes.omega**2
    reaction = dot(comm, static.phi, residual)
    residual = residual - np.outer(where.b, reaction)
    sizes = structure.factorization.force_sizes(np.hstack([residual, k_phi]))
    left, size = np.split(sizes, 2)
    off = left / np.maximum(size, np.finfo(float).tiny)
    gram = dot(comm, phi, m_phi)
    b_norm = np.sqrt(dot(comm, where.b, where.b))
    amplitudes = np.sqrt(comm.allreduce(np.einsum("ij,ij->j", phi, phi)))
    total = float(np.sum(dot(comm, phi, static.m_phi) ** 2))
    if method == "krylov":
        stiffness = dot(comm, phi, k_phi) - np.diag(modes.omega**2)
        scale = np.sqrt(modes.omega**2 + structure.shift)
        own = {"projection": float(np.abs(stiffness / np.outer(scale, scale)).max(initial=0.0))}
    else:
        own = {"residual": float(off.max(initial=0.0))}
    strain = float(dot(comm, static.phi, multiply(structure.K, static.phi)))
    measured = {
        **own,
        "orthogonality": float(np.abs(gram - np.eye(len(gram))).max(initial=0.0)),
        "constraint": float(
            (np.abs(dot(comm, phi, where.b)) / (b_norm * amplitudes)).max(initial=0.0)
        ),
        "mass": max(0.0, total / static.mass - 1),
        "stiffness": abs(strain / static.k0 - 1) if static.k0 else 0.0,
    }
    for name, value in measured.items():
        _judge(name, value, FORCES if name == "residual" else CHECK, comm)
    return {**measured, "converged": int(np.sum(off < CONVERGED))}


def _judge(name: str, value: float, limit: float, comm: MPI.Comm) -> None:
    """Pass a measured error, warn of it, or refuse it."""
    if value <= limit:
        return
    why = (
        "the matrices are ill-conditioned by very slender or thin parts, penalties, very uneven "
        "elements or materials: take fewer elements, more even ones, smaller penalties."
    )
    if not value <= USABLE * limit:
        raise AccuracyError(
            f"the constraint modes fail their own check: {name} {value:.1e}, limit "
            f"{USABLE * limit:.0e}; {why}"
        )
    parallel.warn(
        comm,
        f"the constraint modes meet their own check to {value:.1e} only ({name}, usually below "
        f"{limit:.0e}): {why}",
        AccuracyWarning,
    )


def _model(
    structure: Structure,
    where: Functional,
    static: StaticMode,
    found: _Oscillators,
    modes: Modes,
    checks: dict[str, Any],
    wish: _Wish,
    seconds: dict[str, float],
) -> AntiOscillators:
    m0 = static.mass - float(found.m.sum())
    if abs(m0) <= 1e-12 * static.mass:
        m0 = 0.0
    info: dict[str, Any] = {
        "structure": structure.describe(),
        "dofs": structure.dofs,
        "method": wish.method,
        "modes_computed": len(modes.omega),
        "converged": checks.pop("converged"),
        "modes_unseen": found.unseen,
        "modes_merged": found.merged,
        "rigid_modes": int(structure.rigid_modes.shape[1]),
        "checks": checks,
        "seconds": seconds,
    }
    if where.point is not None and where.direction is not None:
        info["point"] = where.point.tolist()
        info["direction"] = where.direction.tolist()
    return AntiOscillators(
        m0=m0,
        k0=static.k0,
        m=found.m,
        omega=found.omega,
        local_compliance=where.local_compliance,
        radius=where.radius,
        participation=_participation(structure, where, static, found),
        shapes=np.column_stack([static.phi, found.psi]),
        direction=where.direction,
        inertia=inertia_of(structure, static.phi[:, None], found.psi, static.still),
        hidden=static.still if structure.rigid_inertia is not None else None,
        info=info,
    )


def _participation(
    structure: Structure, where: Functional, static: StaticMode, found: _Oscillators
) -> Array | None:
    """φ_0ᵀMe and ψ_iᵀMe for e, the unit uniform acceleration along the impact; Σ = φ_stᵀMe."""
    weight = uniform_inertia(structure, where)
    if weight is None:
        return None
    own = np.asarray(dot(structure.comm, found.psi, weight))
    whole_shape = float(dot(structure.comm, static.phi, weight))
    return np.concatenate([[whole_shape - own.sum()], own])


def inertia_of(structure: Structure, *shapes: Array) -> Inertia | None:
    """The inertia of a body that can move as a whole, with the momentum of these shapes."""
    if structure.rigid_inertia is None:
        return None
    inertia, loads = structure.rigid_inertia
    return inertia.along(np.vstack([dot(structure.comm, block, loads) for block in shapes]))


def uniform_inertia(structure: Structure, where: Functional) -> Array | None:
    """Me on the rows of this rank; None for matrices, which do not tell where e points."""
    return None if where.direction is None else structure.uniform_inertia(where.direction)
