"""Rotations and deflections in a run that leave linear theory: messages and warnings."""

from __future__ import annotations

from collections.abc import Iterator
from weakref import WeakKeyDictionary

import numpy as np

from antiosc.base import errors
from antiosc.base._types import Array
from antiosc.base.texts import engineering, percent, plain
from antiosc.impact.bodies import SceneBody
from antiosc.impact.histories.motion import RunHistory
from antiosc.impact.states import free_steps
from antiosc.models.body import info_of
from antiosc.models.stretch import stretch_of

#: Rotation [rad] of a body above which a warning is given.
SMALL_ROTATION = 0.1


def warn_large_rotation(name: str, angle: float) -> None:
    """Warn of a body whose rotation is not small."""
    if angle > SMALL_ROTATION:
        errors.warn(
            f"{name!r} turned by {angle:.2g} rad; rotations are taken as small, below"
            f" {SMALL_ROTATION:g} rad.",
            errors.AccuracyWarning,
        )


#: Deflection over the thickness up to which a sheet that is held hardly stretches: at a clamped
#: circle's half thickness the stretching adds 11 % to the force (1 + 0.443 (w/h)²).
SMALL_DEFLECTION = 0.5
#: Looks at a run in a period of the lowest mode, as a flight is one step, and at most in all.
SAMPLES_PER_PERIOD = 32
MOST_SAMPLES = 4096
REMEDY = (
    'take the stretch "auto" of extract or impact_map, which has these forces of a part of one mesh'
)


#: Energy of second-order strain in a linear run over the linear one from which no run with it
#: is tried: a clamped disc whose linear run has it at 9.5 thicknesses would deflect by 4.2
#: (w² + 0.22 w⁴ = 9.5²), more than second-order strain in a few modes holds for. A foil of 0.2 mm
#: under 20 g took 8 minutes for the same verdict.
HOPELESS = 20.0


def beyond_linear(name: str, deflection: float, thickness: float) -> str:
    """Warning that the deflection [m] of a supported sheet exceeds linear theory; "" if not."""
    ratio = deflection / thickness
    if not ratio > SMALL_DEFLECTION:
        return ""
    return (
        f"{name!r} deflects by {1e3 * deflection:.3g} mm, {ratio:.3g} times its thickness"
        f" {1e3 * thickness:.3g} mm, more than {SMALL_DEFLECTION:g}, up to which"
        f" linear theory holds: where its edges are held it stretches and is stiffer,"
        f" forces are larger and deflections smaller than these (a cantilever, or a part"
        f" on soft springs, hardly stretches); {REMEDY}."
    )


#: Deflection over the thickness up to which forces to third order hold (measured).
QUARTIC = 3.0
#: Share of that up to which the ends of steps tell enough: a body that stretches has no flights.
FAR = 0.8


def _slower(speed: float) -> str:
    """End of a sentence: the speed [m/s] up to which the deflection is small enough; "" of 0."""
    if not speed:
        return ""
    return f"; up to about {engineering(speed, 'm/s', 2)} its deflection is small enough here"


def beyond_quartic(name: str, deflection: float, thickness: float) -> str:
    """Warning that the deflection [m] of a sheet exceeds second-order theory; "" if not."""
    ratio = deflection / thickness
    if not ratio > QUARTIC:
        return ""
    return (
        f"{name!r} deflects by {1e3 * deflection:.3g} mm, {ratio:.3g} times its"
        f" thickness, more than {QUARTIC:g}, up to which second-order strain in a few modes holds:"
        " analyse it by an explicit finite element program."
    )


def large_deflection_message(history: RunHistory) -> str:
    """Warning of the worst deflection of a supported sheet beyond linear theory; "" if none."""
    worst = 0.0
    message = ""
    for name, body, h in _sheets(history):
        if not body.omega.all():  # it is free
            continue
        stretches = stretch_of(body.body) is not None
        sentence = "" if stretches else _beyond_linear_of_curved(name, body, h, history)
        if sentence:
            return sentence
        ends = name in history.assembly.stretched and deflection(history, name, closely=False)
        if ends and ends < FAR * QUARTIC * h:
            continue
        w = deflection(history, name)
        if w > worst * h:
            worst = w / h
            message = (beyond_quartic if stretches else beyond_linear)(name, w, h)
    return message


