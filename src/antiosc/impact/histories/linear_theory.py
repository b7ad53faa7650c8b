"""Messages and warnings on rotations and deflections in a run beyond linear theory."""

from __future__ import annotations

from collections.abc import Iterator
from weakref import WeakKeyDictionary

import numpy as np

from antiosc.base import errors
from antiosc.base._types import Array
from antiosc.impact.histories.motion import RunHistory
from antiosc.impact.states import modal_states, step_end_displacements, steps_at

#: Rotation [rad] of a body above which a warning is given.
SMALL_ROTATION = 0.1
#: Deflection over the thickness of a sheet that is held all around, up to which linear theory
#: holds: at a clamped circle's half thickness stretching adds 11 % to the force, 1 + 0.443 (w/h)².
LINEAR_DEFLECTION_RATIO = 0.5
#: Ratio of deflection to thickness up to which third-order forces are valid (measured).
THIRD_ORDER_DEFLECTION_RATIO = 3.0
#: The same from which the force may change by 0.3 %: 1.85 (w/h)² of a disc with a hinged edge that
#: does not move (S. Timoshenko, S. Woinowsky-Krieger, *Theory of Plates and Shells*, table 82).
SLIGHT_DEFLECTION_RATIO, SLIGHT_FORCE_CHANGE = 0.04, 3e-3
#: Relative change of the force by second-order strain from which a curved sheet is reported.
CURVED_FORCE_CHANGE = 0.1
#: Samples in a period of the lowest mode (a flight is only one step), and largest total number.
SAMPLES_PER_PERIOD, MAX_SAMPLES = 32, 4096
STRETCH_REMEDY = 'take the stretch "auto" of extract, which has these forces'
EXPLICIT_REMEDY = "analyse it by an explicit finite element program"


def warn_large_rotation(name: str, angle: float) -> None:
    """Warn of a body whose rotation is not small."""
    if angle > SMALL_ROTATION:
        told = f"{name!r} turned by {angle:.2g} rad; rotations are taken as small, below"
        errors.warn(f"{told} {SMALL_ROTATION:g} rad.", errors.AccuracyWarning)


def deflection_text(name: str, deflection: float, thickness: float) -> str:
    """First words of a sentence on a deflection [m]."""
    return (
        f"{name!r} deflects by {1e3 * deflection:.3g} mm, {deflection / thickness:.3g} times its"
        f" thickness {1e3 * thickness:.3g} mm"
    )


def beyond_theory_text(name: str, deflection: float, thickness: float, stretches: bool) -> str:
    """Warning of a sheet's deflection [m] beyond the theory of the run; "" if within."""
    limit = THIRD_ORDER_DEFLECTION_RATIO if stretches else LINEAR_DEFLECTION_RATIO
    if not deflection > limit * thickness:
        return ""
    far = f"{deflection_text(name, deflection, thickness)}, more than {limit:g}, up to which"
    if stretches:
        return f"{far} second-order strain in a few modes holds: {EXPLICIT_REMEDY}."
    return (
        f"{far} linear theory holds: where its edges are held it stretches, forces are larger and"
        f" deflections smaller than these; {STRETCH_REMEDY}."
    )


def large_deflection_message(history: RunHistory) -> str:
    """Warning of the worst deflection of a supported sheet beyond the theory; "" if none."""
    worst = 0.0
    message = ""

    for name, h in sheets_of_run(history, supported=True):
        stretches = history.assembly.bodies[name].stretch is not None
        w = largest_deflection(history, name)
        change = curved_force_change(history, name)
        if abs(change) > CURVED_FORCE_CHANGE and not stretches:
            effect = "stiffer" if change > 0 else "softer, and it may snap through"
            return (
                f"{deflection_text(name, w, h)}; it is a curved sheet: second-order strain changes"
                f" its force by about {change:+.0%}: it is {effect}; {STRETCH_REMEDY}."
            )
        if w > worst * h:
            worst = w / h
            message = beyond_theory_text(name, w, h, stretches)

    return message


def curved_force_change(history: RunHistory, name: str) -> float:
    """Largest share of second-order strain in the force on the body `name` if it is a curved sheet,
    else 0."""
    body = history.assembly.bodies[name]
    shares = body.info.get("second_order")
    if not shares:
        return 0.0

    motion = sampled_motion(history, body.omega)[:, history.assembly.stacked.spans[name]]
    changes = []
    for site, share in shares.items():
        u = share * (motion @ body.modes.B[:, body.sites[site][0]])
        changes.append(float(u[np.argmax(np.abs(u))]))

    return max(changes, key=abs)


def may_stretch(history: RunHistory) -> bool:
    """Whether second-order strain may change a linear run of sheets noticeably."""
    return any(
        largest_deflection(history, name) > SLIGHT_DEFLECTION_RATIO * h
        or abs(curved_force_change(history, name)) > SLIGHT_FORCE_CHANGE
        for name, h in sheets_of_run(history)
    )


def sheets_of_run(history: RunHistory, supported: bool = False) -> Iterator[tuple[str, float]]:
    """Yield (name, thickness [m]) of each sheet or thin solid; `supported`: only supported ones."""
    for name, body in history.assembly.bodies.items():
        h = body.info.thickness
        if h is not None and (body.omega.all() or not supported):
            yield name, h


#: Cache: run -> {body: largest deflection}.
_known_deflections: WeakKeyDictionary[RunHistory, dict[str, float]] = WeakKeyDictionary()


def largest_deflection(history: RunHistory, name: str) -> float:
    """Largest displacement [m] of a body's sites along the contacts, in elastic modes only."""
    known = _known_deflections.setdefault(history, {})
    if name not in known:
        a = history.assembly
        omega = a.bodies[name].omega
        span, columns = a.stacked.spans[name], a.stacked.columns[name]
        sites = a.stacked.B[span, columns] @ a.G[: len(a.laws), columns].T
        q = sampled_motion(history, omega)[:, span]
        known[name] = float(np.abs(q @ (sites * (omega > 0)[:, None])).max(initial=0.0))

    return known[name]


def sampled_motion(history: RunHistory, omega: Array) -> Array:
    """Modal displacements (n, J) at the ends of steps and at evenly spaced times."""
    end = float(history.run.time[-1])
    periods = end * float(omega[omega > 0].min(initial=np.inf)) / (2 * np.pi)
    periods = periods if np.isfinite(periods) else 0.0
    t = np.linspace(0.0, end, int(min(MAX_SAMPLES, SAMPLES_PER_PERIOD * (1 + periods))))

    run, system = history.run, history.assembly.system
    return np.vstack(
        [step_end_displacements(run, system), modal_states(run, system, *steps_at(run, t))[0]]
    )
