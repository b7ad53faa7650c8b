"""A scene run to its tolerance: start, error control, balance of energy, status and message."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from antiosc import checks
from antiosc.errors import AccuracyError, AccuracyWarning, InputError, warn
from antiosc.simulation import march
from antiosc.simulation.assembly import Assembly, assemble
from antiosc.simulation.convergence import FINE, Converged, converge, stopped
from antiosc.simulation.equilibrium import closed, settle
from antiosc.simulation.laws import forget
from antiosc.simulation.scene_history import SceneHistory
from antiosc.simulation.scene_parts import SceneParts

Array = NDArray[np.float64]

GAIN = 1e-3  # of the highest energy: a scene that gains more says so
BALANCED = 5000  # nodes up to which the balance of energy is always made


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
    checks.whole("max_contacts", max_contacts)
    checks.whole("max_steps", max_steps)
    checks.instance("method", method, str, "'exact' or the name of an integrator")
    assembly = assemble(scene, duration)
    start(assembly)
    try:
        if method == "exact":
            if step is not None:
                raise InputError("method='exact' finds its own steps; give tol instead of step.")
            found = converge(
                assembly.system,
                duration,
                tol,
                max_contacts,
                max_steps,
                fine=assembly.lasting / FINE,
            )
        else:
            from antiosc.simulation.comparison import compared  # which is seldom needed

            found = compared(assembly, duration, method, tol, step, max_contacts, max_steps)
    finally:
        for kind, parameters in zip(assembly.system.kinds, assembly.system.params, strict=True):
            forget(int(kind), parameters)
    error = {} if step is not None else {"force": found.force, "peak": found.peak}
    status, message = verdict(found, tol, max_contacts, max_steps)
    if status == 0:
        gain = gained(SceneHistory(assembly, found.run, error, 0, ""))
        if gain > GAIN:
            status, message = (
                1,
                (
                    f"The scene gained energy, {gain:.2g} of the highest that it had; use a smaller"
                    f" tol."
                ),
            )
    notes = " ".join([message, *assembly.notes])
    history = SceneHistory(assembly, found.run, error, status, notes)
    turned = history.largest_rotation()
    if turned[1] > 0.1:
        warn(
            f"{turned[0]!r} turned by {turned[1]:.2g} rad; rotations are taken as small, below"
            f" 0.1 rad.",
            AccuracyWarning,
        )
    if status:
        warn(message, AccuracyWarning)
    for contact, law in zip(scene.contacts, assembly.laws, strict=True):
        peak = history[contact.a, contact.b].peak_force
        if peak > law.valid_force:
            raise AccuracyError(
                f"contact {contact.a!r}, {contact.b!r}: {law.out_of_range(peak, None)}."
            )
    return history


def start(assembly: Assembly) -> None:
    """Forces of the contacts that are closed at the start, at rest if the scene asks for it.

    Without preload only a load on a site without mass closes a contact at once.
    """
    system, laws = assembly.system, assembly.laws
    if assembly.scene.preload:
        system.q, system.pressed = settle(system, laws)
    else:
        system.pressed = closed(system, laws)
    if np.any(system.pressed):
        p = len(laws)
        delta = system.beta[:p] @ system.q - system.offsets[0, :p]
        delta = np.maximum(delta - system.R[:p, :p] @ system.pressed, 0.0)
        system.depth = np.maximum(system.depth, delta)
        system.given = sum(
            law.potential(float(d), law.touch(0.0)) for law, d in zip(laws, delta, strict=True)
        )
        system.given += 0.5 * float(system.pressed @ system.R[:p, :p] @ system.pressed)


def verdict(found: Converged, tol: float, max_contacts: int, max_steps: int) -> tuple[int, str]:
    """Status and message of a run: 0 completed, 1 tolerance not met, 2 stopped before the end."""
    answer, t = found.run.answer, float(found.run.time[-1])
    failure = stopped(answer, t, max_contacts, max_steps)
    if failure:
        return 2, failure[0].upper() + failure[1:] + "."
    worst = found.worst
    if worst == np.inf:
        if found.certain > 0:
            return 1, (
                f"The error is not known: a finer run takes too many steps. Up to"
                f" {found.certain:.4g} s the two agree; shorten the duration to that."
            )
        return 1, (
            f"The error is not known: max_steps = {max_steps} leaves no finer run to compare with;"
            f" raise it or shorten the duration."
        )
    if not worst <= tol:
        return 1, (
            f"The contact forces did not converge: finer runs differ by {worst:.2g}, not"
            f" tol = {tol:g} (they rattle, so that small errors grow). Up to {found.certain:.4g} s"
            f" they agree; shorten the duration to that."
        )
    return 0, "Completed."


def gained(history: SceneHistory) -> float:
    """Energy that came from nowhere, relative to the highest.

    The balance of a long run is dear to find: it is made only where the march had a doubt. A law
    of one's own need not know its energy.
    """
    run = history.run
    if np.any(history.assembly.system.kinds == march.USER):
        return 0.0
    if run.time.size > BALANCED and not run.gained > 0.1 * GAIN * run.highest:
        return 0.0
    energy = history.energy
    highest = float(np.max(energy.kinetic + energy.strain + energy.contact))
    return float(np.max(energy.total - energy.total[0])) / highest if highest > 0 else 0.0