def stretch_effect(history: RunHistory) -> str:
    """How much second-order forces change the largest force, as the end of a sentence."""
    change = history.assembly.stretch_effect
    if abs(change) <= history.error.get("peak", 0.0):
        return (
            "matter little: they change the largest force by less than its error by the time steps"
        )
    return f"make the largest force {percent(abs(change))} {'larger' if change > 0 else 'smaller'}"


def linear_texts(history: RunHistory) -> Iterator[str]:
    """Sentences on sheets and thin solids whose linear model stands, though not far below its
    limit.
    """
    if history.assembly.hopeless:
        return
    if left_out := history.assembly.stretch_left_out:
        yield (
            "'structure' is taken as linear: the energy of second-order strain is"
            f" {percent(left_out)} of that of its motion at the largest force"
        )
        return
    for name, body in history.assembly.bodies.items():
        bends = info_of(body.body).bends
        if bends is not None:
            yield from filter(None, [held_along_line(name, deflection(history, name) / bends)])
    for name, body, h in _sheets(history):
        ratio = deflection(history, name) / h if body.omega.all() else 0.0
        if SLIGHT_DEFLECTION < ratio <= SMALL_DEFLECTION:  # beyond, a warning tells it
            yield (
                f"{name!r} is taken as linear, without stretching: it deflects by {ratio:.2g} times"
                " its thickness"
            )


#: Largest share by which forces of a sheet that nothing stretches are larger where it bends in two
#: directions at once, up to a deflection of so many thicknesses.
BENT_TWICE = ((0.5, "2.3 %"), (1.0, "9 %"), (2.0, "17 %"))


def held_along_line(name: str, ratio: float) -> str:
    """Sentence on a sheet that is held along one line and deflects by `ratio` thicknesses; "" if
    it hardly does.
    """
    if not ratio > SLIGHT_DEFLECTION:
        return ""
    words = (
        f"{name!r} is held along one line, so that it bends by {ratio:.2g} times its thickness"
        " at the site without stretching where it bends in one direction"
    )
    share = next((share for most, share in BENT_TWICE if ratio <= most), "")
    if not share:
        return f"{words}; where it bends in two at once, an explicit finite element program decides"
    return f"{words}; where it bends in two at once, forces are up to {share} larger than these"


#: The force at a deflection w is at most 1 + 1.85 (w/h)² that of linear theory, of a disc with a
#: hinged edge that does not move (S. Timoshenko, S. Woinowsky-Krieger, *Theory of Plates and
#: Shells*, table 82).
HINGED = 1.85
#: Change that is noticeable (`NEGLIGIBLE` of `antiosc.impact.stretching`), and the deflection over
#: the thickness that may make it.
SLIGHT_CHANGE = 3e-3
SLIGHT_DEFLECTION = 0.04


def may_stretch(history: RunHistory) -> bool:
    """Whether second-order strain may change a linear run of sheets noticeably."""
    return stretch_estimate(history) > SLIGHT_CHANGE


def hopeless_text(history: RunHistory, energy: float) -> str:
    """Sentence on a linear run whose second-order strain has this energy, over that of linear
    strain: so much that a few modes do not hold it.
    """
    deflects, remedy = _far(history)
    return (
        f"{deflects}, and second-order strain would take {plain(energy)} times the energy of"
        " linear strain: neither theory holds, and no number here does. The part is far stiffer"
        f" than that: forces and stresses are larger, and the contact is shorter. {remedy}"
    )


def run_away_text(history: RunHistory, how: str) -> str:
    """Sentence on a linear run whose second-order forces do not settle; `how`: what they do."""
    deflects, remedy = _far(history)
    return (
        f"{deflects}, and second-order forces {how}: neither theory holds. The numbers are those of"
        f" the linear run, and may be far off. {remedy}"
    )


