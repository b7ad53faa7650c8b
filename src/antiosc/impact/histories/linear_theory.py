"""Rotations and deflections in a run that leave linear theory: messages and warnings."""

from __future__ import annotations

from collections.abc import Iterator
from weakref import WeakKeyDictionary

import numpy as np

from antiosc.base import errors
from antiosc.base._types import Array
from antiosc.base.texts import percent
from antiosc.impact.bodies import SceneBody
from antiosc.impact.histories.motion import RunHistory
from antiosc.impact.states import free_steps
from antiosc.models.body import info_of
from antiosc.models.stretch import stretch_of

#: Rotation [rad] of a body above which a warning is given.
SMALL_ROTATION = 0.1
#: Deflection over the thickness up to which a sheet that is held hardly stretches: at a clamped
#: circle's half thickness the stretching adds 11 % to the force (1 + 0.443 (w/h)²).
SMALL_DEFLECTION = 0.5
#: The same up to which forces to third order hold (measured).
QUARTIC = 3.0
#: Energy of second-order strain in a linear run over the linear one from which no run with it
#: is tried: a clamped disc whose linear run has it at 9.5 thicknesses would deflect by 4.2.
HOPELESS = 20.0
#: Change that is noticeable (`NEGLIGIBLE` of `antiosc.impact.stretching`), and the deflection over
#: the thickness that may make it.
SLIGHT_CHANGE = 3e-3
SLIGHT_DEFLECTION = 0.04
#: The force at a deflection w is at most 1 + 1.85 (w/h)² that of linear theory, of a disc with a
#: hinged edge that does not move (S. Timoshenko, S. Woinowsky-Krieger, *Theory of Plates and
#: Shells*, table 82).
HINGED = 1.85
#: Change of the force by second-order strain from which a curved sheet is told.
CURVED_CHANGE = 0.1
#: Looks at a run in a period of the lowest mode, as a flight is one step, and at most in all.
SAMPLES_PER_PERIOD = 32
MOST_SAMPLES = 4096
REMEDY = (
    'take the stretch "auto" of extract or impact_map, which has these forces of a part of one mesh'
)
EXPLICIT = "analyse it by an explicit finite element program"


def warn_large_rotation(name: str, angle: float) -> None:
    """Warn of a body whose rotation is not small."""
    if angle > SMALL_ROTATION:
        errors.warn(
            f"{name!r} turned by {angle:.2g} rad; rotations are taken as small, below"
            f" {SMALL_ROTATION:g} rad.",
            errors.AccuracyWarning,
        )


def beyond_linear(name: str, deflection: float, thickness: float) -> str:
    """Warning that the deflection [m] of a supported sheet exceeds linear theory; "" if not."""
    if not deflection > SMALL_DEFLECTION * thickness:
        return ""
    return (
        f"{_deflects(name, deflection, thickness)}, more than {SMALL_DEFLECTION:g}, up to which"
        " linear theory holds: where its edges are held it stretches and is stiffer, forces are"
        " larger and deflections smaller than these (a cantilever, or a part on soft springs,"
        f" hardly stretches); {REMEDY}."
    )


def beyond_quartic(name: str, deflection: float, thickness: float) -> str:
    """Warning that the deflection [m] of a sheet exceeds second-order theory; "" if not."""
    if not deflection > QUARTIC * thickness:
        return ""
    return (
        f"{_deflects(name, deflection, thickness)}, more than {QUARTIC:g}, up to which second-order"
        f" strain in a few modes holds: {EXPLICIT}."
    )


def _deflects(name: str, deflection: float, thickness: float) -> str:
    """Start of a sentence on a deflection [m]."""
    return (
        f"{name!r} deflects by {1e3 * deflection:.3g} mm, {deflection / thickness:.3g} times its"
        f" thickness {1e3 * thickness:.3g} mm"
    )


def large_deflection_message(history: RunHistory) -> str:
    """Warning of the worst deflection of a supported sheet beyond linear theory; "" if none."""
    worst = 0.0
    message = ""

    for name, body, h in _held_sheets(history):
        stretches = stretch_of(body.body) is not None
        change, _ = _worst_change(name, body, history)
        if not stretches and abs(change) > CURVED_CHANGE:
            return _beyond_linear_of_curved(name, body, h, history)
        w = deflection(history, name)
        if w > worst * h:
            worst = w / h
            message = (beyond_quartic if stretches else beyond_linear)(name, w, h)

    return message


def _beyond_linear_of_curved(
    name: str, body: SceneBody, thickness: float, history: RunHistory
) -> str:
    """Warning of the deflection of a curved, supported sheet at its worst site."""
    change, w = _worst_change(name, body, history)
    effect = "stiffer, forces are larger and deflections smaller than these"
    if change < 0:
        effect = "softer, forces are smaller than these, and it may snap through"
    return (
        f"{_deflects(name, w, thickness)}; it is a curved sheet: second-order strain changes its"
        f" force by about {change:+.0%}: it is {effect}; {REMEDY}."
    )


