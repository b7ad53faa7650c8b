"""A scene that runs: it is posed, integrated to its tolerance, and read as a history."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from antiosc.base import checks, plausible
from antiosc.base._types import Array
from antiosc.base.errors import AccuracyError, AccuracyWarning, warn
from antiosc.base.memory import within_memory
from antiosc.contact import ContactLaw
from antiosc.simulation.errors.truncation import too_few
from antiosc.simulation.histories.deflection import too_far
from antiosc.simulation.histories.energy import gained
from antiosc.simulation.histories.history import History, SceneHistory
from antiosc.simulation.histories.verdict import (
    Ended,
    Verdict,
    tell_rotation,
    touching,
    verdict_of,
)
from antiosc.simulation.integrators.comparison import (
    MAX_CONTACTS,
    MAX_STEPS,
    Settings,
    compared,
)
from antiosc.simulation.integrators.scene_ivp import IVP_METHODS
from antiosc.simulation.march.convergence import Converged, converge
from antiosc.simulation.march.equilibrium import closed, settle
from antiosc.simulation.march.given_step import checked_step, stepped
from antiosc.simulation.march.system import Kept
from antiosc.simulation.problem.assembly import Assembly, assemble
from antiosc.simulation.problem.rows import order_notes
from antiosc.simulation.problem.scales import stiffness_at
from antiosc.simulation.problem.scene_parts import SceneParts

H = TypeVar("H", bound=History)


@dataclass(frozen=True, eq=False)
class Scene(SceneParts):
    """Bodies in contact; `run` integrates their motion.

    Parameters
    ----------
    bodies : mapping
        Name -> model, `RigidMass`, `Sphere`, `Obstacle`, `Impactor`, `RigidBody` or `SiteModes`.
    contacts : sequence of Contact
        At least one.
    gravity : float or sequence of 3 floats
        [m/s^2] along the contacts' direction, or a vector.
    loads : sequence of Load
        Forces in time.
    base : Base, optional
        Motion of the ground.
    motion : mapping, optional
        Name -> `Motion` with which a free body starts, the velocity [m/s] along its one
        coordinate, or its `ModalState`.
    preload : bool
        Start from the static equilibrium under gravity, the loads at t = 0 and closed contacts.

    Raises
    ------
    InputError
        For names that do not exist and values outside their range.
    """

    @within_memory
    def run(
        self,
        duration: float,
        *,
        tol: float = 1e-3,
        method: str = "exact",
        step: float | None = None,
        max_contacts: int = MAX_CONTACTS,
        max_steps: int = MAX_STEPS,
    ) -> SceneHistory:
        """Integrate over `duration` [s] to a relative error `tol` of the contact forces.

        Parameters
        ----------
        duration : float
            [s].
        tol : float
            Relative error of all contact forces together in the L2 norm, and of their peak.
        method : str
            "exact"; to compare with, "newmark", "conserving", "leapfrog", or a method of
            `scipy.integrate.solve_ivp` such as "DOP853", which runs once, to tol/100, and states
            no error. Flights are exact, unless loads or a base act: these are integrated too.
        step : float, optional
            Step [s] of one run, whose error is then not known; otherwise steps are refined until
            `tol` is met. Of `solve_ivp` it is the largest. "exact" halves it where it does not
            resolve the forces, and stops with a message where the contacts excite the modes at
            this step.
        max_contacts, max_steps : int
            Bounds on the work; a run that meets one stops and says so.

        Returns
        -------
        SceneHistory

        Raises
        ------
        InputError
            For a scene that cannot be posed.
        AccuracyError
            When a force leaves the range of its law.
        OutOfMemoryError
            For a run that does not fit in the free memory.
        """
        duration = checks.positive("duration", duration, "s")
        settings = Settings(tol, method, step, max_contacts, max_steps)
        bodies, motions = list(self.bodies.values()), list(self.motion.values())
        blows = [plausible.of_blow(body, bodies, *motions) for body in bodies]
        doubts = [*plausible.of_model(*bodies), *plausible.tell(blows)]
        assembly = assemble(self, duration)
        start(assembly)
        history, verdict = solved(SceneHistory, assembly, duration, settings)
        tell_rotation(*history.largest_rotation())
        verdict.tell()
        history = told(history)
        _tell_too_few(self, history)
        check_range(history, doubts)
        return history


def solved(
    kind: Callable[..., H], assembly: Assembly, duration: float, settings: Settings
) -> tuple[H, Verdict]:
    """The history of what is ready to integrate, and the verdict, of which nobody is told yet."""
    step, tol, limits = settings.step, settings.tol, settings.limits
    step = None if step is None else checked_step(step, duration)
    if settings.method == "exact":
        found, failure = exactly(assembly, duration, tol, step, *limits)
    else:
        found, failure = compared(assembly, duration, settings), ""
    run = found.run
    ended = Ended(
        run.answer, float(run.time[-1]), run.touches, touching(run, assembly.system), found.force,
        found.peak, found.certain,
    )  # fmt: skip
    verdict = verdict_of(assembly, ended, tol, limits, failure, lambda: gained(assembly, run))
    known = step is None and settings.method not in IVP_METHODS
    error = {"force": found.force, "peak": found.peak} if known else {}
    contacts, touched = assembly.scene.contacts, {int(c) for c in run.events[:, 1]}
    apart = [one for c, one in enumerate(contacts) if c not in touched]
    message = " ".join([verdict.message, *assembly.notes, *order_notes(apart, assembly.bodies)])
    return kind(assembly, run, error, verdict.status, message, given=step), verdict


def told(history: H) -> H:
    """The history whose message tells what is outside the theory; a warning tells it too."""
    if not (sentence := too_far(history)):
        return history
    warn(sentence, AccuracyWarning)
    return replace(history, message=f"{history.message} {sentence}")


def start(assembly: Assembly, cut: tuple[list[Kept | None], Array] | None = None) -> None:
    """Forces of the contacts that are closed at the start, at rest if the scene asks for it.

    Without preload only a load on a site without mass closes a contact at once, or a run before.

    Parameters
    ----------
    cut : the contacts that go on from a run before (`Run.kept`), and their forces (p,) [N].
    """
    system, laws = assembly.system, assembly.laws
    system.kept = None if cut is None else cut[0]
    if assembly.scene.preload:
        system.q, system.pressed = settle(system, laws)
    else:
        system.pressed = closed(system, laws)
    if cut is not None:
        goes_on = [one is not None and one.closed for one in cut[0]]
        system.pressed = np.where(goes_on, cut[1], system.pressed)
    if system.pressed.any():
        p = len(laws)
        delta = system.beta[:p] @ system.q - system.offsets[0, :p]
        delta = np.maximum(delta - system.R[:p, :p] @ system.pressed, 0.0)
        system.depth = np.maximum(system.depth, delta)
        if system.kept is not None:  # between two nodes they have gone on
            rate = system.free_rows(system.q, system.v)[1].tolist()
            system.kept = [
                one._replace(state=law.advance(d, v, one.state)) if one and one.closed else one
                for law, d, v, one in zip(laws, delta.tolist(), rate, system.kept, strict=False)
            ]
        each = zip(laws, delta.tolist(), system.begun(), strict=True)
        system.given = sum(
            law.energy(d, state) if cut is not None else law.potential(d, state)
            for law, d, state in each
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


def _tell_too_few(scene: Scene, history: SceneHistory) -> None:
    """Warn of a body whose anti-oscillators are too few for a contact of the run."""
    assembly = history.assembly
    for c, (contact, one) in enumerate(zip(scene.contacts, history.contact_histories, strict=True)):
        for end in (contact.a, contact.b) if one.contacts else ():
            name = end.partition(":")[0]
            begin = assembly.spans[name].start if name in assembly.spans else 0
            if sentence := too_few(scene.bodies.get(name), assembly, c, begin):
                warn(f"{name!r} in the contact of {contact.a!r} and {contact.b!r}: {sentence}",
                     AccuracyWarning)  # fmt: skip
