"""The error budget of an impact: errors due to mesh, truncation, steps, patch and law.

The mesh error is the difference between the impacts on the model and on its corrected model, which
is softer (`antiosc.models.parameters`), times a safety factor, which is larger if strain errors are
a large share of the energy. Each quantity gets at least half of the largest error, as an error may
vanish by chance. For a shell, `strain_error` and `strain_misfit` have opposite signs and may
cancel: the larger of the differences with and without the misfit is taken.

Error "noise": the record of a measured model (`ModelInfo.measured`) contains other bodies that also
fit the measurement; the impact is repeated on each of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.base.texts import CELL_ARGUMENTS, capitalised, engineering, percent
from antiosc.engine.contact import ContactLaw
from antiosc.engine.contact.laws import ElasticPlastic, Gonthier, Hertz, YangSun
from antiosc.engine.contact.peak_error import (
    error_of_law,
    unknown_error_reason,
    weakest_and_strongest,
)
from antiosc.impact.enclosure import proved_error
from antiosc.impact.histories import History, bars
from antiosc.impact.histories.bars import BAR_UNITS, DEFLECTION, QUANTITIES, ErrorBar, ErrorBudget
from antiosc.impact.stretching import (
    NEGLIGIBLE_SHARE,
    energy_ratio_before_peak,
    relative_differences,
    stretch_shares,
    stretch_shares_of,
)
from antiosc.impact.truncation import WARNING_SHARE, truncation_error
from antiosc.models.anti_oscillators import AntiOscillators, is_reduced
from antiosc.models.body import LinearBody, ModalModel, choice_of, coarse_cell, wide_patch
from antiosc.models.modal import ModalBody
from antiosc.models.parameters import energy_error

RelativeErrors = dict[str, float]
#: Simulates an impact on another model to a tolerance, and by another law if one is given.
Rerun = Callable[..., History]


class ImpactRerun:
    """An impact to repeat on other models and with other laws; `tol`: time integration error."""

    def __init__(self, model: AntiOscillators, rerun: Rerun, tol: float) -> None:
        self.model = model
        self.rerun = rerun
        self.tol = tol
        self.raw_history = rerun(model, tol)
        self.runs = [self.raw_history]

    def run(self, body: LinearBody, law: ContactLaw | None = None) -> History:
        """The history on a body or with another law; the run on `model` itself is not repeated."""
        if body is self.model and law is None:
            return self.raw_history
        self.runs.append(self.rerun(body, self.tol, law))
        return self.runs[-1]

    def changes(self, body: LinearBody, law: ContactLaw | None = None) -> RelativeErrors:
        """Relative changes of force, impulse, contact time, deflection by another body or law."""
        return bars.relative_changes_with_site(self.raw_history, self.run(body, law))


#: Error bar, in standard deviations over the bodies (measured).
BAR_SIGMAS = 2.0


def measurement_errors(impact: ImpactRerun) -> RelativeErrors:
    """Relative errors by quantity: sums of those by measurement noise and by limited band."""
    facts = impact.model.info.measured
    if facts is None:
        return bars.ZERO_ERRORS

    bodies = zip(*(np.asarray(facts[name]) for name in ("omega", "b", "r", "decay")), strict=True)
    changes = [
        impact.changes(ModalModel(ModalBody(omega, b, float(r), decay=decay)))
        for omega, b, r, decay in bodies
    ]
    draws = int(facts["draws"])
    total = dict(bars.ZERO_ERRORS)

    for part in (changes[:draws], changes[draws:]):
        for name in total:
            total[name] += BAR_SIGMAS * float(
                np.sqrt(np.mean([change[name] ** 2 for change in part]))
            )

    return bars.with_floor(total)


#: Factors of safety of the mesh error, and of that of a coarse mesh.
SAFETY, COARSE_SAFETY = 2.0, 3.0
#: A mesh is coarse if the strain errors exceed this share of the strain energy,
COARSE_STRAIN_ERROR = 0.1
#: or the faces under the patch exceed this times its radius (the factor then grows in proportion).
RESOLVED_FACE_RATIO = 1.2
#: Ratio of the safety factors of shells of triangles to the usual ones (measured).
TRIANGLE_FACTOR = 1.5
#: Factor of safety for a site inside a beam element, which does not resolve the kink there.
INSIDE_ELEMENT_SAFETY = 5.0
#: `tol` of the compared runs over that of the history; its least and its largest value.
COMPARED_TOL_RATIO, MIN_COMPARED_TOL, MAX_COMPARED_TOL = 0.1, 1e-6, 1e-4
#: Factor on the energy of second-order strain in the bars of a solid that is taken as linear, and
#: the least share: 30 random blows changed by up to twice the energy, and by 0.2 % where it was
#: nearly 0 (measured).
OMITTED_SAFETY, OMITTED_MIN_ERROR = 2.5, 5e-3
#: Number of instants of the contact at which the amplitudes of the shapes are evaluated.
AMPLITUDE_TIMES = 200
#: Note if a second patch radius gives no estimate (a warning of the site has the remedy).
NO_PATCH_NOTE = "Not included: the radius of the patch."
#: Note for a patch that an edge cuts, where the cells do not resolve an uncut patch.
CUT_PATCH_NOTE = (
    "An edge cuts the patch, and its faces resolve no smaller one that is whole: the share of the"
    " patch is that of all of its half-space's compliance."
)


def error_budget(hit: History, rerun: Rerun) -> ErrorBudget:
    """The error bars of a run, from repeated runs on other models and with other laws."""
    model = hit.model
    if not isinstance(model, AntiOscillators):
        kind = type(model).__name__
        raise InputError(f"only impacts on AntiOscillators have an error budget; this is a {kind}.")

    if not hit.contacts:
        by_quantity = {name: ErrorBar(0.0) for name in QUANTITIES}
        return ErrorBudget(by_quantity, 0.0, ("The bodies did not touch: nothing has a bar.",))
    if hopeless := hit.assembly.theory_warning:
        bars_without = {n: ErrorBar(getattr(hit, n), without_mesh=True) for n in QUANTITIES}
        no_mesh = capitalised(hopeless.replace("'structure'", "the part"))
        return ErrorBudget(bars_without, 0.0, unknown={"mesh": no_mesh})

    in_time = COMPARED_TOL_RATIO * max(_time_errors(hit), default=MAX_COMPARED_TOL)
    tol = float(np.clip(in_time, MIN_COMPARED_TOL, MAX_COMPARED_TOL))
    stretching_model = model
    stretches = model.stretch is not None
    if stretches:
        model = replace(model, stretch=None)

    impact = ImpactRerun(model, rerun, tol)
    of_mesh = _mesh_errors(
        impact, " (of runs without its stretching)" if hit.assembly.stretch_forces else ""
    )
    patch, patch_notes = _patch_errors(impact)
    law, law_reason = law_error(impact)
    finer = None if hit.assembly.stretch_forces else impact.raw_history  # that is linear
    shares = {
        "mesh": of_mesh.mesh,
        "truncation": of_mesh.truncation,
        "time": _step_errors(hit, finer, tol),
        "patch": patch,
        "noise": measurement_errors(impact),
        "stretch": _stretch_errors(hit, stretching_model, impact),
    }
    for proof in hit.enclosures[:1]:  # by what the model leaves out
        for quantity, name in (("peak", "peak_force"), ("impulse", "impulse")):
            error = proved_error(proof, quantity, getattr(hit, name))
            shares["truncation"] = {**shares["truncation"], name: error}

    unknown = _unknown_mesh(hit, model, stretches, of_mesh, CUT_PATCH_NOTE in patch_notes)
    without_mesh = "mesh" in unknown
    if NO_PATCH_NOTE in patch_notes:
        unknown["patch"] = NO_PATCH_NOTE
    if law_reason:
        unknown["law"] = law_reason
    if not all(bars.are_comparable(impact.raw_history, run) for run in impact.runs):
        unknown["contact_time"] = bars.UNCERTAIN_CONTACTS_TEXT

    def bar(name: str, value: float) -> ErrorBar:
        causes = {cause: share_of[name] for cause, share_of in shares.items()}
        known_law = None if law is None else law[name]
        return ErrorBar(value, **causes, law=known_law, without_mesh=without_mesh)

    notes = [*patch_notes, *of_mesh.notes]
    if stretches and model.strain_error is not None:
        motion = "its bars but time and stretch are those of its linear motion"
        notes.append(f"The part stretches: {motion}.")
    if hit.assembly.stretch_forces:
        notes.append("Not included: strain beyond third order, which an explicit FE program has.")

    found = {name: bar(name, getattr(hit, name)) for name in QUANTITIES}
    if hit.site_motion is not None:
        found[DEFLECTION] = bar(DEFLECTION, hit.site_motion.largest_displacement)

    return ErrorBudget(
        found,
        of_mesh.share,
        tuple(notes),
        of_mesh.safety,
        unknown,
        restitution_of(hit),
    )


def _unknown_mesh(
    hit: History,
    model: AntiOscillators,
    stretches: bool,
    of_mesh: DiscretizationErrors,
    is_cut: bool,
) -> dict[str, str]:
    """Reasons, by name, why the error "mesh" (maybe "truncation" too) is unknown; {} if known."""
    reason = model.info.no_estimate
    if reason and model.strain_error is None and not stretches:
        what = "The mesh's error, and that of beams or shells in place of solids,"
        return {"mesh": f"{what} is not known: {reason}"}
    if model.strain_error is not None or model.info.measured is not None:
        unresolved = _unresolved_text(hit, model, is_cut)
        return {"mesh": unresolved} if unresolved else {}

    remedy = "extract the model from its mesh with the error 'estimate'"
    if reason:
        compare = "compare two sizes of the cells, and two numbers of anti-oscillators"
        remedy = f"{compare} ({reason.rstrip('.')})"
    if of_mesh.truncation["peak_force"] > 0:  # too few anti-oscillators
        return {"mesh": f"The mesh's error is not known: {remedy}."}

    both = f"The errors of mesh and truncation are not known: {remedy}."

    return dict.fromkeys(("mesh", "truncation"), both)


def restitution_of(hit: History) -> float | None:
    """Restitution e of an impact on an unloaded part at rest; None for other impacts and e < 0."""
    scene = hit.assembly.scene
    part = hit.assembly.bodies["structure"]
    loaded = len(scene.loads) > 0 or scene.base is not None or np.any(scene.gravity)
    e = hit.restitution
    moves = part.start_velocities.any() or part.initial_displacements is not None
    if loaded or moves:
        return None
    if e is None or e < 0 or hit.assembly.system.first is not None:  # of dampers to the ground
        return None
    return e


def law_error(impact: ImpactRerun) -> tuple[RelativeErrors | None, str]:
    """(relative errors due to the contact law, None if unknown; why bars lack them, or "")."""
    hit = impact.raw_history
    choice = choice_of(hit.law, hit.model, hit.impactor)
    if choice is None:
        return bars.ZERO_ERRORS, "The contact's law was given: its error is not in these bars."
    if reason := unknown_error_reason(choice, hit.peak_force):
        return None, f"The error of the contact's law is not known: {reason}."

    start, end = hit.contacts[0]
    laws = weakest_and_strongest(choice, hit.peak_force, end - start)
    changes = [bars.ZERO_ERRORS, *(impact.changes(impact.model, law) for law in laws)]
    share = error_of_law(choice, hit.peak_force)

    return {name: share + max(change[name] for change in changes) for name in BAR_UNITS}, ""


#: Laws of contacts that begin at a point, in contrast to contacts of two flat faces.
POINT_CONTACT_LAWS = (Hertz, Gonthier, ElasticPlastic, YangSun)


def _stretch_errors(hit: History, model: AntiOscillators, impact: ImpactRerun) -> RelativeErrors:
    """Relative errors due to omitted second-order forces, if needed by a run with more modes."""
    if model.stretch is None:
        energy = hit.assembly.omitted_stretch_ratio
        return dict.fromkeys(BAR_UNITS, energy and max(OMITTED_SAFETY * energy, OMITTED_MIN_ERROR))

    stretch = hit.assembly.stretch_forces.get("structure")
    if stretch is None:
        return dict.fromkeys(BAR_UNITS, NEGLIGIBLE_SHARE)
    if model.stretch.count == "auto":
        return stretch_shares_of(hit)
    if stretch.size == model.stretch.size:
        stretch_errors = dict.fromkeys(BAR_UNITS, 0.0)
    else:
        count = min(stretch.size + 2, model.stretch.size)
        more = replace(model, stretch=replace(model.stretch, count=count))
        stretch_errors = relative_differences(hit, impact.run(more))

    return stretch_shares(stretch_errors, energy_ratio_before_peak(hit))


class DiscretizationErrors(NamedTuple):
    """Relative errors due to mesh and truncation; zero where they are not estimated."""

    mesh: RelativeErrors = bars.ZERO_ERRORS
    truncation: RelativeErrors = bars.ZERO_ERRORS
    share: float = 0.0  # strain error over strain energy
    safety: float = SAFETY  # the factor in the errors due to the mesh
    notes: Sequence[str] = ()


def _mesh_errors(impact: ImpactRerun, linear_note: str) -> DiscretizationErrors:
    """The errors due to the mesh and to truncation, from runs on other models."""
    model = impact.model
    raw = impact.raw_history
    no_error = model.strain_error is None and not model.info.no_estimate
    if not model.n or (no_error and not is_reduced(model)):
        return DiscretizationErrors()

    truncated = truncation_error(model, lambda other, _: impact.run(other), tol=impact.tol)
    truncation = {name: getattr(truncated, name) for name in BAR_UNITS}
    too_few = []
    if truncated.peak_force > WARNING_SHARE:
        told = f"The {model.n} anti-oscillators are too few for this contact"
        too_few = [f"{told}: the bar of the truncation is a rough one."]
    if model.strain_error is None:
        return DiscretizationErrors(truncation=truncation, notes=too_few)

    softer = impact.run(model.corrected())
    share = energy_error(model, model.strain_error, amplitude_products(raw))
    safety, doubts = _safety_factor(model, share)
    changes = bars.relative_changes_with_site(raw, softer)
    if model.strain_misfit is not None:
        unstiffened = impact.changes(replace(model, strain_misfit=None).corrected())
        changes = {name: max(change, changes[name]) for name, change in unstiffened.items()}
    mesh = bars.with_floor({name: safety * change for name, change in changes.items()})

    doubts += too_few
    if not bars.are_comparable(raw, softer):
        here, corrected = map(bars.contacts_of_main, (raw, softer))
        doubts.insert(
            0,
            f"The mesh decides on the number of contacts: the main impact has {here} on this mesh"
            f" and {corrected} on the corrected one{linear_note}, so that the contact times are not"
            " comparable; a finer mesh decides.",
        )

    return DiscretizationErrors(mesh, truncation, share, safety, doubts)


def _safety_factor(model: AntiOscillators, share: float) -> tuple[float, list[str]]:
    """(safety factor of the mesh error, doubts); `share`: share of strain errors in the energy."""
    safety = SAFETY
    doubts = []
    if share > COARSE_STRAIN_ERROR:
        safety = COARSE_SAFETY
        doubts.append(
            f"The errors of the strains hold {percent(share)} of the energy: the mesh is coarse, "
            "and its bar is less certain."
        )
    faces = float(model.info.get("patch", {}).get("faces", 0.0))
    coarse = faces / (RESOLVED_FACE_RATIO * model.radius) if model.radius is not None else 0.0
    safety = max(safety, COARSE_SAFETY * coarse)
    if coarse > 1:
        doubts.append(
            f"The faces at the site measure {engineering(faces, 'm', 2)}, more than"
            f" {RESOLVED_FACE_RATIO:g} times its radius {engineering(model.radius, 'm', 2)}: the"
            " patch is not resolved, and"
            " the mesh's bar is less certain."
        )
    if model.info.get("divided") == "triangle":
        safety *= TRIANGLE_FACTOR
    if model.info.get("inside_element"):
        safety = max(safety, INSIDE_ELEMENT_SAFETY)
        doubts.append(
            "The site lies inside an element of a beam: the mesh's bar is wider; put a node there."
        )
    if "not_included" in model.info:
        doubts.append(model.info["not_included"])

    return safety, doubts


def amplitude_products(hit: History) -> Array:
    """Time integral of aaᵀ (N + 1, N + 1) in contact; a: amplitudes of φ_st and of each c_i φ_i."""
    size = hit.model.n + 1
    total = np.zeros((size, size))

    for start, end in hit.contacts:
        times = start + (np.arange(AMPLITUDE_TIMES) + 0.5) / AMPLITUDE_TIMES * (end - start)
        a = hit.coordinates(times)[:, :size]
        a = np.column_stack([a[:, 0], a[:, 1:] - a[:, :1]])
        total += a.T @ a * (end - start) / AMPLITUDE_TIMES

    return total


def _time_errors(hit: History) -> list[float]:
    """Estimated relative errors of the time integration; empty if the user gave the step."""
    return [hit.error[name] for name in ("force", "peak") if name in hit.error]


def _step_errors(hit: History, finer: History | None, tol: float) -> dict[str, float]:
    """Time-step errors by quantity: the estimate of the run or, if larger, `tol` plus the
    change in the run `finer`, whose tolerance is `tol`."""
    error = max(_time_errors(hit), default=0.0)
    estimated = {"peak_force": hit.error.get("peak", 0.0), "impulse": hit.error.get("force", 0.0)}
    change = bars.ZERO_ERRORS if finer is None else bars.relative_changes_with_site(hit, finer)
    return {name: max(change[name] + tol, estimated.get(name, error)) for name in BAR_UNITS}


def _patch_errors(impact: ImpactRerun) -> tuple[RelativeErrors, list[str]]:
    """Errors due to the radius of the patch, and a note.

    A patch of a second radius changes the part's compliance by more or less than the half-space
    compliance changes. The error is the change due to this difference in compliance.
    """
    model = impact.model
    second_patch = model.info.get("patch")
    if model.radius is None:
        return bars.ZERO_ERRORS, []

    notes = list[str]()
    if second_patch is not None and "compliance" in second_patch:
        change = abs(float(second_patch["compliance"]))
    elif second_patch is not None and second_patch.get("cut") and model.local_compliance:
        change = model.local_compliance
        notes = [CUT_PATCH_NOTE]
    else:
        return bars.ZERO_ERRORS, [NO_PATCH_NOTE]
    subtracted = min(change, model.local_compliance)
    local = model.local_compliance - subtracted
    relative_change = impact.changes(
        replace(model, strain_error=None, strain_misfit=None, local_compliance=local)
    )
    if change and not any(relative_change.values()):  # the law does not contain the half-space
        return bars.ZERO_ERRORS, [NO_PATCH_NOTE]

    larger = change / subtracted if subtracted else 1.0

    return {name: larger * value for name, value in relative_change.items()}, notes


def _unresolved_text(hit: History, model: AntiOscillators, is_cut: bool) -> str:
    """Reason why the cells or the patch do not resolve a contact; "" if they do."""
    contact_time = hit.assembly.contact_time_estimate
    at_point = isinstance(hit.law, POINT_CONTACT_LAWS)
    radius, thickness = model.radius, model.info.thickness

    if cell := coarse_cell(model, "", contact_time):
        what, sizes = "the cell", (cell.size, cell.allowed)
    elif at_point and (patch := wide_patch(model, "", contact_time)):
        what, sizes = "the patch", (patch.size, patch.allowed)
    elif is_cut and radius is not None and thickness is not None and radius > thickness:
        what, sizes = "the patch, which an edge cuts,", (2 * radius, radius / 2)
    else:
        return ""

    size, allowed = (engineering(one, "m") for one in sizes)
    return (
        f"The mesh's error is not known: {what} at the site measures {size}, too much for this"
        f" contact; take cells of at most {allowed} there ({CELL_ARGUMENTS})."
    )
