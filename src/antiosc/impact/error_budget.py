"""The error budget of an impact: what mesh, model, truncation, steps and patch leave open.

The mesh's share is the difference between the impacts on the model and on its corrected model
(`antiosc.models.parameters`), times a factor of safety; since the errors of the three quantities
(peak force, impulse, contact time) may vanish by chance, each is at least half the largest of them.
The factor is larger where the errors of strains hold a large share of the energy. Of a shell the
impact on the model that is softened without its misfit counts too, and the larger difference is
taken: error and misfit have opposite signs and may cancel.
The share of the truncation: `antiosc.impact.truncation`; of the element family:
`antiosc.impact.error_budget`.

"model": what Timoshenko's beam leaves out of a bar that is solid. A point load on a solid bar
deforms the section around it. Beyond the half-space that a contact law holds, this changes three
things, which were measured on solid bars of rectangular section against closed forms
(`benchmarks/beam_model.py`; lengths of 5 to 40 heights, widths of half to twice the height; x is a
frequency over that at which the section deforms):

    compliance of the site    by up to LOCAL/(E √A)
    values of modes there     by up to VALUES x   (stresses across the axis, as in von Kármán's and
                              Seewald's correction of the deflection under a point load)
    natural frequencies       by up to FREQUENCIES x, and CLAMP d/L for each clamped end (d the
                              larger side, L the length: the clamp hinders Poisson's contraction)

The same impact with all of these changes at once, to one side and to the other, differed by more
than that on the solid bar for 449 of 450 quantities, and by 0.97 times as much for one;
`SAFETY_BEAM` is for other bars.

"noise" and "band": the record of a measured model (`ModelInfo.measured`) has bodies that the
measurement does not tell from it: some are drawn from the noise, some from what is not known of the
modes above the band. The same impact on all of them tells what either leaves open; a bar is `BAR`
standard deviations.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import AccuracyWarning, InputError, warn
from antiosc.impact.histories import History, bars
from antiosc.impact.histories.bars import QUANTITIES, ErrorBar, ErrorBudget
from antiosc.impact.law_error import ByLaw, law_errors
from antiosc.impact.stretching import DECIDING, NEGLIGIBLE, differences
from antiosc.impact.truncation import WARN_SHARE, truncation_error, truncation_share
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.body import BeamSection, LinearBody, ModalModel, info_of
from antiosc.models.modal import ModalBody
from antiosc.models.parameters import NO_ESTIMATE, energy_error

#: What Timoshenko's beam leaves out, as measured: see above.
LOCAL, VALUES, FREQUENCIES, CLAMP = 0.8, 0.6, 0.06, 0.05
SAFETY_BEAM = 1.25  # for other bars than those that were measured

Shares = dict[str, float]
#: Simulates an impact on another body to a tolerance.
Rerun = Callable[[LinearBody, float], History]


@dataclass(frozen=True, eq=False)
class RepeatedImpact:
    """An impact that is repeated on other bodies, by the exact method to `tol`.

    `raw` is the history on `model` itself; `run` simulates the impact on a body.
    """

    model: AntiOscillators
    raw: History
    run: Rerun
    tol: float

    def simulate_on(self, body: LinearBody) -> History:
        """Simulate the impact on another body."""
        return self.run(body, self.tol)

    def change(self, body: LinearBody) -> Shares:
        """Relative changes of peak force, impulse and contact time on another body."""
        return bars.differences(self.raw, self.simulate_on(body))


def model_errors(impact: RepeatedImpact) -> tuple[Shares, list[str]]:
    """Relative errors of the three quantities due to the element family, and notes.

    The model's info has the data ("model"), or the reason why there is no figure.
    """
    facts = impact.model.info.model
    if isinstance(facts, str):
        return bars.NO_ERROR, [facts]
    if facts is None:
        return bars.NO_ERROR, []
    softer, stiffer = map(impact.change, _softer_and_stiffer(impact.model, facts))
    return bars.with_floor(
        {name: SAFETY_BEAM * max(softer[name], stiffer[name]) for name in softer}
    ), []


def _softer_and_stiffer(
    model: AntiOscillators, facts: BeamSection
) -> tuple[ModalModel, ModalModel]:
    """The model with all changes that soften it, and with all that stiffen it.

    Contact laws with a half-space lose the local compliance of the second.
    """
    modes = model.modal()
    x = np.minimum(modes.omega / facts["omega"], 1.0)
    slower, local = FREQUENCIES * x + CLAMP * facts["clamps"], LOCAL * facts["compliance"]

    def moved(sign: float, r: float) -> ModalBody:
        omega, b = modes.omega * (1 - sign * slower), modes.b * (1 + sign * VALUES * x)
        return replace(modes, omega=omega, b=b, r=r)

    return ModalModel(moved(1.0, modes.r + local)), ModalModel(moved(-1.0, modes.r), local)


#: A bar in standard deviations of the bodies (benchmarks/measured_frf.py).
BAR = 2.0
#: Least product of the top of the band [Hz] and the time of the pulse.
LEAST_PRODUCT = 1.0

#: Share of the energy of a force below the frequency to which its spectrum reaches; that frequency
#: times the length of a half-sine; samples of the force, and its length with zeros behind.
ENERGY, HALF_SINE, SAMPLES, PADDED = 0.99, 1.18, 8192, 8


def measured_errors(impact: RepeatedImpact) -> tuple[Shares, Shares]:
    """Relative errors of the three quantities due to measured noise and the limited band."""
    facts = impact.model.info.measured
    if facts is None:
        return bars.NO_ERROR, bars.NO_ERROR
    bodies = zip(*(np.asarray(facts[name]) for name in ("omega", "b", "r", "decay")), strict=True)
    off = [
        impact.change(ModalModel(ModalBody(omega, b, float(r), decay)))
        for omega, b, r, decay in bodies
    ]
    drawn, others = off[: int(facts["draws"])], off[int(facts["draws"]) :]
    noise, band = (
        {
            name: BAR * float(np.sqrt(np.mean([one[name] ** 2 for one in part])))
            for name in QUANTITIES
        }
        for part in (drawn, others)
    )
    return bars.with_floor(noise), bars.with_floor(band)


def low_band_message(hit: History) -> str:
    """Warning of a measured band that is too low for the contact; "" if it is not."""
    facts = info_of(hit.model).measured
    if facts is None or not hit.contacts:
        return ""
    top, pulse = float(facts["top"]) / (2 * np.pi), pulse_time(hit)
    if top * pulse >= LEAST_PRODUCT:
        return ""
    return (
        f"The measurement ends at {top:.4g} Hz, and the force is as short as a half-sine of"
        f" {pulse:.3g} s: their product {top * pulse:.2g} is below {LEAST_PRODUCT:g}, and the force"
        " depends on modes that were not measured; measure to a higher frequency, or take a softer"
        " or heavier impactor."
    )


def pulse_time(hit: History) -> float:
    """Duration [s] of a half-sine whose spectrum reaches as far as that of the force.

    The spectrum of the main impact reaches to where `ENERGY` of its energy lie below.
    """
    start, end = hit.contacts[0][0], hit.contacts[-1][1]
    time = np.linspace(start, end, SAMPLES)
    energy = np.cumsum(np.abs(np.fft.rfft(hit.force_at(time), PADDED * SAMPLES)) ** 2)
    reach = int(np.searchsorted(energy, ENERGY * energy[-1])) or 1
    return HALF_SINE * PADDED * (end - start) / reach


def warn_low_band(hit: History) -> None:
    """Warn of a measured band that is too low for the contact."""
    if sentence := low_band_message(hit):
        warn(sentence, AccuracyWarning)


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


def error_budget(hit: History, rerun: Rerun, by_law: ByLaw) -> ErrorBudget:
    """The error bars of a run.

    `rerun(model, tol)` repeats the impact on another model and `by_law(law, tol)` by another law,
    with the exact method and a step that meets the tolerance.
    """
    model = hit.model
    if not isinstance(model, AntiOscillators):
        raise InputError(NO_ESTIMATE)
    given, stretches = model, model.stretch is not None
    if model.strain_error is None and model.info.measured is None and not stretches:
        raise InputError(NO_ESTIMATE)
    if not hit.contacts:
        by_quantity = {name: ErrorBar(0.0, 0.0, 0.0, 0.0, 0.0) for name in QUANTITIES}
        return ErrorBudget(by_quantity, 0.0, ("The bodies did not touch: nothing has a bar.",))
    tol = min(max(FINER * max(_time_errors(hit), default=MOST), LEAST), MOST)
    if stretches:
        model = replace(model, stretch=None)
    raw = rerun(model, tol)
    impact = RepeatedImpact(model, raw, rerun, tol)
    weights = amplitudes(raw)
    mesh, truncated, share, safety, doubts = _mesh(impact, weights)
    noise, band = measured_errors(impact)
    patch, patch_notes = _patch(impact)
    geometry, geometry_notes = _geometry(impact, weights)
    family, model_notes = model_errors(impact)
    law, left_out = law_errors(raw, by_law, tol)
    finer = None if hit.assembly.stretched else raw  # that is linear
    shares = {
        "mesh": mesh, "truncation": truncated, "time": _time(hit, finer, tol), "patch": patch,
        "geometry": geometry, "noise": noise, "band": band, "model": family,
        "stretch": _stretch(hit, given, rerun, tol),
    }  # fmt: skip
    by_quantity = {
        name: ErrorBar(
            getattr(hit, name),
            **{cause: own[name] for cause, own in shares.items()},
            law=None if law is None else law[name],
        )
        for name in QUANTITIES
    }
    linear, unknown = LINEAR_BARS if stretches else "", tuple[str, ...]()
    if model.strain_error is None and model.info.measured is None:
        unknown, linear = ("mesh", "truncation"), ""
        left_out = f"{left_out} {NOT_ESTIMATED}".lstrip()
    band_notes = filter(None, [low_band_message(raw), linear])
    notes = (*patch_notes, *geometry_notes, *model_notes, *doubts, *band_notes)
    return ErrorBudget(by_quantity, share, notes, safety, left_out, unknown)


#: Factor of safety of what two more modes change, and its least: the tensors themselves are within
#: so much of the whole second-order strain. Chosen with 56 random sheets of which 55 bars then hold
#: (50 with a factor of 2 and no least), tried with others (benchmarks/random_sheets.py).
STRETCH_SAFETY, STRETCH_LEAST = 3.0, 1e-3
LINEAR_BARS = "The part stretches: its bars but time and stretch are those of its linear motion."
NOT_ESTIMATED = (
    'Mesh and truncation are not in these bars: extract(…, stretch=…, error="estimate") has them.'
)


def _stretch(hit: History, model: AntiOscillators, rerun: Rerun, tol: float) -> Shares:
    """Error due to the truncated second-order modes: the change from m to m + 2 modes.

    The change of a peak force may vanish by chance: the deflection's counts too.
    """
    if model.stretch is None:
        return bars.NO_ERROR
    taken = hit.assembly.stretched.get("structure")
    if taken is None:
        return dict.fromkeys(QUANTITIES, NEGLIGIBLE)
    if model.stretch.count == "auto":
        names = (*QUANTITIES, "deflection")
        known = {name: hit.error.get(f"stretch {name}", 0.0) for name in names}
    else:
        more = min(taken.size + 2, model.stretch.size)
        known = differences(hit, rerun(with_count(model, more), tol))
    worst = max(known[name] for name in DECIDING)
    least = max(bars.FLOOR * worst, STRETCH_LEAST)
    return {name: STRETCH_SAFETY * max(known[name], least) for name in QUANTITIES}


def with_count(model: AntiOscillators, count: int) -> AntiOscillators:
    """The model with this number of modes of its second-order forces."""
    assert model.stretch is not None
    return replace(model, stretch=replace(model.stretch, count=count))


def _mesh(impact: RepeatedImpact, weights: Array) -> tuple[Shares, Shares, float, float, list[str]]:
    """Errors due to mesh and truncation, the strain error over the strain energy, the safety factor
    and notes; for a model without a mesh, none.
    """
    model, raw = impact.model, impact.raw
    if model.strain_error is None:
        return bars.NO_ERROR, bars.NO_ERROR, 0.0, SAFETY, []
    softer = impact.simulate_on(model.corrected())
    share = energy_error(model, model.strain_error, weights)
    safety, doubts = _safety(model, share)
    changes = bars.differences(raw, softer)
    if model.strain_misfit is not None:
        without = impact.change(replace(model, strain_misfit=None).corrected())
        changes = {name: max(one, changes[name]) for name, one in without.items()}
    mesh = bars.with_floor({name: safety * one for name, one in changes.items()})
    if model.strain_misfit is not None and share > COARSE_SHELL:
        mesh = {name: max(one, share) for name, one in mesh.items()}

    def known(each: AntiOscillators, tol: float) -> History:
        return raw if each is model else impact.run(each, tol)

    truncated = truncation_error(model, known, tol=impact.tol)
    missed = truncation_share(model, raw.assembly)
    least = missed if missed > WARN_SHARE else 0.0
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
    """The safety factor of the mesh error, and a note if it is not the usual one.

    The sentence says why: faces as large as the patch spread its load, so that strains are missed
    which no recovery sees. They grow as the size of the faces over the radius, for the compliance
    of a patch is inverse to its radius.
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
    """Σ a aᵀ over the contact, a the amplitudes of psi_0 ... psi_N: (N + 1, N + 1)."""
    size = hit.model.n + 1
    total = np.zeros((size, size))
    for start, end in hit.contacts:
        times = start + (np.arange(INSTANTS) + 0.5) / INSTANTS * (end - start)
        a = hit.coordinates(times)[:, :size]
        a = np.column_stack([a[:, 0], a[:, 1:] - a[:, :1]])
        total += a.T @ a * (end - start) / INSTANTS
    return total


