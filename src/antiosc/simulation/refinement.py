"""A scene run to its tolerance: start, error control, balance of energy, status and message."""

from __future__ import annotations

import numpy as np

from antiosc.base import checks, plausible
from antiosc.base._types import Array
from antiosc.base.errors import AccuracyError, AccuracyWarning, InputError, warn
from antiosc.simulation.assembly import Assembly, assemble
from antiosc.simulation.convergence import Converged, converge, stopped
from antiosc.simulation.coupled_dampers import has_dampers
from antiosc.simulation.engine import Run
from antiosc.simulation.equilibrium import closed, settle
from antiosc.simulation.expected import stiffness_at
from antiosc.simulation.given_step import checked_step, stepped
from antiosc.simulation.scene_energy import GAIN, gained
from antiosc.simulation.scene_history import SceneHistory
from antiosc.simulation.scene_parts import SceneParts
from antiosc.simulation.scene_states import touching
from antiosc.simulation.verdict import judge, tell_rotation

#: Contacts that a message names.
NAMED = 5


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
    tol = checks.positive("tol", tol)
    if tol >= 1:
        raise InputError(f"tol is a relative error, 0 < tol < 1; got {tol:g}.")
    max_contacts = checks.whole("max_contacts", max_contacts)
    max_steps = checks.whole("max_steps", max_steps)
    checks.instance("method", method, str, "'exact' or the name of an integrator")
    bodies = list(scene.bodies.values())
    doubts = [*plausible.of_model(*bodies), *plausible.tell(_of_blows(scene))]
    assembly = assemble(scene, duration)
    start(assembly)
    if method == "exact":
        found, failure = exactly(assembly, duration, tol, step, max_contacts, max_steps)
    else:
        failure = ""
        from antiosc.simulation.comparison import compared  # which is seldom needed

        found = compared(assembly, duration, method, tol, step, max_contacts, max_steps)
    error = {} if step is not None else {"force": found.force, "peak": found.peak}
    failure = failure or stopped(
        found.run.answer, float(found.run.time[-1]), max_contacts, max_steps
    )
    verdict = judge(
        failure,
        never_touched(assembly, found.run),
        "" if failure else inexact(assembly, found, tol, max_steps),
        cut_short(assembly, found.run),
    )
    notes = " ".join([verdict.message, *assembly.notes])
    history = SceneHistory(assembly, found.run, error, verdict.status, notes)
    tell_rotation(*history.largest_rotation())
    if damped := [name for name, body in scene.bodies.items() if has_dampers(body)]:
        warn(
            f"the damping ratios of {damped[0]!r} neglect how its dampers couple its modes, with an"
            f" error that a scene does not know; simulate states it for one site.",
            AccuracyWarning,
        )
    verdict.tell()
    for contact, law in zip(scene.contacts, assembly.laws, strict=True):
        if law.valid_force == np.inf:
            continue
        peak = history[contact.a, contact.b].peak_force
        if peak > law.valid_force:
            reason = f"contact {contact.a!r}, {contact.b!r}: {law.out_of_range(peak, None)}."
            raise AccuracyError(plausible.first(doubts, reason))
    return history


def _of_blows(scene: SceneParts) -> list[str]:
    """What is implausible of the blows of a scene, on each of its bodies."""
    bodies, motions = list(scene.bodies.values()), list((scene.motion or {}).values())
    return [plausible.of_blow(body, bodies, *motions) for body in bodies]


def start(assembly: Assembly) -> None:
    """Forces of the contacts that are closed at the start, at rest if the scene asks for it.

    Without preload only a load on a site without mass closes a contact at once.
    """
    system, laws = assembly.system, assembly.laws
    if assembly.scene.preload:
        system.q, system.pressed = settle(system, laws)
    else:
        system.pressed = closed(system, laws)
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
    step = checked_step(step, duration)

    def stiffness() -> Array:
        return np.array(
            [
                stiffness_at(law, float(depth), law.touch(float(speed)))
                for law, depth, speed in zip(laws, system.depth, system.speed, strict=True)
            ]
        )

    found, failure = stepped(system, stiffness, duration, step, max_contacts, max_steps)
    return Converged(found, step, 0.0, 0.0, duration), failure


def inexact(assembly: Assembly, found: Converged, tol: float, max_steps: int) -> str:
    """Why a run that reached its end does not meet the tolerance; "" if it does."""
    worst = found.worst
    if worst == np.inf:
        if found.certain > 0:
            return (
                f"The error is not known: a finer run takes too many steps. Up to"
                f" {found.certain:.4g} s the two agree; shorten the duration to that."
            )
        return (
            f"The error is not known: max_steps = {max_steps} leaves no finer run to compare with;"
            f" raise it or shorten the duration."
        )
    if not worst <= tol:
        return (
            f"The contact forces did not converge: finer runs differ by {worst:.2g}, not"
            f" tol = {tol:g} (they rattle, so that small errors grow). Up to {found.certain:.4g} s"
            f" they agree; shorten the duration to that."
        )
    gain = gained(assembly, found.run)
    if gain > GAIN:
        return f"The scene gained energy, {gain:.2g} of the highest that it had; use a smaller tol."
    return ""


def cut_short(assembly: Assembly, run: Run) -> str:
    """Which contacts go on at the end of the run; those that rest since its start do not count."""
    contacts = [assembly.scene.contacts[c] for c in touching(run, assembly.system)]
    if not contacts:
        return ""
    named = ", ".join(f"{c.a!r} - {c.b!r}" for c in contacts[:NAMED])
    more = ", ..." if len(contacts) > NAMED else ""
    return (
        f"The run ends during contact of {named}{more}: contact time, impulse and peak force are"
        f" those up to {run.time[-1]:g} s; lengthen the duration."
    )


def never_touched(assembly: Assembly, run: Run) -> str:
    """Why no contact touched, which may come from a wrong sign; "" if one did."""
    system = assembly.system
    if run.touches or np.any(system.pressed):
        return ""
    p = len(assembly.laws)
    speed = system.beta[:p] @ system.v
    if np.all(speed <= 0) and np.any(speed < 0):
        c = assembly.scene.contacts[int(np.argmin(speed))]
        return (
            f"{c.a!r}, {c.b!r} opens at {-speed.min():g} m/s at first; if it should close, reverse"
            f" the velocity or, for bodies of one coordinate, the ends"
        )
    return f"no contact closed within {run.time[-1]:g} s; lengthen the duration or give a velocity"
