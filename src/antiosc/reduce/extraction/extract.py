"""`extract`: the anti-oscillators of a structure at one site, or at several."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import inf
from typing import TYPE_CHECKING, Any, Literal, get_args, overload

import numpy as np

from antiosc.base import checks, process
from antiosc.base.checks import choice, flag, instance, positive, tolerance, whole, within_range
from antiosc.base.errors import AccuracyWarning, InputError, finite_element_packages, warn
from antiosc.base.process import one_thread
from antiosc.base.texts import engineering
from antiosc.fem.linalg.solver import SOLVES_OF_MODEL, Solver, bytes_of_shells
from antiosc.fem.platform import collective, on_root
from antiosc.fem.structure.structure import Structure, refuse_dampers
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.modal import Damping, as_damping
from antiosc.models.stretch import Count, checked_count
from antiosc.reduce.extraction import site_shapes
from antiosc.reduce.extraction.eigenmodes import EQUIVALENT_SITES
from antiosc.reduce.extraction.krylov import by_krylov
from antiosc.reduce.extraction.model import (
    DEFAULT_COUNT,
    UNNAMED_SITE,
    Remainder,
    Sites,
    by_modes,
    constraint_modes,
    error_bound,
    info_of_model,
    model_of,
    select_lowest,
    select_observable,
    with_damping,
)
from antiosc.reduce.extraction.stretching import pair_count, with_stretch
from antiosc.reduce.site import functionals, surfaces
from antiosc.reduce.site.site import Site

if TYPE_CHECKING:
    from antiosc.reduce.error.model_errors import ModelErrors


#: Largest number of anti-oscillators with a band.
MOST_BAND_MODES = 400
#: Goal of the steps over the accuracy: the bound of the model has more samples, and dropped modes.
STEP_ACCURACY = 0.6
#: Number of Krylov anti-oscillators from which the lowest must be an antiresonance.
SETTLED_COUNT = 10

Method = Literal["krylov", "modes"]
ErrorOption = Literal["estimate"] | None


@dataclass(frozen=True)
class ExtractOptions:
    """The checked arguments of `extract`."""

    n: int  # number of anti-oscillators, with a band the largest
    method: Method
    tol: float  # share in |Z| below which a mode is unobservable
    band: float | None  # highest frequency of interest, rad/s
    accuracy: float  # largest |ΔZ|/|Z| over the band
    expansion: float | None = None  # frequency of the expansion point, Hz; None: static
    proof: bool = False  # whether to store the data of proved bounds
    error: ErrorOption = None  # "estimate": that of the mesh


def _model_at(
    structure: Structure,
    solver: Solver,
    expanded: tuple[Solver, float] | None,
    sites: Sites,
    options: ExtractOptions,
    spent: float,
    errors: ModelErrors | None,
) -> AntiOscillators:
    """The model of a group of sites. `solver` factorizes K + sM at the structure's shift;
    `expanded`: (solver, shift) at an expansion point; `spent`: time taken to find the sites [s]."""
    start_time = time.perf_counter()
    terms = structure.matrices.dissipation()
    refused = {
        'method="modes"': options.method == "modes",
        'error="estimate"': options.error is not None,
        "band=": options.band is not None,
        "proof=": options.proof,
    }
    for argument in (name for name, given in refused.items() if terms and given):
        raise InputError(f"{argument} does not take dampers, nor layers that relax: leave it out.")

    # the modes
    n, tol, band = options.n, options.tol, options.band
    around = surfaces(structure.matrices, sites)
    static = site_shapes(structure, solver, np.hstack([site.B for site in sites.values()]))
    remainder: Remainder | None = None
    if options.method == "krylov":
        shifted = static if expanded is None else static.at(*expanded)
        aim = STEP_ACCURACY * options.accuracy
        modes, remainder = by_krylov(structure, shifted, n, tol, band, aim, terms, options.proof)
    else:
        modes = by_modes(structure, static, n, tol)
    known = constraint_modes(structure, static, modes)
    selected = select_lowest(known, n) if terms else select_observable(known, n, tol)

    # the record
    info = info_of_model(structure, sites, known, selected, options.method)
    info = info.having(
        expansion=options.expansion,
        no_estimate=None if errors is None else errors.skipped or None,
        surfaces=around,
        seconds={**structure.seconds, "site": spent, "modes": time.perf_counter() - start_time},
    )

    if band is not None and remainder is not None:
        bound, lowest = error_bound(known, remainder, selected, band)
        ends = {"bottom": lowest / (2 * np.pi), "top": band / (2 * np.pi)}
        info = info.having(band={**ends, "error_bound": bound})
    complete = modes.complete
    recurrence = modes.recurrence
    del known, modes  # as large as the shapes

    # the model
    model = model_of(structure, sites, static, selected, info)
    model = replace(model, recurrence=recurrence)
    if terms or structure.matrices.has_loss_factor:
        model = with_damping(structure, model, static, terms)
    if errors is not None and options.error is not None:
        model = errors.added_to(model, sites, solver)
    on_root(structure.comm, partial(warn_of_shortfall, model, options, complete))
    return model


def warn_of_shortfall(model: AntiOscillators, options: ExtractOptions, complete: bool) -> None:
    """Warn of missing or unconverged modes, and of a band not reached or below the first mode."""
    if options.band is None and model.n < options.n and not complete:
        warn(
            f"only {model.n} of the first {model.info['modes_computed']} modes are observable at "
            f"the site (share in Z above {options.tol:g}), fewer than n = {options.n}: the model "
            "contains these; reduce tol for more.",
            AccuracyWarning,
        )

    settled = bool(model.info.converged) or model.n < SETTLED_COUNT or bool(options.expansion)
    if not settled and model.strain_error is None:  # else the bar of the truncation tells it
        warn(
            f"none of the {model.n} anti-oscillators has converged to an antiresonance, so that "
            "none of their frequencies is one of the part: take more anti-oscillators (n); if these"
            " do not help, a part is too slender for double precision: take fewer elements along "
            "it.",
            AccuracyWarning,
        )

    band = model.info.get("band")
    if options.band is None or band is None:
        return
    error = band["error_bound"]
    top = engineering(band["top"], "Hz")

    if not error <= options.accuracy:
        warn(
            f"with {model.n} anti-oscillators the error of Z up to {top} is at most {error:.1e}, "
            f"above accuracy = {options.accuracy:g}: raise n or lower the band, which is in Hz.",
            AccuracyWarning,
        )
    elif model.n and options.band < model.omega[0]:
        warn(
            f"the band ends at {top}, below the first antiresonance "
            f"{engineering(model.omega[0] / (2 * np.pi), 'Hz')}: the model consists almost only of "
            "its static stiffness and mass; raise the band if the impact is shorter.",
            AccuracyWarning,
        )


#: Least share in |Z| of an observable mode, over the required accuracy. On a clamped disc struck at
#: its centre, modes hidden by symmetry have up to 0.0094 of the default accuracy with shell
#: elements of a fifth of the radius, and 0.0001 with elements of a tenth; other modes have 500 and
#: more.
MIN_OBSERVABLE_SHARE = 0.01


@overload
def extract(
    structure: Structure, site: Site | Mapping[str, Site], *arguments: Any, **options: Any
) -> AntiOscillators: ...
@overload
def extract(
    structure: Structure, site: Sequence[Site], *arguments: Any, **options: Any
) -> list[AntiOscillators]: ...
@collective()
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
    error: ErrorOption = None,
    damping: float | Sequence[float] | Damping | None = None,
    stretch: Count | Literal[False] = False,
    expansion: float | None = None,
    proof: bool | float = False,
) -> AntiOscillators | list[AntiOscillators]:
    """The anti-oscillator model of a structure at a site, or at several.

    Parameters
    ----------
    structure : Structure
    site : Site, sequence of Site, or mapping of names to Site
        A mapping gives one model with several sites, which a `Scene` takes. A sequence gives one
        model for each site; all share one factorization.
    n : int, optional
        Number of anti-oscillators, default 20; with `band` the largest number. The model has fewer
        if fewer modes of the structure are observable at the site.
    method : "krylov" or "modes"
        "krylov": the most accurate Z(ω) for n solves. The lower anti-oscillators (`info.converged`
        of them) have converged to antiresonances of the structure; the upper ones represent all
        higher antiresonances. "modes": the n lowest antiresonances, by SLEPc, as in the article.
    tol : float, optional
        Share in |Z| at the frequency of a mode, at 1 % damping, below which the mode is
        unobservable: it is not counted, and its mass is added to m0. Default: a hundredth of
        `accuracy`. At a site on a plane of symmetry, an unsymmetric mesh gives a little mass to
        antisymmetric modes.
    band : float, optional
        Highest frequency of interest, Hz (see `impact_band`); for method="krylov", not with
        dampers. The number of anti-oscillators is chosen so that the error of Z(ω) up to it is at
        most `accuracy`.
    accuracy : float
        Largest |ΔZ|/|Z| over the band, at 1 % damping. `info["band"]["error_bound"]` is the bound
        that was reached, at least 2e-6 because of rounding. For several sites: ‖H ΔZ‖₂, the
        largest relative error of their displacements under any forces, scaled so that their
        compliance matrix is the identity, from `info["band"]["bottom"]` [Hz] on.
    shapes : bool
        Store the shapes (n + p vectors in a model of p sites), from which fields are computed.
    error : "estimate", optional
        Estimate the error of the mesh: the model gets its `strain_error`, so that `corrected()`
        and the `error_budget` of a `simulate` are available, for solids (also assemblies of them),
        beams and shells. It takes at most one further solve; for beams and quadrilateral shells
        the solve is on a mesh of half the cell size. If that mesh is too large, and for other
        assemblies, there is no estimate: the error bars then hold the other causes and say so.
    stretch : int, "auto" or False
        Number of modes with second-order forces: a sheet or a beam with fixed edges stretches as it
        bends, which stiffens it; a curved sheet is softer where it is pushed toward flat. "auto":
        each impact takes as many modes as it needs, none if they do not matter. The model stores
        them as `stretch`; only `simulate` and `Scene.run` use them. For meshes of Shell, Laminate,
        Solid, AnisotropicSolid and Beam.
    expansion : float, optional
        Frequency f of the expansion point s = 2πf of the Krylov space, Hz, for method="krylov";
        default: static. The response converges first at times of about 1/s. An impact that is over
        before its waves return from the edges needs fewer anti-oscillators with an s of about the
        inverse of its contact time. It takes a second factorization.
    proof : bool or float
        Store the data with which `simulate(..., proof=True)` bounds the force; it takes one more
        Krylov step, and a factor where it fits into the memory. A number is the contact time [s] of
        the impact (`contact_time` of a first run), from which the expansion point that makes the
        bounds narrow is computed.
    damping : float, sequence of float, or Damping, optional
        Damping ratio of all elastic free modes of the model, ratios of the modes in ascending order
        (the last one for all higher modes), or a `Damping`.

    Returns
    -------
    AntiOscillators, or a list of them for a sequence of sites
        A site that cannot move independently of earlier ones (for instance a second site on a
        rigid part) follows them by the model's `dependence`. `info` holds the numbers of modes
        found and dropped, and the checks. If the share of the rigid-body modes in the
        compliance of the site (`rigid_share`) is below 1e-5, they are left out, and k0 > 0.

    Raises
    ------
    InputError
        A site off the structure or fixed by its supports; n not below the number of dofs.
    NotConvergedError, AccuracyError
        A solver that failed, or a result that fails its own check.

    Notes
    -----
    Article (12), (15), (20), (23); with a rigid-body mode its section 3.3. The method "krylov":
    `antiosc.reduce.extraction.krylov`.
    """
    options = _checked_options(structure, n, method, tol, band, accuracy, expansion, proof, error)
    asked = _checked_sites(site)
    flag("shapes", shapes)
    stretch = checked_count(stretch)
    damping_of_modes = as_damping(damping)
    if damping_of_modes is not None:
        refuse_dampers(structure, "damping=")

    # the errors of the mesh, or why there are none
    errors: ModelErrors | None = None
    if error is not None or structure.matrices.meshed:
        with finite_element_packages():
            from antiosc.reduce.error.model_errors import ModelErrors  # needs dolfinx
        errors = ModelErrors(structure)
    if error is not None and errors is not None:
        errors.check()

    # the sites, and a solver for all
    start_time = time.perf_counter()
    wanted = [one for group in asked for one in group.values()]
    targets = iter(functionals(structure.matrices, wanted))
    groups = [{name: next(targets) for name in group} for group in asked]
    factored = "factorization" in structure.seconds

    # a model has as many anti-oscillators, and a static shape of each site
    columns = [sum(target.B.shape[1] for target in group.values()) for group in groups]
    solves = sum(1 + (count - 1) / SOLVES_OF_MODEL for count in columns)
    solves += pair_count(stretch) / SOLVES_OF_MODEL if stretch is not False else 0.0
    if method == "modes":
        solves = max(solves, EQUIVALENT_SITES)
    most = inf if options.proof else 1.0  # a proof needs a factor
    solver = structure.factorize(max(solves, most))
    spent = time.perf_counter() - start_time
    if not factored:
        spent -= structure.seconds["factorization"]

    expanded = None
    shift = (2 * np.pi * (options.expansion or 0.0)) ** 2
    if shift > structure.shift:
        expanded = structure.factorize_at(shift, max(*columns, most)), shift

    models = []
    for group in groups:
        model = _model_at(structure, solver, expanded, group, options, spent, errors)
        if not shapes:
            model = replace(model, shapes=None, hidden=None)
        if stretch is not False:
            model = with_stretch(structure, solver, model, stretch)
        if damping_of_modes is not None:
            model = replace(model, damping=damping_of_modes)
        models.append(model)

    return models if isinstance(site, list | tuple) else models[0]


#: Periods of the expansion's frequency in a contact time.
PERIODS_IN_CONTACT = 6.0


def _checked_options(
    structure: Structure,
    n: int | None,
    method: Method,
    tol: float | None,
    band: float | None,
    accuracy: float,
    expansion: float | None,
    proof: bool | float,
    error: ErrorOption,
) -> ExtractOptions:
    """The checked options; InputError if one is invalid, OutOfMemoryError if n needs too much."""
    instance("structure", structure, Structure, "a Structure")
    choice("error", error, (None, "estimate"))
    choice("method", method, get_args(Method))
    of_krylov = {"band": band is not None, "expansion": expansion is not None}
    of_krylov["proof"] = proof is not False
    for name in (name for name, given in of_krylov.items() if given and method != "krylov"):
        raise InputError(f'{name} takes method="krylov": leave it out.')
    if n is None:
        n = min(DEFAULT_COUNT if band is None else MOST_BAND_MODES, structure.dofs - 1)
    n = whole("n", n, least=0 if band is None else 1)
    if n >= structure.dofs:
        raise InputError(
            f"n must be below {structure.dofs}, the structure's dofs; got {n}: refine the mesh."
        )

    if band is not None:
        band = checks.band(band)
    else:
        need = 16.0 * (n + 2) * structure.size
        mesh = getattr(structure, "mesh", None)
        if mesh is not None and mesh.tdim == 2:  # solids have solvers without a factor
            need = bytes_of_shells(structure.dofs, n)
            need += bytes_of_shells(structure.dofs, 0) * bool(expansion)
        what = f"a model of {structure.dofs} dofs with n = {n} anti-oscillators"
        remedy = "reduce n, or take a coarser mesh"
        on_root(structure.comm, partial(process.require_memory, need, what, remedy))

    accuracy = positive("accuracy", accuracy)
    tol = MIN_OBSERVABLE_SHARE * min(accuracy, 1.0) if tol is None else tolerance(tol)
    if expansion is not None:
        expansion = positive("expansion", expansion, "Hz")
    elif not isinstance(proof, bool):
        expansion = PERIODS_IN_CONTACT / positive("proof", proof, "s")
    return ExtractOptions(n, method, tol, band, accuracy, expansion, proof is not False, error)


def _checked_sites(site: object) -> list[dict[str, Site]]:
    """Sites by name ("" if unnamed) for each model that the argument `site` requests."""
    if isinstance(site, Mapping):
        if not site:
            raise InputError("site names no site: give a Site for each name.")
        for name in site:
            if ":" in checks.name("the name of a site", name):
                raise InputError(f"the name of a site is a text without ':'; got {name!r}.")
        groups = [dict(site)]
    else:
        several = site if isinstance(site, list | tuple) else [site]
        groups = [{UNNAMED_SITE: one} for one in several]

    for name, one in (item for group in groups for item in group.items()):
        instance("site", one, Site, "a Site(point, direction)")
        if one.tangential and name == UNNAMED_SITE:
            raise InputError("tangential needs a named site: give the site a name.")
    return groups
