"""Simulate an impact of two linear bodies with one contact.

Sign convention: d is the direction in which the contact force F >= 0 acts on the structure. The
impactor approaches along +d. The displacements u of the site and w of the impactor are both
measured along d, and

    delta = w - u - gap.

Every velocity given by the user is > 0 if it closes the gap: that of the impactor is w', and the
`initial_velocity` of the structure is -u'. A structure that moves toward an `Obstacle` has u' < 0
and is pushed back along +d. Gravity is the acceleration along +d: > 0 presses the impactor on the
structure, < 0 makes a structure fall on an obstacle. The displacement of a supported structure (k0
> 0) is measured from its equilibrium under gravity; a structure with a rigid-body mode falls.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import inf
from typing import Any

import numpy as np

from antiosc.base import checks, plausible
from antiosc.base._types import Array
from antiosc.base.errors import AccuracyError, InputError
from antiosc.contact import ContactLaw
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.body import LinearBody, checked_body
from antiosc.models.modal import ModalBody
from antiosc.models.motion import Motion
from antiosc.simulation.compared_impact import compared
from antiosc.simulation.coupled_dampers import refuse_coupling
from antiosc.simulation.error_budget import error_budget
from antiosc.simulation.exact import exact
from antiosc.simulation.expected import scaled
from antiosc.simulation.given_step import checked_step
from antiosc.simulation.history import History
from antiosc.simulation.integrators import (
    FIXED_STEP,
    IVP_METHODS,
    MAX_STEPS,
    Problem,
    Trajectory,
)
from antiosc.simulation.measured_errors import warn_low_band
from antiosc.simulation.modal_response import responses
from antiosc.simulation.truncation import Run, choose_n
from antiosc.simulation.two_bodies import LAW, assemble, check_span, without_patch
from antiosc.simulation.verdict import Verdict, impact_verdict, tell_rotation

DEFAULT_TOL = 1e-3
#: Contacts, the last ones, after which the rotation of a body is looked at.
LOOKED_AT = 50
METHODS = ("exact", *FIXED_STEP, *IVP_METHODS)


@checks.within_range
def simulate(
    model: LinearBody,
    impactor: LinearBody,
    contact: ContactLaw,
    duration: float,
    method: str = "exact",
    *,
    n: int | str | None = None,
    step: float | None = None,
    tol: float | None = None,
    initial_velocity: float | Motion = 0.0,
    gravity: float | Sequence[float] = 0.0,
    gap: float | None = None,
    max_contacts: int = 10_000,
    max_steps: int = MAX_STEPS,
) -> History:
    """Integrate the impact of `impactor` on the site of `model`.

    Parameters
    ----------
    model : AntiOscillators, or any `LinearBody`
        The structure.
    impactor : RigidMass, Sphere, Obstacle, Impactor, or any `LinearBody`
        The second body; a model without a velocity is at rest.
    contact : ContactLaw
        If the model contains the half-space compliance of its patch (`local_compliance`), it is
        subtracted from a Hertz law; the message of the history states this.
    duration : float
        Time to simulate [s].
    method : str
        "exact", "newmark", "conserving", "leapfrog", or a method of `scipy.integrate.solve_ivp`
        such as "DOP853".
    n : int or "auto", optional
        Number of anti-oscillators of the model to use; default all. "auto" takes the smallest
        number whose estimated truncation error of peak force, impulse and contact time meets
        `tol` (see `antiosc.simulation.truncation`).
    step : float, optional
        Fixed time step during contact [s] (solve_ivp: largest step). By default the step is
        refined until the force history has converged; unstable steps are avoided.
    tol : float
        Relative error of the force history in the L2 norm, and of its peak; default 1e-3.
    initial_velocity : float or Motion
        Initial motion of a structure with rigid-body modes. A number is the velocity along the
        direction of impact [m/s], > 0 toward the impactor. A body that is free in this direction
        translates. If supports prevent this translation (a beam pinned at one end), or if the
        inertia of the model in space is unknown (made by hand or from matrices), the number is the
        velocity of the site in the rigid-body motion of least kinetic energy, phi_CR of the
        article. A `Motion` gives velocity and spin in the axes of the mesh.
    gravity : float or sequence of 3 floats
        Acceleration [m/s^2] along the impact direction, or as a vector in the axes of the mesh. It
        acts on free bodies; the displacement of a body that is supported at its site is measured
        from its equilibrium.
    gap : float, optional
        Distance at the start [m]; default 0, or the obstacle's own.
    max_contacts, max_steps : int
        Limits of the computing effort; a run that reaches one stops, with a status and a message.

    With n="auto" the runs that choose n use the same method, step and limits.

    Returns
    -------
    History

    Raises
    ------
    InputError
        For input that breaks a rule.
    AccuracyError
        If the peak force is outside the range of validity of the contact law, or the coupling of
        the modes by the dampers of an assembly changes the impact by more than `tol`.
    """
    duration = checks.positive("duration", duration, "s")
    accuracy = DEFAULT_TOL if tol is None else checks.tolerance(tol)
    checks.choice("method", method, METHODS)
    max_contacts = checks.whole("max_contacts", max_contacts)
    max_steps = checks.whole("max_steps", max_steps)
    checks.instance("contact", contact, ContactLaw, LAW)
    doubts = plausible.tell([plausible.of_blow(model, [impactor], initial_velocity)])

    options: dict[str, Any] = {
        "initial_velocity": initial_velocity, "gravity": gravity, "gap": gap,
        "max_contacts": max_contacts, "max_steps": max_steps,
    }  # fmt: skip

    def run_of(each: LinearBody, tol: float, method: str) -> Outcome:
        return integrated(each, impactor, contact, duration, method, step=step, tol=tol, **options)

    def again(each: AntiOscillators, tol: float) -> History:
        # a model with all its mass in anti-oscillators leaves the others to the exact method
        own = "exact" if each.m0 == 0 and contact.rate_dependent else method
        return run_of(each, tol, own).history(each, impactor)

    exactly = partial(
        exact_run, impactor=impactor, contact=contact, duration=duration, options=options
    )

    truncation: dict[str, float] = {}
    shortage = ""
    if n is not None:
        model, truncation, shortage = _truncated(model, n, again, accuracy)
    outcome = run_of(model, accuracy, method)
    coupling, damped = refuse_coupling(
        outcome.problem, outcome.bodies, (model, impactor), outcome.trajectory, accuracy
    )
    verdict = outcome.verdict.with_shortage(shortage)
    history = outcome.history(model, impactor)
    history = replace(
        history,
        error={**history.error, **truncation, **coupling},
        status=verdict.status,
        message=" ".join(filter(None, (history.message, shortage, damped))),
        budget=partial(error_budget, again=exactly),
    )
    verdict.tell()
    tell_rotation(*outcome.largest_rotation())
    check_range(history, [*plausible.of_model(model), *doubts])
    warn_low_band(history)
    return history


def exact_run(
    model: LinearBody,
    tol: float,
    *,
    impactor: LinearBody,
    contact: ContactLaw,
    duration: float,
    options: Mapping[str, Any],
) -> History:
    """The same impact on another model, by the exact method to a tolerance."""
    outcome = integrated(model, impactor, contact, duration, step=None, tol=tol, **options)
    return outcome.history(model, impactor)


def check_range(history: History, doubts: Sequence[str] = ()) -> None:
    """AccuracyError, behind what is implausible, if the peak force leaves the range of its law."""
    law = history.problem.law
    if law.valid_force < inf and history.peak_force > law.valid_force:
        reason = law.out_of_range(
            history.peak_force, checked_body("model", history.model).patch_radius
        )
        raise AccuracyError(plausible.first(doubts, f"{reason}."))


@dataclass(frozen=True, eq=False)
class Outcome:
    """One integrated impact: the problem, the run, and what is said of it."""

    problem: Problem
    bodies: tuple[ModalBody, ModalBody]
    trajectory: Trajectory
    step: float
    error: dict[str, float]
    verdict: Verdict
    note: str
    duration: float

    def largest_rotation(self) -> tuple[str, float]:
        """The free body that turned most by the end of a contact or of the run, and how far [rad].

        Of bodies whose inertia in space is known.
        """
        first = self.bodies[0].omega.size
        free = {
            name: (body.inertia, own)
            for name, body, own in zip(
                ("structure", "impactor"),
                self.bodies,
                (slice(first), slice(first, None)),
                strict=True,
            )
            if body.inertia is not None and not body.omega.all()
        }
        if not free:
            return "", 0.0
        at = np.array([c.end for c in self.trajectory.contacts[-LOOKED_AT:]])
        if not self.trajectory.failure:
            at = np.append(at, self.duration)
        q = self._glided(at)
        angles = {
            name: float(np.linalg.norm(inertia.rotation(q[:, own]), axis=1).max(initial=0.0))
            for name, (inertia, own) in free.items()
        }
        return max(angles.items(), key=lambda pair: pair[1])

    def _glided(self, at: Array) -> Array:
        """Displacements (n, J) in rigid-body modes at times, for each contact as its impulse."""
        p, contacts = self.problem, self.trajectory.contacts
        rigid = p.omega == 0
        still, decay = p.omega[rigid], p.decay[rigid]
        middle = np.array([0.5 * (c.start + c.end) for c in contacts])
        impulse = np.array([c.impulse for c in contacts])
        free = responses(still, decay, at)
        pushed = responses(still, decay, np.maximum(at[:, None] - middle, 0.0)).S
        q = np.zeros((at.size, p.omega.size))
        q[:, rigid] = free.S * p.v[rigid] + free.J0 * p.load[rigid]
        q[:, rigid] -= p.beta[rigid] * np.einsum("ncj,c->nj", pushed, impulse)
        return q

    def history(self, model: LinearBody, impactor: LinearBody) -> History:
        """The run as a History."""
        return History(
            problem=self.problem,
            bodies=self.bodies,
            model=model,
            impactor=impactor,
            trajectory=self.trajectory,
            step=self.step,
            error=self.error,
            status=self.verdict.status,
            message=" ".join(filter(None, (self.verdict.message, self.note))),
        )


def integrated(
    model: LinearBody,
    impactor: LinearBody,
    contact: ContactLaw,
    duration: float,
    method: str = "exact",
    *,
    step: float | None,
    tol: float,
    initial_velocity: float | Motion,
    gravity: float | Sequence[float],
    gap: float | None,
    max_contacts: int,
    max_steps: int,
) -> Outcome:
    """One run of `simulate`, of whose verdict the caller has not been warned yet."""
    law, note = without_patch(contact, model, impactor)
    problem, bodies = assemble(model, impactor, law, initial_velocity, gravity, gap)
    check_span(problem, duration)
    problem, scale = scaled(problem, bodies, duration)
    step = None if step is None else checked_step(step, duration)
    wanted = problem, duration, scale, step, tol, max_contacts, max_steps
    trajectory, step, error = exact(*wanted) if method == "exact" else compared(method, *wanted)
    verdict = impact_verdict(
        problem,
        duration,
        touched=bool(trajectory.contacts),
        released=bool(trajectory.contacts) and trajectory.contacts[-1].released,
        failure=trajectory.failure,
        error=max(error.values(), default=0.0),
        tol=tol,
    )
    return Outcome(problem, bodies, trajectory, step, error, verdict, note, duration)


def _truncated(
    model: LinearBody, n: int | str, run: Run, tol: float
) -> tuple[LinearBody, dict[str, float], str]:
    """The model with `n` anti-oscillators, its estimated errors, and a note if they are too few."""
    if not isinstance(model, AntiOscillators):
        raise InputError(f"only AntiOscillators can be truncated; got {type(model).__name__}.")
    if not isinstance(n, str):
        return model.truncated(n), {}, ""
    if n != "auto":
        raise InputError(f'n must be a number of anti-oscillators or "auto"; got {n!r}.')
    choice = choose_n(model, run, tol)
    errors = {
        f"truncation {name}": getattr(choice.error, name)
        for name in ("peak_force", "impulse", "contact_time")
    }
    shortage = ""
    if choice.missing:
        shortage = (
            f"The model's {model.n} anti-oscillators leave an estimated truncation error of"
            f" {choice.error.worst:.2g}, more than tol = {tol:g}; about {choice.missing} more are"
            f" needed."
        )
    return model.truncated(choice.n), errors, shortage