def _time_errors(hit: History) -> list[float]:
    """Estimated errors of the time integration; None if the user gave the step."""
    return [hit.error[name] for name in ("force", "peak") if name in hit.error]


def _time(hit: History, finer: History | None, tol: float) -> dict[str, float]:
    """Errors due to the time steps: the estimate of the run, or that of a finer run if larger."""
    known = max(_time_errors(hit), default=0.0)
    own = {"peak_force": hit.error.get("peak", 0.0), "impulse": hit.error.get("force", 0.0)}
    changed = bars.NO_ERROR if finer is None else bars.differences(hit, finer)
    return {name: max(changed[name] + tol, own.get(name, known)) for name in QUANTITIES}


def _patch(impact: RepeatedImpact) -> tuple[Shares, list[str]]:
    """Errors due to the radius of the patch, and a note.

    A second radius changed the compliance of the part by a little beyond that of the half-space;
    the impact with this change in the contact gives the share.
    """
    model = impact.model
    other = model.info.patch
    if model.radius is None:
        return bars.NO_ERROR, []
    if other is None or "compliance" not in other:
        return bars.NO_ERROR, [NO_PATCH]
    change = float(other["compliance"])
    local = max(model.local_compliance - abs(change), 0.0)
    changed = impact.change(
        replace(model, strain_error=None, strain_misfit=None, local_compliance=local)
    )
    if change and not any(changed.values()):  # the law does not contain the half-space
        return bars.NO_ERROR, [NO_PATCH]
    return changed, []


