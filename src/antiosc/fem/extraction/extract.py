"""`extract`: the anti-oscillators of a structure at a site."""

from __future__ import annotations

import logging
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from antiosc.checks import flag, within_range
from antiosc.fem import mpi
from antiosc.fem.extraction.body_inertia import inertia_of, uniform_inertia
from antiosc.fem.extraction.dampers import damped, refuse_dampers
from antiosc.fem.extraction.eigenmodes import Modes, ModeSolver
from antiosc.fem.extraction.krylov import by_krylov
from antiosc.fem.extraction.oscillators import (
    Found,
    Oscillators,
    error_bound,
    left_out,
    lumped,
    oscillators,
    wanted,
)
from antiosc.fem.extraction.ritz_basis import BASIS_STEP, Remainder
from antiosc.fem.extraction.self_check import checked_modes
from antiosc.fem.extraction.several_sites import of_several_sites
from antiosc.fem.extraction.static_mode import StaticMode, static_modes
from antiosc.fem.extraction.wish import (
    DEFAULT_COUNT,
    SEARCHED,
    STEP_AIM,
    ErrorWish,
    Method,
    Wish,
    checked_sites,
    checked_wish,
    tell,
)
from antiosc.fem.linalg.algebra import dot, multiply
from antiosc.fem.site.functionals import functionals
from antiosc.fem.site.site import Functional, Site
from antiosc.fem.structure.structure import Structure
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.modal import Damping, as_damping
from antiosc.threads import one_thread

if TYPE_CHECKING:
    from antiosc.fem.error.model_errors import ModelErrors

#: Bytes of basis vectors of the sites that are processed at once.
SLICE = 5e8

log = logging.getLogger(__name__)


