"""`extract`: the anti-oscillators of a structure at a site."""

from __future__ import annotations

import logging
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, get_args, overload

from antiosc.base import process
from antiosc.base.checks import (
    choice,
    flag,
    instance,
    positive,
    text,
    tolerance,
    whole,
    within_range,
)
from antiosc.base.errors import InputError, finite_element_packages
from antiosc.base.process import one_thread
from antiosc.fem.extraction.krylov import BASIS_STEP
from antiosc.fem.extraction.site_models import (
    DEFAULT_COUNT,
    MOST_FOR_BAND,
    UNNAMED,
    Columns,
    ErrorOption,
    ExtractOptions,
    Method,
    models_of,
)
from antiosc.fem.platform import mpi
from antiosc.fem.site.functionals import functionals
from antiosc.fem.site.site import Site
from antiosc.fem.structure.structure import Structure, refuse_dampers
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.modal import Damping, as_damping

if TYPE_CHECKING:
    from antiosc.fem.error.model_errors import ModelErrors

#: Share in |Z| of an observable mode, over the accuracy wanted. Clamped disc struck at its centre,
#: shell elements of a fifth of the radius: the modes that symmetry hides have up to 0.0094 of the
#: default accuracy, those of a tenth 0.0001; the others have 500 times the accuracy and more.
OBSERVABLE = 0.01
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
    error: ErrorOption = None,
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
    error: ErrorOption = None,
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
    error: ErrorOption = None,
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
        (`info.converged` of them) have converged to antiresonances of the structure; the upper
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
        Largest |ΔZ|/|Z| over the band, at 1 % damping. `info.band["error_bound"]` is the bound
        that was reached, including truncation and rounding. Of several sites: the largest relative
        error of their displacements under any forces, in units in which their compliances are the
        identity, ‖H ΔZ‖₂, from `info.band["bottom"]` [rad/s] on.
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
        of the rigid-body modes in the compliance of the site (`rigid_share`) is below 1e-4, they
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
    instance("structure", structure, Structure, "a Structure")
    names, sites = _checked_sites(site)
    flag("shapes", shapes)
    choice("error", error, (None, "estimate"))
    options = _checked_options(structure, n, method, tol, band, accuracy)
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
    groups: list[Columns] = [{UNNAMED: [one]} for one in targets]
    if names:
        groups = [{n: [one, *one.across] for n, one in zip(names, targets, strict=True)}]
    models: list[AntiOscillators] = []
    width = _together(structure, options)
    for first in range(0, len(groups), width):
        models += models_of(
            structure, groups[first : first + width], options, shapes, spent, errors
        )
        if len(groups) > width:
            log.info("extracted %d of %d sites", len(models), len(groups))
    if given is not None:
        models = [replace(model, damping=given) for model in models]
    return models if isinstance(site, list | tuple) else models[0]


def _model_errors(structure: Structure, named_sites: int) -> ModelErrors:
    """The estimates of models; their modules need meshes, which given matrices do without."""
    with finite_element_packages():
        from antiosc.fem.error.model_errors import ModelErrors

    return ModelErrors(structure, named_sites)


def _together(structure: Structure, options: ExtractOptions) -> int:
    """Number of models processed at once: as many as fit in SLICE bytes of basis vectors."""
    if options.method == "modes":
        return 1
    columns = options.n + 2 if options.band is None else 2 * BASIS_STEP
    return max(1, int(SLICE / (16 * columns * structure.size)))


def _checked_options(
    structure: Structure,
    n: int | None,
    method: Method,
    tol: float | None,
    band: float | None,
    accuracy: float,
) -> ExtractOptions:
    """The options; InputError for numbers out of range and vectors that memory cannot hold."""
    choice("method", method, get_args(Method))
    if n is None:
        n = min(DEFAULT_COUNT if band is None else MOST_FOR_BAND, structure.dofs - 1)
    n = whole("n", n, least=0 if band is None else 1)
    if n >= structure.dofs:
        raise InputError(
            f"n must be below the structure's {structure.dofs} dofs; got {n}: refine the mesh or "
            "ask for fewer anti-oscillators."
        )
    if band is None:
        what = f"a basis for n = {n} anti-oscillators of {structure.size} dofs"
        free = mpi.on_root(structure.comm, process.free_memory) / structure.comm.size
        process.require(16 * (n + 2) * structure.rows, what, "reduce n", free)
    else:
        band = positive("band", band, "rad/s")
    accuracy = positive("accuracy", accuracy)
    tol = OBSERVABLE * min(accuracy, 1.0) if tol is None else tolerance(tol)
    return ExtractOptions(n, method, tol, band, accuracy)


def _checked_sites(site: object) -> tuple[list[str], list[Site]]:
    """(names, sites) of the argument of `extract`; no names but those of a mapping."""
    names: list[str] = []
    if isinstance(site, Mapping):
        names, site = list(site), list(site.values())
        if not names:
            raise InputError("site names no site: give {name: Site(point, direction), ...}.")
        for name in names:
            if ":" in text("the name of a site", name):
                raise InputError(f"the name of a site is a text without ':'; got {name!r}.")
    sites: list[Site] = []
    for one in site if isinstance(site, list | tuple) else [site]:
        sites.append(instance("site", one, Site, "a Site(point, direction)"))
        if sites[-1].tangential and not names:
            raise InputError(
                "tangential directions belong to a model of named sites: "
                "extract(part, {name: Site(..., tangential=True)})."
            )
    return names, sites
