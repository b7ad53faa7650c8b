"""A scene run to its tolerance: start, error control, balance of energy, status and message."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeVar

import numpy as np

from antiosc.base import checks, plausible
from antiosc.base._types import Array
from antiosc.base.errors import AccuracyError, AccuracyWarning, warn
from antiosc.contact import ContactLaw
from antiosc.simulation.errors.left_out import too_few
from antiosc.simulation.histories.history import History, SceneHistory
from antiosc.simulation.histories.scene_energy import GAIN, gained
from antiosc.simulation.histories.verdict import Verdict, judge, tell_rotation
from antiosc.simulation.integrators.comparison import METHODS, compared
from antiosc.simulation.integrators.scene_ivp import IVP_METHODS
from antiosc.simulation.march.convergence import Converged, converge, stopped
from antiosc.simulation.march.equilibrium import closed, settle
from antiosc.simulation.march.given_step import checked_step, stepped
from antiosc.simulation.problem.assembly import Assembly, assemble
from antiosc.simulation.problem.expected import stiffness_at
from antiosc.simulation.problem.scene_parts import SceneParts
from antiosc.simulation.problem.scene_states import touching

#: Contacts that a message names.
NAMED = 5
#: A closing speed below this share of the modal contributions is rounding error.
ROUNDING = 1e-12


def integrate(
    scene: SceneParts,
    duration: float,
    tol: float,
    max_contacts: int,
    max_steps: int,
    method: str = "exact",
    step: float | None = None,
) -> SceneHistory:
    """The history of a scene; see `Scene.run`."""
    duration = checks.positive("duration", duration, "s")
    tol = checks.tolerance(tol)
    max_contacts = checks.whole("max_contacts", max_contacts)
    max_steps = checks.whole("max_steps", max_steps)
    checks.choice("method", method, METHODS)
    bodies = list(scene.bodies.values())
    doubts = [*plausible.of_model(*bodies), *plausible.tell(_of_blows(scene))]
    assembly = assemble(scene, duration)
    start(assembly)
    history, verdict = solved(
        SceneHistory, assembly, duration, tol, method, step, max_contacts, max_steps
    )
    tell_rotation(*history.largest_rotation())
    verdict.tell()
    _tell_too_few(scene, history)
    check_range(history, doubts)
    return history


def _tell_too_few(scene: SceneParts, history: SceneHistory) -> None:
    """Warn of a body whose anti-oscillators are too few for a contact of the run."""
    assembly = history.assembly
    for c, (contact, one) in enumerate(zip(scene.contacts, history.contact_histories, strict=True)):
        for end in (contact.a, contact.b) if one.contacts else ():
            name = end.partition(":")[0]
            begin = assembly.spans[name].start if name in assembly.spans else 0
            if sentence := too_few(scene.bodies.get(name), assembly, c, begin):
                warn(f"{name!r} in the contact of {contact.a!r} and {contact.b!r}: {sentence}",
                     AccuracyWarning)  # fmt: skip


H = TypeVar("H", bound=History)


class Ended(NamedTuple):
    """How a run ended: what its verdict is made of.

    `time` [s] reached, `touches` their number, `open` the contacts that go on, and the errors.
    """

    answer: int
    time: float
    touches: int
    open: Sequence[int]
    force: float
    peak: float
    certain: float


def solved(
    kind: Callable[..., H],
    assembly: Assembly,
    duration: float,
    tol: float,
    method: str,
    step: float | None,
    max_contacts: int,
    max_steps: int,
) -> tuple[H, Verdict]:
    """The history of what is ready to integrate, and the verdict, of which nobody is told yet."""
    step = None if step is None else checked_step(step, duration)
    limits = max_contacts, max_steps
    if method == "exact":
        found, failure = exactly(assembly, duration, tol, step, *limits)
    else:
        found, failure = compared(assembly, duration, method, tol, step, *limits), ""
    run = found.run
    ended = Ended(
        run.answer, float(run.time[-1]), run.touches, touching(run, assembly.system), found.force,
        found.peak, found.certain,
    )  # fmt: skip
    verdict = verdict_of(assembly, ended, tol, limits, failure, lambda: gained(assembly, run))
    known = step is None and method not in IVP_METHODS
    error = {"force": found.force, "peak": found.peak} if known else {}
    message = " ".join([verdict.message, *assembly.notes])
    return kind(assembly, run, error, verdict.status, message, given=step), verdict


def verdict_of(
    assembly: Assembly,
    ended: Ended,
    tol: float,
    limits: tuple[int, int],
    failure: str = "",
    gain: Callable[[], float] = lambda: 0.0,
) -> Verdict:
    """The verdict on a run; `limits`: max_contacts, max_steps; `gain`: relative, of energy."""
    failure = failure or stopped(ended.answer, ended.time, *limits)
    return judge(
        failure,
        never_touched(assembly, ended),
        "" if failure else inexact(ended, tol, limits[1], gain),
        cut_short(assembly, ended),
    )


def check_range(history: History, doubts: Sequence[str] = ()) -> None:
    """AccuracyError, behind what is implausible, if a force leaves the range of its law."""
    a = history.assembly
    if all(law.valid_force == np.inf for law in a.laws):
        return
    for c, (contact, law) in enumerate(zip(a.scene.contacts, a.laws, strict=True)):
        if law.valid_force == np.inf:
            continue
        where = f"contact {contact.a!r}, {contact.b!r}: " if len(a.laws) > 1 else ""
        peak = history.contact_histories[c].peak_force
        if peak > law.valid_force:
            radius = a.bodies[contact.a.partition(":")[0]].patch_radius
            raise beyond_law(law, peak, radius, doubts, where)


def beyond_law(
    law: ContactLaw, peak: float, radius: float | None, doubts: Sequence[str], where: str = ""
) -> AccuracyError:
    """The error for a peak force out of the range of its law; `radius` [m] of the patch."""
    return AccuracyError(plausible.first(doubts, f"{where}{law.out_of_range(peak, radius)}."))


def _of_blows(scene: SceneParts) -> list[str]:
    """What is implausible of the blows of a scene, on each of its bodies."""
    bodies, motions = list(scene.bodies.values()), list((scene.motion or {}).values())
    return [plausible.of_blow(body, bodies, *motions) for body in bodies]


def start(assembly: Assembly, cut: tuple[Array, Array] | None = None) -> None:
    """Forces of the contacts that are closed at the start, at rest if the scene asks for it.

    Without preload only a load on a site without mass closes a contact at once, or a run before.

    Parameters
    ----------
    cut : closing speeds (p,) [m/s] of the contacts that go on from a run before (`Run.closing`), 0
        of others, and their forces (p,) [N].
    """
    system, laws = assembly.system, assembly.laws
    if assembly.scene.preload:
        system.q, system.pressed = settle(system, laws)
    else:
        system.pressed = closed(system, laws)
    if cut is not None:
        system.closing = cut[0]
        system.pressed = np.where(cut[0] > 0, cut[1], system.pressed)
    if system.pressed.any():
        p = len(laws)
        delta = system.beta[:p] @ system.q - system.offsets[0, :p]
        delta = np.maximum(delta - system.R[:p, :p] @ system.pressed, 0.0)
        system.depth = np.maximum(system.depth, delta)
        system.given = sum(
            law.potential(float(d), law.touch(0.0)) for law, d in zip(laws, delta, strict=True)
        )
        system.given += 0.5 * float(system.pressed @ system.R[:p, :p] @ system.pressed)


def exactly(
    assembly: Assembly,
    duration: float,
    tol: float,
    step: float | None,
    max_contacts: int,
    max_steps: int,
) -> tuple[Converged, str]:
    """The run by the exact method, and why a given step [s] failed."""
    system, laws = assembly.system, assembly.laws
    if step is None:
        limits = max_contacts, max_steps
        return converge(system, assembly.lasting, duration, tol, *limits), ""

    def stiffness() -> Array:
        return np.array(
            [
                stiffness_at(law, float(depth), law.touch(float(speed)))
                for law, depth, speed in zip(laws, system.depth, system.speed, strict=True)
            ]
        )

    found, failure = stepped(system, stiffness, duration, step, max_contacts, max_steps)
    return Converged(found, step, 0.0, 0.0, duration), failure


def inexact(ended: Ended | Converged, tol: float, max_steps: int, gain: Callable[[], float]) -> str:
    """Why a run that reached its end does not meet the tolerance; "" if it does."""
    worst = max(ended.force, ended.peak)
    if worst == np.inf:
        if ended.certain > 0:
            return (
                f"The error is not known: a finer run takes too many steps. Up to"
                f" {ended.certain:.4g} s the two agree; shorten the duration to that."
            )
        return (
            f"The error is not known: max_steps = {max_steps} leaves no finer run to compare with;"
            f" raise it or shorten the duration."
        )
    if not worst <= tol:
        return (
            f"The contact forces did not converge: finer runs within max_steps = {max_steps} differ"
            f" by {worst:.2g}, not tol = {tol:g} (if they rattle, small errors grow). Up to"
            f" {ended.certain:.4g} s they agree; raise max_steps, or shorten the duration to that."
        )
    share = gain()
    if share > GAIN:
        return (
            f"The scene gained energy, {share:.2g} of the highest that it had; use a smaller tol or"
            f" step."
        )
    return ""


def cut_short(assembly: Assembly, ended: Ended) -> str:
    """Which contacts go on at the end of the run; those that rest since its start do not count."""
    contacts = [assembly.scene.contacts[c] for c in ended.open]
    if not contacts:
        return ""
    named = ", ".join(f"{c.a!r} - {c.b!r}" for c in contacts[:NAMED])
    more = ", ..." if len(contacts) > NAMED else ""
    return (
        f"The run ends during contact of {named}{more}: contact time, impulse and peak force are"
        f" those up to {ended.time:g} s; lengthen the duration."
    )


def never_touched(assembly: Assembly, ended: Ended) -> str:
    """Why no contact touched, which may come from a wrong sign; "" if one did."""
    system = assembly.system
    if ended.touches or np.any(system.pressed):
        return ""
    p = len(assembly.laws)
    speed, push = _felt(system.beta[:p], system.v), _felt(system.beta[:p], system.loads[0])
    for motion, unit in ((speed, "m/s"), (push, "m/s^2")):
        c = int(np.argmax(motion))
        contact, most = assembly.scene.contacts[c], float(motion[c])
        if most > 0:
            return (
                f"the gap of {system.offsets[0, c]:g} m of {contact.a!r}, {contact.b!r} closes at"
                f" {most:g} {unit} at first and was not closed within {ended.time:g} s; lengthen"
                f" the duration"
            )
        if np.any(motion < 0):
            return (
                f"the gap of {contact.a!r}, {contact.b!r} opens at {-most:g} {unit} at first; if it"
                f" should close, reverse the sign of the velocity or gravity or, in a scene, the"
                f" ends"
            )
    if system.breaks.size > 1:  # what acts changes in time
        return f"no contact closed within {ended.time:g} s; lengthen the duration"
    return "nothing moves the bodies toward each other; give one a velocity > 0, or gravity"


def _felt(beta: Array, modal: Array) -> Array:
    """beta modal (p,), 0 where it is rounding."""
    felt = beta @ modal
    return np.where(abs(felt) > ROUNDING * (abs(beta) @ abs(modal)), felt, 0.0)