def _far(history: RunHistory) -> tuple[str, str]:
    """(start of a sentence on the worst deflection of a linear run, what is to be done)."""
    name, w, h = max(
        ((name, deflection(history, name), h) for name, _, h in _sheets(history)),
        key=lambda found: found[1] / found[2],
    )
    deflects = (
        f"{name!r} deflects by {1e3 * w:.3g} mm in the linear run, {w / h:.3g} times its thickness"
        f" {1e3 * h:.3g} mm"
    )
    slower = _slower(QUARTIC * h / w * _speed(history)) if w > QUARTIC * h else ""
    return deflects, f"Analyse it by an explicit finite element program{slower}."


def _speed(history: RunHistory) -> float:
    """Speed of the striker of an impact [m/s]; 0 where there is none."""
    speed = getattr(getattr(history, "impactor", None), "velocity", None)
    return speed if isinstance(speed, float) else 0.0


def is_far(history: RunHistory) -> bool:
    """Whether a linear run deflects beyond second-order theory, without its stretching."""
    held = ((name, h) for name, body, h in _sheets(history) if body.omega.all())
    return any(deflection(history, name) > QUARTIC * h for name, h in held)


def stretch_estimate(history: RunHistory) -> float:
    """About the largest share by which second-order strain may change the force of a linear run."""
    changes = (
        max(
            HINGED * (deflection(history, name) / h) ** 2,
            abs(_worst_change(name, body, history)[0]),
        )
        for name, body, h in _sheets(history)
    )
    return max(changes, default=0.0)


def _sheets(history: RunHistory) -> Iterator[tuple[str, SceneBody, float]]:
    """Yield name, body and thickness [m] of each sheet or thin solid that is not a cantilever."""
    if not history.assembly.thin:
        return
    for name, body in history.assembly.bodies.items():
        h = info_of(body.body).thickness
        if h is not None:
            yield name, body, h


def deflection(history: RunHistory, name: str, closely: bool = True) -> float:
    """Largest displacement [m] of a body's sites along the contacts, by elastic modes alone.

    closely : whether to sample many times, instead of the ends of steps alone.
    """
    known = _deflections.setdefault(history, {})
    if (name, closely) not in known:
        known[name, closely] = _deflection(history, name, closely)
    return known[name, closely]


#: Deflections of runs by bodies: texts, bars and choices ask for the same ones.
_deflections: WeakKeyDictionary[RunHistory, dict[tuple[str, bool], float]] = WeakKeyDictionary()


def _deflection(history: RunHistory, name: str, closely: bool) -> float:
    """`deflection` of a run, whose motion is sampled."""
    a = history.assembly
    omega = a.bodies[name].omega
    span = a.spans[name]
    columns = a.columns[name]
    sites = a.B[span, columns] @ a.G[: len(a.laws), columns].T
    q = sampled_motion(history, omega) if closely else free_steps(history.run, a.system)
    return float(np.abs(q[:, span] @ (sites * (omega > 0)[:, None])).max(initial=0.0))


#: Change of the force by second-order strain from which a curved sheet is told: of a peak force,
#: which grows as the root of the stiffness, about twice its own change.
CURVED_CHANGE = 0.1


def _beyond_linear_of_curved(
    name: str, body: SceneBody, thickness: float, history: RunHistory
) -> str:
    """Warning of the deflection of a curved, supported sheet at its worst site; "" if none."""
    change, w = _worst_change(name, body, history)
    if abs(change) <= CURVED_CHANGE:
        return ""
    softer = "softer, forces are smaller and deflections larger than these, and it may snap through"
    stiffer = "stiffer, forces are larger and deflections smaller than these"
    return (
        f"{name!r}, a curved sheet, deflects by {1e3 * w:.3g} mm, {w / thickness:.3g} times its"
        f" thickness: second-order strain changes its force by about {change:+.0%}: it is"
        f" {softer if change < 0 else stiffer}; {REMEDY}."
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


def sampled_motion(history: RunHistory, omega: Array) -> Array:
    """Modal displacements (n, J) at the ends of steps and at evenly spaced times."""
    end = float(history.run.time[-1])
    periods = end * float(omega[omega > 0].min(initial=np.inf)) / (2 * np.pi)
    periods = periods if np.isfinite(periods) else 0.0
    t = np.linspace(0.0, end, int(min(MOST_SAMPLES, SAMPLES_PER_PERIOD * (1 + periods))))
    return np.vstack([free_steps(history.run, history.assembly.system), history.states(t)[0]])