@overload
def extract(
    structure: Structure,
    site: Site | Mapping[str, Site],
    n: int | None = None,
    method: Method = "krylov",
    tol: float | None = None,
    *,
    band: float | None = None,
    accuracy: float = 1e-3,
    shapes: bool = True,
    error: ErrorWish = None,
    damping: float | Sequence[float] | Damping | None = None,
) -> AntiOscillators: ...
@overload
def extract(
    structure: Structure,
    site: Sequence[Site],
    n: int | None = None,
    method: Method = "krylov",
    tol: float | None = None,
    *,
    band: float | None = None,
    accuracy: float = 1e-3,
    shapes: bool = True,
    error: ErrorWish = None,
    damping: float | Sequence[float] | Damping | None = None,
) -> list[AntiOscillators]: ...
@mpi.collective()
@within_range
@one_thread()
def extract(
    structure: Structure,
    site: Site | Sequence[Site] | Mapping[str, Site],
    n: int | None = None,
    method: Method = "krylov",
    tol: float | None = None,
    *,
    band: float | None = None,
    accuracy: float = 1e-3,
    shapes: bool = True,
    error: ErrorWish = None,
    damping: float | Sequence[float] | Damping | None = None,
) -> AntiOscillators | list[AntiOscillators]:
    """The anti-oscillator model of a structure at a site, or at several.

    Parameters
    ----------
    structure : Structure
    site : Site, sequence of Site, or mapping of names to Site
        A mapping gives one model with several sites, which a `Scene` takes. A sequence gives one
        model for each site; all share one factorization and blocks of right-hand sides.
    n : int, optional
        Number of anti-oscillators, default 20; with `band` the largest number. The result has fewer
        if the structure has fewer observable modes at the site.
    method : "krylov" or "modes"
        "krylov": the most accurate Z(ω) for n solves. The lower anti-oscillators
        (`info["converged"]` of them) have converged to antiresonances of the structure; the upper
        ones represent all higher antiresonances. "modes": the n lowest antiresonances, by SLEPc, as
        in the article.
    tol : float, optional
        Share in |Z| at the frequency of a mode, at 1 % damping, below which the mode is
        unobservable: it is not counted, and its mass is added to m0. Default: a hundredth of
        `accuracy`. At a site of symmetry an uneven mesh gives every mode that the symmetry hides a
        little mass.
    band : float, optional
        Highest circular frequency of interest, rad/s (see `impact_band`). The number of
        anti-oscillators is chosen so that the error of Z(ω) up to this frequency is at most
        `accuracy`.
    accuracy : float
        Largest |ΔZ|/|Z| over the band, at 1 % damping. `info["band"]["error_bound"]` is the bound
        that was reached, including truncation and rounding. Of several sites: the largest relative
        error of their displacements under any forces, in units in which their compliances are the
        identity, ‖H ΔZ‖₂, from `info["band"]["bottom"]` [rad/s] on.
    shapes : bool
        Store the shapes, from which displacement fields are computed, n + 1 vectors for each site.
    error : "estimate", optional
        Estimate what the mesh leaves out: the model gets its `strain_error`, so that `corrected()`
        and the `error_budget` of a `simulate` are available. Solids, beams, shells of triangles; no
        named sites. It takes at most one further solve (of beams one on a mesh of half the size).
    damping : float, sequence of float, or Damping, optional
        Damping ratio of all elastic free modes of the model, ratios of the modes in ascending order
        (the last one for all higher modes), or a `Damping`.

    Returns
    -------
    AntiOscillators, or a list of them for a sequence of sites
        A site that cannot move independently of those before it (a second site on a rigid part,
        say) follows them: `dependence` of the model.
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
    sites = checked_sites(structure, site)
    names = list(site) if isinstance(site, Mapping) else []
    flag("shapes", shapes)
    wish = checked_wish(structure, n, method, tol, band, accuracy, error)
    given = as_damping(damping)
    if given is not None:
        refuse_dampers(structure, "damping=")
    errors = None if error is None else _model_errors(structure, len(names))
    started = time.perf_counter()
    targets = functionals(structure, sites)
    factored = "factorization" in structure.seconds
    structure.factorize()
    spent = time.perf_counter() - started
    if not factored:
        spent -= structure.seconds["factorization"]
    if names:
        named = {n: [one, *one.across] for n, one in zip(names, targets, strict=True)}
        return damped(structure, of_several_sites(structure, named, wish, shapes), given)
    models: list[AntiOscillators] = []
    width = _together(structure, wish)
    for first in range(0, len(targets), width):
        some = targets[first : first + width]
        models += _extracted(structure, some, wish, shapes, spent, errors)
        if len(targets) > width:
            log.info("extracted %d of %d sites", len(models), len(targets))
    models = [damped(structure, model, given) for model in models]
    return models[0] if isinstance(site, Site) else models


def _model_errors(structure: Structure, named_sites: int) -> ModelErrors:
    """The estimates of models; their modules need meshes, which given matrices do without."""
    from antiosc.fem.error.model_errors import ModelErrors

    return ModelErrors(structure, named_sites)


def _together(structure: Structure, wish: Wish) -> int:
    """Number of sites processed at once: as many as fit in SLICE bytes of basis vectors."""
    if wish.method == "modes":
        return 1
    columns = wish.n + 2 if wish.band is None else 2 * BASIS_STEP
    return max(1, int(SLICE / (16 * columns * structure.size)))


def _extracted(
    structure: Structure,
    targets: list[Functional],
    wish: Wish,
    shapes: bool,
    spent: float,
    errors: ModelErrors | None,
) -> list[AntiOscillators]:
    """The models of a few sites."""
    started = time.perf_counter()
    statics = static_modes(structure, targets)
    if wish.method == "krylov":
        counts = [wanted(static, wish.n) for static in statics]
        found = by_krylov(structure, statics, counts, wish.tol, wish.band, STEP_AIM * wish.accuracy)
    else:
        found = [_observable(structure, targets[0], statics[0], wish)]
    models: list[AntiOscillators] = []
    for target, static, (modes, remainder) in zip(targets, statics, found, strict=True):
        known = lumped(structure, static, modes)
        kept = oscillators(known, wish.n, wish.tol)
        worst = _checked(structure, target, known, wish.method)
        seconds = {
            **structure.seconds,
            "site": spent,
            "modes": (time.perf_counter() - started) / (len(models) + 1),
        }
        model = _model(structure, target, known, kept, worst, wish, seconds)
        if wish.band is not None and remainder is not None:
            error = error_bound(structure, known, remainder, kept, wish.band)
            model.info["band"] = {"top": wish.band, "error_bound": error}
        if errors is not None:
            model = errors.added_to(model, target)
        mpi.on_root(structure.comm, partial(tell, model, wish, modes.complete))
        models.append(model if shapes else replace(model, shapes=None, hidden=None))
    return models


def _observable(
    structure: Structure, target: Functional, static: StaticMode, wish: Wish
) -> tuple[Modes, Remainder | None]:
    """The lowest constraint modes until n of them are observable (or the error of Z meets the
    bound)."""
    solver = ModeSolver(structure, static)
    n = wanted(static, wish.n)
    most = min(solver.limit, SEARCHED * (n + DEFAULT_COUNT))
    asked = n + 2 if n and wish.band is None else min(n, DEFAULT_COUNT)
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


def _checked(
    structure: Structure, target: Functional, known: Found, method: Method
) -> dict[str, float]:
    """The check of the modes of one site (`checked_modes`)."""
    static = known.static
    strain = float(dot(structure.comm, static.phi, multiply(structure.K, static.phi)))
    return checked_modes(
        structure,
        known,
        method,
        b=target.b[:, None],
        load=static.load[:, None],
        phi=static.phi[:, None],
        mass=np.array([[static.mass]]),
        stiffness=abs(strain / static.k0 - 1) if static.k0 else 0.0,
    )


def _model(
    structure: Structure,
    target: Functional,
    known: Found,
    kept: Oscillators,
    checks: dict[str, Any],
    wish: Wish,
    seconds: dict[str, float],
) -> AntiOscillators:
    modes, added = known.modes, len(kept.m) - len(kept.chain[2])
    info: dict[str, Any] = {
        "structure": structure.describe(),
        "dofs": structure.dofs,
        "meshed": structure.matrices.meshed,
        **structure.matrices.plausibility,
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
