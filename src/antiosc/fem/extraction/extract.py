"""`extract`: the anti-oscillators of a structure at a site."""

from __future__ import annotations

import logging
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from antiosc._types import Array
from antiosc.checks import choice, flag, instance, positive, tolerance, whole, within_range
from antiosc.errors import AccuracyError, AccuracyWarning, InputError, warn
from antiosc.fem import mpi
from antiosc.fem.extraction.eigenmodes import Modes, ModeSolver
from antiosc.fem.extraction.krylov import BASIS_STEP, Remainder, by_krylov
from antiosc.fem.extraction.oscillators import (
    Found,
    Oscillators,
    error_bound,
    left_out,
    lumped,
    oscillators,
    wanted,
)
from antiosc.fem.extraction.static_mode import StaticMode, static_modes
from antiosc.fem.linalg import memory
from antiosc.fem.linalg.algebra import dot, multiply
from antiosc.fem.site.functionals import functionals
from antiosc.fem.site.site import Functional, Site
from antiosc.fem.structure.structure import Structure
from antiosc.models import driving_point as bands
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.motion import Inertia
from antiosc.threads import one_thread

if TYPE_CHECKING:
    from mpi4py import MPI

#: Limits of the self-check, relative: residual, M-orthogonality, constraint, mass balance.
CHECK = 1e-6
#: Up to this many times a limit a result is usable, with a warning; beyond, it is refused.
USABLE = 100
#: Limit of the residual: rounding in K alone is 1e-6 of Kφ for a mode on soft springs, with little
#: strain; the error of ω² is the square of it.
FORCES = 1e-5
#: ω² over the shift below which a mode is a mechanism: the shift has the size of the first elastic.
MECHANISM = 1e-9
#: A Ritz pair with a smaller residual (of forces, relative) is an antiresonance: its frequency is
#: then right to about the square of this.
CONVERGED = 1e-3
#: With this many Krylov anti-oscillators the lowest must have converged to an antiresonance.
SETTLED_FROM = 10
#: Default number of anti-oscillators, and the largest number with a band.
DEFAULT, MOST_FOR_BAND = 20, 400
#: Largest number of modes computed for each one wanted: a site with fewer observable ones gets
#: fewer.
SEARCHED = 10
#: Goal of the Krylov steps over the accuracy wanted: the bound of the finished model is sampled
#: more finely and includes the dropped modes.
AIM = 0.6
#: Bytes of basis vectors of the sites that are processed at once.
SLICE = 5e8

Method = Literal["krylov", "modes"]

log = logging.getLogger(__name__)