def _worst_change(name: str, body: SceneBody, history: RunHistory) -> tuple[float, float]:
    """Largest relative change of the force on a curved sheet, and the deflection [m]."""
    shares = info_of(body.body).second_order or {}
    if not shares:
        return 0.0, 0.0

    motion = sampled_motion(history, body.omega)[:, history.assembly.spans[name]]
    changes = []

    for site, share in shares.items():
        u = motion @ body.B[:, body.columns_of(site)[0]]
        k = int(np.argmax(np.abs(u)))
        changes.append((share * float(u[k]), abs(float(u[k]))))

    return max(changes, key=lambda change: abs(change[0]))


def stretch_effect(history: RunHistory) -> str:
    """How much second-order forces change the largest force, as the end of a sentence."""
    change = history.assembly.stretch_effect
    if abs(change) <= history.error.get("peak", 0.0):
        return (
            "matter little: they change the largest force by less than its error by the time steps"
        )
    return f"make the largest force {percent(abs(change))} {'larger' if change > 0 else 'smaller'}"


def linear_texts(history: RunHistory) -> Iterator[str]:
    """Sentences on thin solids and on sheets held along one line, which are taken as linear."""
    if history.assembly.hopeless:
        return
    if left_out := history.assembly.stretch_left_out:
        yield (
            "'structure' is taken as linear: the energy of second-order strain is"
            f" {percent(left_out)} of that of its motion at the largest force"
        )
        return

    for name, body in history.assembly.bodies.items():
        h = info_of(body.body).bends
        ratio = 0.0 if h is None else deflection(history, name) / h
        if ratio > SMALL_DEFLECTION:
            yield (
                f"{name!r} is held along one line, so that it bends by {ratio:.2g} times its"
                " thickness at the site without stretching where it bends in one direction; where"
                " it bends in two at once, forces are up to 17 % larger than these, and beyond 2"
                f" thicknesses more: {EXPLICIT}"
            )


def neither_theory(history: RunHistory, why: str) -> str:
    """Sentence on a linear run that second-order forces do not mend either."""
    sheets = ((name, deflection(history, name), h) for name, _, h in _sheets(history))
    name, w, h = max(sheets, key=lambda sheet: sheet[1] / sheet[2])
    return (
        f"{_deflects(name, w, h)} in the linear run, and {why}: neither theory holds, and no number"
        f" here does. The part is stiffer than that; {EXPLICIT}."
    )


def is_far(history: RunHistory) -> bool:
    """Whether a linear run deflects beyond second-order theory, without its stretching."""
    return any(deflection(history, name) > QUARTIC * h for name, _, h in _held_sheets(history))


def may_stretch(history: RunHistory) -> bool:
    """Whether second-order strain may change a linear run of sheets noticeably."""
    return stretch_estimate(history) > SLIGHT_CHANGE


def stretch_estimate(history: RunHistory) -> float:
    """About the largest share by which second-order strain may change the force of a linear run."""
    worst = 0.0
    for name, body, h in _sheets(history):
        bent = HINGED * (deflection(history, name) / h) ** 2
        worst = max(worst, bent, abs(_worst_change(name, body, history)[0]))
    return worst


def _sheets(history: RunHistory) -> Iterator[tuple[str, SceneBody, float]]:
    """Yield name, body and thickness [m] of each sheet or thin solid that is not a cantilever."""
    if not history.assembly.thin:
        return
    for name, body in history.assembly.bodies.items():
        h = info_of(body.body).thickness
        if h is not None:
            yield name, body, h


def _held_sheets(history: RunHistory) -> Iterator[tuple[str, SceneBody, float]]:
    """Those of `_sheets` that do not move as a whole."""
    return (sheet for sheet in _sheets(history) if sheet[1].omega.all())


#: Deflections of runs by bodies: texts, bars and choices ask for the same ones.
_deflections: WeakKeyDictionary[RunHistory, dict[str, float]] = WeakKeyDictionary()


def deflection(history: RunHistory, name: str) -> float:
    """Largest displacement [m] of a body's sites along the contacts, by elastic modes alone."""
    known = _deflections.setdefault(history, {})
    if name not in known:
        a = history.assembly
        omega = a.bodies[name].omega
        span = a.spans[name]
        columns = a.columns[name]
        sites = a.B[span, columns] @ a.G[: len(a.laws), columns].T
        q = sampled_motion(history, omega)[:, span]
        known[name] = float(np.abs(q @ (sites * (omega > 0)[:, None])).max(initial=0.0))
    return known[name]


def sampled_motion(history: RunHistory, omega: Array) -> Array:
    """Modal displacements (n, J) at the ends of steps and at evenly spaced times."""
    end = float(history.run.time[-1])
    periods = end * float(omega[omega > 0].min(initial=np.inf)) / (2 * np.pi)
    periods = periods if np.isfinite(periods) else 0.0
    t = np.linspace(0.0, end, int(min(MOST_SAMPLES, SAMPLES_PER_PERIOD * (1 + periods))))

    return np.vstack([free_steps(history.run, history.assembly.system), history.states(t)[0]])