def _geometry(impact: RepeatedImpact, weights: Array) -> tuple[Shares, list[str]]:
    """Errors due to flat faces in place of a curved surface, and notes.

    Between both lie layers that the mesh lacks or has in excess. Their strain energy over that of
    the contact, and their mass over the structure's, change all stiffnesses and masses of the run.
    """
    model = impact.model
    facts = model.info.geometry
    if facts is None:
        return bars.NO_ERROR, []
    own = np.diag(weights)
    energy = own @ np.append(model.k0, model.k)
    layers = own @ np.asarray(facts["stiffness"])[: len(own)]
    stiffer = 1 + float(np.clip(layers / energy if energy > 0 else 0.0, -MOST_GAP, MOST_GAP))
    heavier = 1 + float(np.clip(facts["mass"], -MOST_GAP, MOST_GAP))
    p = model.participation
    curved = replace(
        model,
        strain_error=None,
        strain_misfit=None,
        m0=model.m0 * heavier,
        k0=model.k0 * stiffer,
        m=model.m * heavier,
        omega=model.omega * np.sqrt(stiffer / heavier),
        participation=None if p is None else p * heavier,
    )
    changed = impact.change(curved)
    return bars.with_floor({name: SAFETY * off for name, off in changed.items()}), [facts["note"]]