@mpi.collective()
@within_range
@one_thread()
def extract(
    structure: Structure,
    site: Site | Sequence[Site],
    n: int | None = None,
    method: Method = "krylov",
    tol: float = bands.UNOBSERVABLE,
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
        All sites share one factorization and blocks of right-hand sides.
    n : int, optional
        Number of anti-oscillators, default 20; with `band` the largest number. The result has fewer
        if the structure has fewer observable modes at the site.
    method : "krylov" or "modes"
        "krylov": the most accurate Z(ω) for n solves. The lower anti-oscillators
        (`info["converged"]` of them) have converged to antiresonances of the structure; the upper
        ones represent all higher antiresonances. "modes": the n lowest antiresonances, by SLEPc, as
        in the article.
    tol : float
        Share in |Z| at the frequency of a mode, at 1 % damping, below which the mode is
        unobservable; its mass is added to m0.
    band : float, optional
        Highest circular frequency of interest, rad/s (see `impact_band`). The number of
        anti-oscillators is chosen so that the error of Z(ω) up to this frequency is at most
        `accuracy`.
    accuracy : float
        Largest |ΔZ|/|Z| over the band, at 1 % damping. `info["band"]["error_bound"]` is the bound
        that was reached, including truncation and rounding.
    shapes : bool
        Store the shapes, from which displacement fields are computed, n + 1 vectors for each site.

    Returns
    -------
    AntiOscillators, or a list of them for a sequence of sites
        `info` holds the numbers of modes that were found and dropped, and the checks. If the share
        of the rigid-body modes in the compliance of the site ("rigid_share") is below 1e-4, they
        are represented by an anti-oscillator of nearly zero frequency; below 1e-16 they are left
        out, and k0 > 0.

    Raises
    ------
    InputError
        A site off the structure or fixed by its supports; n not below the number of dofs.
    NotConvergedError, AccuracyError
        A solver that failed, or a result that fails its own check.

    Notes
    -----
    Article (12), (15), (20), (23); with a rigid-body mode its section 3.3. The method "krylov":
    `antiosc.fem.extraction.krylov`.
    """
    sites = _sites(structure, site)
    flag("shapes", shapes)
    wish = _wish(structure, n, method, tol, band, accuracy)
    started = time.perf_counter()
    targets = functionals(structure, sites)
    factored = "factorization" in structure.seconds
    structure.factorize()
    spent = time.perf_counter() - started
    if not factored:
        spent -= structure.seconds["factorization"]
    models: list[AntiOscillators] = []
    width = _together(structure, wish)
    for first in range(0, len(targets), width):
        models += _extracted(structure, targets[first : first + width], wish, shapes, spent)
        if len(targets) > width:
            log.info("extracted %d of %d sites", len(models), len(targets))
    return models[0] if isinstance(site, Site) else models


def _sites(structure: Any, site: Any) -> list[Site]:
    """The sites as a list, after a check of both arguments."""
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
        n = min(DEFAULT if band is None else MOST_FOR_BAND, structure.dofs - 1)
    n = whole("n", n, least=0 if band is None else 1)
    if n >= structure.dofs:
        raise InputError(
            f"n must be below the structure's {structure.dofs} dofs; got {n}: refine the mesh or "
            "ask for fewer anti-oscillators."
        )
    need = 16 * (n + 2) * structure.rows
    free = mpi.on_root(structure.comm, memory.free_memory) / structure.comm.size
    if band is None and need > memory.MEMORY_SHARE * free:
        raise InputError(
            f"n = {n} anti-oscillators of {structure.size} dofs take {need / 1e9:.3g} GB "
            f"of basis vectors and {free / 1e9:.3g} GB are free: reduce n."
        )
    if band is not None:
        band = positive("band", band, "rad/s")
    return _Wish(n, method, tolerance(tol), band, positive("accuracy", accuracy))


def _together(structure: Structure, wish: _Wish) -> int:
    """Number of sites processed at once: as many as fit in SLICE bytes of basis vectors."""
    if wish.method == "modes":
        return 1
    columns = wish.n + 2 if wish.band is None else 2 * BASIS_STEP
    return max(1, int(SLICE / (16 * columns * structure.size)))


def _extracted(
    structure: Structure, targets: list[Functional], wish: _Wish, shapes: bool, spent: float
) -> list[AntiOscillators]:
    """The models of a few sites."""
    started = time.perf_counter()
    statics = static_modes(structure, targets)
    if wish.method == "krylov":
        counts = [wanted(static, wish.n) for static in statics]
        found = by_krylov(
            structure, targets, statics, counts, wish.tol, wish.band, AIM * wish.accuracy
        )
    else:
        found = [_observable(structure, targets[0], statics[0], wish)]
    models: list[AntiOscillators] = []
    for target, static, (modes, remainder) in zip(targets, statics, found, strict=True):
        known = lumped(structure, static, modes)
        kept = oscillators(known, wish.n, wish.tol)
        worst = _check(structure, target, known, wish.method)
        seconds = {
            **structure.seconds,
            "site": spent,
            "modes": (time.perf_counter() - started) / (len(models) + 1),
        }
        model = _model(structure, target, known, kept, worst, wish, seconds)
        if wish.band is not None and remainder is not None:
            error = error_bound(structure, known, remainder, kept, wish.band)
            model.info["band"] = {"top": wish.band, "error_bound": error}
        mpi.on_root(structure.comm, partial(_tell, model, wish, modes.complete))
        models.append(model if shapes else replace(model, shapes=None, hidden=None))
    return models


def _tell(model: AntiOscillators, wish: _Wish, complete: bool) -> None:
    """Warn of too few modes, of frequencies that have not converged, and of a band not reached or
    too low."""
    if wish.band is None and model.n < wish.n and not complete:
        warn(
            f"only {model.n} of the first {model.info['modes_computed']} modes are observable at "
            f"the site (share in Z above {wish.tol:g}), fewer than n = {wish.n}: the model "
            "contains these; reduce tol for more.",
            AccuracyWarning,
        )
    if model.info["converged"] == 0 and model.n >= SETTLED_FROM:
        warn(
            f"none of the {model.n} anti-oscillators has converged to an antiresonance: their "
            "frequencies are unreliable; check whether some part is very slender.",
            AccuracyWarning,
        )
    if wish.band is None or "band" not in model.info:
        return
    error = model.info["band"]["error_bound"]
    if not error <= wish.accuracy:
        warn(
            f"with {model.n} anti-oscillators the error of Z up to {wish.band:g} rad/s is at most "
            f"{error:.1e}, above accuracy = {wish.accuracy:g}: raise n or lower the band.",
            AccuracyWarning,
        )
    elif model.n and wish.band < model.omega[0]:
        warn(
            f"the band ends at {wish.band:g} rad/s, below the first antiresonance "
            f"{model.omega[0]:g} rad/s: the model consists almost only of its static stiffness "
            "and mass; raise the band if the impact is shorter.",
            AccuracyWarning,
        )


def _observable(
    structure: Structure, target: Functional, static: StaticMode, wish: _Wish
) -> tuple[Modes, Remainder | None]:
    """The lowest constraint modes until n of them are observable (or the error of Z meets the
    bound)."""
    solver = ModeSolver(structure, target, static)
    n = wanted(static, wish.n)
    most = min(solver.limit, SEARCHED * (n + DEFAULT))
    asked = n + 2 if n and wish.band is None else min(n, DEFAULT)
    while True:
        modes = solver.lowest(asked)
        known = lumped(structure, static, modes)
        kept = oscillators(known, wish.n, wish.tol)
        remainder = None if wish.band is None else left_out(known)
        if modes.complete or asked >= most or n == 0:
            return modes, remainder
        if remainder is None or wish.band is None:
            if len(kept.chain[2]) >= n or known.m0 == 0:
                return modes, None
        elif len(kept.chain[2]) >= n or (
            error_bound(structure, known, remainder, kept, wish.band) <= wish.accuracy
        ):
            return modes, remainder
        asked = min(most, len(modes.omega) + max(8, len(modes.omega) // 2))


def _check(
    structure: Structure, target: Functional, known: Found, method: Method
) -> dict[str, Any]:
    """Check the modes against their equations; AccuracyError far beyond CHECK.

    Ritz pairs may have large residuals, but must be orthogonal in K and in M.
    """
    static, modes = known.static, known.modes
    comm, phi, k_phi, m_phi = structure.comm, modes.phi, known.k_phi, known.m_phi
    if len(modes.omega) and modes.omega[0] ** 2 < MECHANISM * structure.shift:
        raise AccuracyError(
            f"the structure moves without strain (ω = {modes.omega[0]:.1e} rad/s) but not as a "
            "rigid body: some part is attached by a hinge, a single common point or line; join it "
            "along a face."
        )
    # The constraint's reaction μ b balances K φ - ω²M φ at the site: φ_stᵀb = 1 gives μ.
    residual = k_phi - m_phi * modes.omega**2
    reaction = dot(comm, static.phi, residual)
    residual = residual - np.outer(static.load, reaction)
    sizes = structure.factorize().force_sizes(np.hstack([residual, k_phi]))
    left, size = np.split(sizes, 2)
    off = left / np.maximum(size, np.finfo(float).tiny)
    gram = known.masses
    b_norm = np.sqrt(dot(comm, target.b, target.b))
    amplitudes = np.sqrt(comm.allreduce(np.einsum("ij,ij->j", phi, phi)))
    total = float(np.sum(known.c**2))
    if method == "krylov":
        stiffness = known.stiffnesses - np.diag(modes.omega**2)
        scale = np.sqrt(modes.omega**2 + structure.shift)
        own = {"projection": float(np.abs(stiffness / np.outer(scale, scale)).max(initial=0.0))}
    else:
        own = {"residual": float(off.max(initial=0.0))}
    strain = float(dot(comm, static.phi, multiply(structure.K, static.phi)))
    measured = {
        **own,
        "orthogonality": float(np.abs(gram - np.eye(len(gram))).max(initial=0.0)),
        "constraint": float(
            (np.abs(dot(comm, phi, target.b)) / (b_norm * amplitudes)).max(initial=0.0)
        ),
        "mass": max(0.0, total / static.mass - 1),
        "stiffness": abs(strain / static.k0 - 1) if static.k0 else 0.0,
    }
    for name, value in measured.items():
        _judge(name, value, FORCES if name == "residual" else CHECK, comm)
    return {**measured, "converged": int(np.sum(off < CONVERGED))}


def _judge(name: str, value: float, limit: float, comm: MPI.Comm) -> None:
    """Accept a measured error, warn of it, or refuse it."""
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
    mpi.warn(
        comm,
        f"the constraint modes satisfy their check only to {value:.1e} ({name}, usually below "
        f"{limit:.0e}): {why}",
        AccuracyWarning,
    )


def _model(
    structure: Structure,
    target: Functional,
    known: Found,
    kept: Oscillators,
    checks: dict[str, Any],
    wish: _Wish,
    seconds: dict[str, float],
) -> AntiOscillators:
    modes, added = known.modes, len(kept.m) - len(kept.chain[2])
    info: dict[str, Any] = {
        "structure": structure.describe(),
        "dofs": structure.dofs,
        "method": wish.method,
        "modes_computed": len(modes.omega),
        "converged": checks.pop("converged") + added,
        "modes_unobservable": kept.unobservable,
        "modes_merged": kept.merged,
        "rigid_modes": int(structure.rigid_modes.shape[1]),
        "rigid_share": known.static.share,
        "checks": checks,
        "seconds": seconds,
    }
    if target.point is not None and target.direction is not None:
        info["point"] = target.point.tolist()
        info["direction"] = target.direction.tolist()
    weight = uniform_inertia(structure, target)
    parts = np.column_stack([kept.residual, kept.psi])
    shapes = np.column_stack([parts.sum(axis=1), kept.psi])
    return AntiOscillators(
        m0=kept.m0,
        k0=kept.k0,
        m=kept.m,
        omega=kept.omega,
        local_compliance=target.local_compliance,
        radius=target.radius,
        participation=None if weight is None else np.asarray(dot(structure.comm, parts, weight)),
        shapes=shapes,
        direction=target.direction,
        inertia=inertia_of(structure, shapes, kept.hidden),
        hidden=kept.hidden if structure.rigid_inertia is not None else None,
        info=info,
    )


def inertia_of(structure: Structure, *shapes: Array) -> Inertia | None:
    """The inertia of a body that can move as a whole, with the momentum of these shapes."""
    if structure.rigid_inertia is None:
        return None
    inertia, loads = structure.rigid_inertia
    return inertia.along(np.vstack([dot(structure.comm, block, loads) for block in shapes]))


def uniform_inertia(structure: Structure, target: Functional) -> Array | None:
    """Me on the rows of this rank; None for matrices, which have no coordinates."""
    return None if target.direction is None else structure.uniform_inertia(target.direction)
