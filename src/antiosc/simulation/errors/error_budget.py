"""The error budget of an impact: what mesh, truncation, time steps and patch leave of its numbers.

The mesh's share is the difference between the impacts on the model and on its corrected model
(`antiosc.models.softened`), times a factor of safety; since the errors of the three quantities
(peak force, impulse, contact time) may vanish by chance, each is at least half the largest of them.
The factor is larger where the errors of strains hold a large share of the energy. Of a shell the
impact on the model that is softened without its misfit counts too, and the larger difference is
taken: error and misfit have opposite signs and may cancel.
The share of the truncation: `antiosc.simulation.errors.truncation`; of the element family:
`antiosc.simulation.errors.model_errors`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.softened import NO_ESTIMATE, energy_error
from antiosc.simulation.errors.model_errors import (
    Again,
    Repeated,
    Shares,
    low_band,
    measured_errors,
    model_errors,
)
from antiosc.simulation.errors.truncation import ENOUGH, left_out, truncation_error
from antiosc.simulation.histories.error_bars import (
    NO_SHARE,
    QUANTITIES,
    ErrorBar,
    ErrorBudget,
    differences,
    floored,
)
from antiosc.simulation.histories.history import History

#: Factor of safety of the mesh's share, and the same where the mesh is not good enough for it: the
#: share of the errors of strains in the energy exceeds COARSE, or the faces under the patch are
#: RESOLVED times its radius (in proportion to them, above the first factor).
SAFETY, SAFETY_COARSE, COARSE, RESOLVED = 2.0, 3.0, 0.1, 1.2
#: Both factors of shells over the usual ones (benchmarks/shell_error_bars.py). Blows that are too
#: short for the cells of a shell make errors that no shape of the model shows, neither raw nor
#: corrected: above COARSE_SHELL a bar is at least the share of the errors of strains in the energy.
SHELL, COARSE_SHELL = 1.5, 0.05
#: The same for a site inside an element of a beam, whose kink there is not resolved.
SAFETY_INSIDE = 5.0
#: Time integration error of the runs that are compared, over that of the history; at most and
#: at least this.
FINER, LEAST, MOST = 0.1, 1e-6, 1e-4
#: Instants of the contact at which the amplitudes of the shapes are taken.
INSTANTS = 200
#: Largest change of stiffness or mass that the gaps between flat faces and their surface count for.
MOST_GAP = 0.5
#: Note where a second radius says nothing.
NO_PATCH = "Not included: the radius of the patch."


def error_budget(hit: History, again: Again) -> ErrorBudget:
    """The bars of a run; `again(model, tol)` is the same impact on another model, with the exact
    method and a step that meets the tolerance."""
    model = hit.model
    if not isinstance(model, AntiOscillators):
        raise InputError(NO_ESTIMATE)
    if model.strain_error is None and model.info.measured is None:
        raise InputError(NO_ESTIMATE)
    if not hit.contacts:
        bars = {name: ErrorBar(0.0, 0.0, 0.0, 0.0, 0.0) for name in QUANTITIES}
        return ErrorBudget(bars, 0.0, ("The bodies did not touch: nothing has a bar.",))
    tol = min(max(FINER * max(_time_errors(hit), default=MOST), LEAST), MOST)
    raw = again(model, tol)
    impact = Repeated(model, raw, again, tol)
    weights = amplitudes(hit)
    mesh, truncated, share, safety, doubts = _mesh(impact, weights)
    noise, band = measured_errors(impact)
    patch, told = _patch(impact)
    geometry, curved = _geometry(impact, weights)
    family, idealized = model_errors(impact)
    shares = {
        "mesh": mesh, "truncation": truncated, "time": _time(hit, raw, tol), "patch": patch,
        "geometry": geometry, "noise": noise, "band": band, "model": family,
    }  # fmt: skip
    bars = {
        name: ErrorBar(getattr(hit, name), **{cause: own[name] for cause, own in shares.items()})
        for name in QUANTITIES
    }
    notes = (*told, *curved, *idealized, *doubts, *filter(None, [low_band(raw)]))
    return ErrorBudget(bars, share, notes, safety)


def _mesh(impact: Repeated, weights: Array) -> tuple[Shares, Shares, float, float, list[str]]:
    """The shares of mesh and truncation, that of the errors of strains in the energy, the factor of
    safety, and what is to be said; of a model without a mesh nothing."""
    model, raw = impact.model, impact.raw
    if model.strain_error is None:
        return NO_SHARE, NO_SHARE, 0.0, SAFETY, []
    softer = impact.on(model.corrected())
    share = energy_error(model, model.strain_error, weights)
    safety, doubts = _safety(model, share)
    off = differences(raw, softer)
    if model.strain_misfit is not None:
        without = impact.change(replace(model, strain_misfit=None).corrected())
        off = {name: max(one, off[name]) for name, one in without.items()}
    mesh = floored({name: safety * one for name, one in off.items()})
    if model.strain_misfit is not None and share > COARSE_SHELL:
        mesh = {name: max(one, share) for name, one in mesh.items()}

    def known(each: AntiOscillators, tol: float) -> History:
        return raw if each is model else impact.run(each, tol)

    truncated = truncation_error(model, known, tol=impact.tol)
    missed = left_out(model, raw.assembly)
    least = missed if missed > ENOUGH else 0.0
    if least:
        doubts.append(
            f"The {model.n} anti-oscillators are too few for this contact: the bar of the"
            " truncation is a rough one; extract with a band."
        )
    if len(raw.contacts) != len(softer.contacts):
        doubts.insert(
            0,
            f"The mesh decides on the number of contacts ({len(raw.contacts)} here, "
            f"{len(softer.contacts)} corrected): the contact times are not comparable.",
        )
    left = {name: max(getattr(truncated, name), least) for name in QUANTITIES}
    return mesh, left, share, safety, doubts


def _safety(model: AntiOscillators, share: float) -> tuple[float, list[str]]:
    """The factor of the mesh's share, and why it is not the usual one; one sentence each.

    Faces as large as the patch spread its load: the strains that they miss grow as their size over
    the radius (the compliance of a patch is inverse to its radius), and no recovery sees them.
    """
    safety, doubts = SAFETY, []
    if share > (COARSE if model.strain_misfit is None else COARSE_SHELL):
        safety = SAFETY_COARSE
        doubts.append(
            f"The errors of the strains hold {share:.0%} of the energy: the mesh is coarse, and "
            "its bar is less certain."
        )
    faces = float((model.info.patch or {}).get("faces", 0.0))
    coarse = faces / (RESOLVED * model.radius) if model.radius is not None else 0.0
    safety = max(safety, SAFETY_COARSE * coarse)
    if coarse > 1:
        doubts.append(
            f"The faces at the site measure {faces:.2g} m, more than its radius "
            f"{model.radius:.2g} m: the patch is not resolved, and the mesh's bar is less certain."
        )
    if model.strain_misfit is not None:
        safety *= SHELL
    if model.info.inside_element:
        safety = max(safety, SAFETY_INSIDE)
        doubts.append(
            "The site lies inside an element of a beam: the mesh's bar is wider; put a node there."
        )
    if model.info.not_included:
        doubts.append(model.info.not_included)
    return safety, doubts


def amplitudes(hit: History) -> Array:
    """Sum of a aᵀ over the contact of the amplitudes a of psi_0 ... psi_N, (N + 1, N + 1)."""
    size = hit.model.n + 1
    total = np.zeros((size, size))
    for start, end in hit.contacts:
        times = start + (np.arange(INSTANTS) + 0.5) / INSTANTS * (end - start)
        a = hit.coordinates(times)[:, :size]
        a = np.column_stack([a[:, 0], a[:, 1:] - a[:, :1]])
        total += a.T @ a * (end - start) / INSTANTS
    return total


def _time_errors(hit: History) -> list[float]:
    """Estimated errors of the time integration; none where the step was given."""
    return [hit.error[name] for name in ("force", "peak") if name in hit.error]


def _time(hit: History, finer: History, tol: float) -> dict[str, float]:
    """The share of the time steps: the estimate of the run, or more if a finer run says so."""
    known = max(_time_errors(hit), default=0.0)
    own = {"peak_force": hit.error.get("peak", 0.0), "impulse": hit.error.get("force", 0.0)}
    changed = differences(hit, finer)
    return {name: max(changed[name] + tol, own.get(name, known)) for name in QUANTITIES}


def _patch(impact: Repeated) -> tuple[Shares, list[str]]:
    """The share of the patch's radius, and what is to be said of it.

    A second radius changed the compliance of the part by a little beyond that of the half-space:
    the run with that change in the contact tells its effect.
    """
    model = impact.model
    other = model.info.patch
    if model.radius is None:
        return NO_SHARE, []
    if other is None or "compliance" not in other:
        return NO_SHARE, [NO_PATCH]
    change = float(other["compliance"])
    local = max(model.local_compliance - abs(change), 0.0)
    changed = impact.change(_plain(model, local_compliance=local))
    if change and not any(changed.values()):  # the law does not contain the half-space
        return NO_SHARE, [NO_PATCH]
    return changed, []


def _plain(model: AntiOscillators, **changes: Any) -> AntiOscillators:
    """The model with other parameters, without the errors of its strains."""
    return replace(model, strain_error=None, strain_misfit=None, **changes)


def _geometry(impact: Repeated, weights: Array) -> tuple[Shares, list[str]]:
    """The share of flat faces that stand for a curved surface, and what is to be said of it.

    Between both lie layers that the mesh lacks or has in excess. Their strain energy over that of
    the contact, and their mass over the structure's, change all stiffnesses and masses of the run.
    """
    model = impact.model
    facts = model.info.geometry
    if facts is None:
        return NO_SHARE, []
    own = np.diag(weights)
    energy = own @ np.append(model.k0, model.k)
    layers = own @ np.asarray(facts["stiffness"])[: len(own)]
    stiffer = 1 + float(np.clip(layers / energy if energy > 0 else 0.0, -MOST_GAP, MOST_GAP))
    heavier = 1 + float(np.clip(facts["mass"], -MOST_GAP, MOST_GAP))
    p = model.participation
    curved = _plain(
        model,
        m0=model.m0 * heavier,
        k0=model.k0 * stiffer,
        m=model.m * heavier,
        omega=model.omega * np.sqrt(stiffer / heavier),
        participation=None if p is None else p * heavier,
    )
    changed = impact.change(curved)
    return floored({name: SAFETY * off for name, off in changed.items()}), [facts["note"]]
