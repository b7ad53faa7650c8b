"""The arguments of an extraction, checked, and warnings where a model does not meet them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, get_args

from antiosc.base import memory
from antiosc.base.checks import choice, instance, positive, text, tolerance, whole
from antiosc.base.errors import AccuracyWarning, InputError, warn
from antiosc.fem.platform import mpi
from antiosc.fem.site.site import Site
from antiosc.fem.structure.structure import Structure
from antiosc.models.anti_oscillators import AntiOscillators

#: Share in |Z| of an observable mode, over the accuracy wanted. Clamped disc struck at its centre,
#: shell elements of a fifth of the radius: the modes that symmetry hides have up to 0.0094 of the
#: default accuracy, those of a tenth 0.0001; the others have 500 times the accuracy and more.
OBSERVABLE = 0.01
#: Default number of anti-oscillators, and the largest number with a band.
DEFAULT_COUNT, MOST_FOR_BAND = 20, 400

#: Largest number of modes computed for each one wanted: a site with fewer observable ones gets
#: fewer.
SEARCHED = 10
#: Goal of the Krylov steps over the accuracy wanted: the bound of the finished model is sampled
#: more finely and includes the dropped modes.
STEP_AIM = 0.6
#: With this many Krylov anti-oscillators the lowest must have converged to an antiresonance.
SETTLED_FROM = 10

Method = Literal["krylov", "modes"]
ErrorOption = Literal["estimate"] | None


@dataclass(frozen=True)
class ExtractOptions:
    """What the caller asked for, checked."""

    n: int
    method: Method
    tol: float
    band: float | None
    accuracy: float
    error: ErrorOption = None


def checked_options(
    structure: Structure,
    n: int | None,
    method: Method,
    tol: float | None,
    band: float | None,
    accuracy: float,
    error: ErrorOption = None,
) -> ExtractOptions:
    """The options; InputError for numbers out of range and vectors that memory cannot hold."""
    choice("method", method, get_args(Method))
    choice("error", error, (None, "estimate"))
    if n is None:
        n = min(DEFAULT_COUNT if band is None else MOST_FOR_BAND, structure.dofs - 1)
    n = whole("n", n, least=0 if band is None else 1)
    if n >= structure.dofs:
        raise InputError(
            f"n must be below the structure's {structure.dofs} dofs; got {n}: refine the mesh or "
            "ask for fewer anti-oscillators."
        )
    need = 16 * (n + 2) * structure.rows
    free = mpi.on_root(structure.comm, memory.free_memory) / structure.comm.size
    if band is None:
        what = f"a basis for n = {n} anti-oscillators of {structure.size} dofs"
        memory.require(need, what, "reduce n", free)
    if band is not None:
        band = positive("band", band, "rad/s")
    accuracy = positive("accuracy", accuracy)
    tol = OBSERVABLE * min(accuracy, 1.0) if tol is None else tolerance(tol)
    return ExtractOptions(n, method, tol, band, accuracy, error)


def checked_sites(structure: Any, site: Any) -> list[Site]:
    """The sites as a list, after a check of both arguments."""
    instance("structure", structure, Structure, "a Structure")
    names = list(site) if isinstance(site, Mapping) else []
    if isinstance(site, Mapping):
        if not names:
            raise InputError("site names no site: give {name: Site(point, direction), ...}.")
        for name in names:
            if ":" in text("the name of a site", name):
                raise InputError(f"the name of a site is a text without ':'; got {name!r}.")
        site = list(site.values())
    sites = list(site) if isinstance(site, list | tuple) else [site]
    for one in sites:
        instance("site", one, Site, "a Site(point, direction)")
        if one.tangential and not names:
            raise InputError(
                "tangential directions belong to a model of named sites: "
                "extract(part, {name: Site(..., tangential=True)})."
            )
    return sites


def warn_of_shortfall(model: AntiOscillators, options: ExtractOptions, complete: bool) -> None:
    """Warn of too few modes, of frequencies that have not converged, and of a band not reached or
    too low."""
    if options.band is None and model.n < options.n and not complete:
        warn(
            f"only {model.n} of the first {model.info.modes_computed} modes are observable at "
            f"the site (share in Z above {options.tol:g}), fewer than n = {options.n}: the model "
            "contains these; reduce tol for more.",
            AccuracyWarning,
        )
    if model.info.converged == 0 and model.n >= SETTLED_FROM:
        warn(
            f"none of the {model.n} anti-oscillators has converged to an antiresonance: their "
            "frequencies are unreliable; check whether some part is very slender.",
            AccuracyWarning,
        )
    if options.band is None or model.info.band is None:
        return
    error = model.info.band["error_bound"]
    if not error <= options.accuracy:
        warn(
            f"with {model.n} anti-oscillators the error of Z up to {options.band:g} rad/s is at "
            f"most {error:.1e}, above accuracy = {options.accuracy:g}: raise n or lower the band.",
            AccuracyWarning,
        )
    elif model.n and options.band < model.omega[0]:
        warn(
            f"the band ends at {options.band:g} rad/s, below the first antiresonance "
            f"{model.omega[0]:g} rad/s: the model consists almost only of its static stiffness "
            "and mass; raise the band if the impact is shorter.",
            AccuracyWarning,
        )
