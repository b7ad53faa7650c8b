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

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

from antiosc.base import checks, plausible
from antiosc.base.errors import AccuracyWarning, InputError, warn
from antiosc.contact import ContactLaw
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.body import LinearBody
from antiosc.models.model_info import info_of
from antiosc.models.motion import Motion
from antiosc.simulation.errors.error_budget import error_budget
from antiosc.simulation.errors.model_errors import warn_low_band
from antiosc.simulation.errors.truncation import Run, choose_n, too_few
from antiosc.simulation.histories.error_bars import ErrorBudget
from antiosc.simulation.histories.history import History
from antiosc.simulation.histories.verdict import Verdict, tell_rotation
from antiosc.simulation.integrators.comparison import MAX_CONTACTS, MAX_STEPS, Settings
from antiosc.simulation.problem.impacts import Impact
from antiosc.simulation.problem.scene_parts import LAW
from antiosc.simulation.problem.two_bodies import pose
from antiosc.simulation.scene import check_range, solved, told

Budget = Callable[[History], ErrorBudget]

DEFAULT_TOL = 1e-3


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
    max_contacts: int = MAX_CONTACTS,
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
        "exact"; to compare with, "newmark", "conserving", "leapfrog", or a method of
        `scipy.integrate.solve_ivp` such as "DOP853", which runs once, to tol/100, and states no
        error. Flights are exact with all of them.
    n : int or "auto", optional
        Number of anti-oscillators of the model to use; default all. "auto" takes the smallest
        number whose estimated truncation error of peak force, impulse and contact time meets
        `tol` (see `antiosc.simulation.errors.truncation`).
    step : float, optional
        Time step during contact [s] (solve_ivp: largest step). By default the step is refined until
        the force history has converged.
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

    Warns
    -----
    AccuracyWarning
        If the run did not end as requested, or the anti-oscillators that a model was extracted with
        are too few for the contact (`antiosc.simulation.errors.truncation`).
    """
    duration = checks.positive("duration", duration, "s")
    accuracy = DEFAULT_TOL if tol is None else tol
    settings = Settings(accuracy, method, step, max_contacts, max_steps)
    checks.instance("contact", contact, ContactLaw, LAW)
    doubts = plausible.tell([plausible.of_blow(model, [impactor], initial_velocity)])
    scene = Impact(model, impactor, contact, duration, initial_velocity, gravity, gap)
    budget = partial(error_budget, again=partial(_again, scene, settings))
    history, verdict = impact(scene, settings, n, budget)
    verdict.tell()
    if n != "auto" and history.run.touches:
        sentence = too_few(model if n is None else history.model, history.assembly)
        if sentence and getattr(model, "strain_error", None) is None:
            warn(sentence, AccuracyWarning)  # with one, the error budget tells it
        if sentence:
            history = replace(history, message=f"{history.message} {sentence}")
    tell_rotation(*history.largest_rotation())
    history = told(history)
    check_range(history, [*plausible.of_model(model), *doubts])
    if info_of(model).measured is not None:
        warn_low_band(history)
    return history


def impact(
    scene: Impact, settings: Settings, n: int | str | None = None, budget: Budget | None = None
) -> tuple[History, Verdict]:
    """One impact, and the verdict, of which nobody is told yet; `n` as of `simulate`."""

    def of(model: LinearBody, settings: Settings) -> tuple[History, Verdict]:
        assembly = pose(*scene._replace(model=model))
        return solved(partial(History, budget=budget), assembly, scene.duration, settings)

    def again(model: AntiOscillators, tol: float) -> History:
        # a model with all its mass in anti-oscillators leaves the others to the exact method
        exact = model.m0 == 0 and scene.contact.rate_dependent
        method = "exact" if exact else settings.method
        return of(model, replace(settings, tol=tol, method=method))[0]

    if n is None:
        return of(scene.model, settings)
    model, truncation, shortage = _truncated(scene.model, n, again, settings.tol)
    history, verdict = of(model, settings)
    history.error.update(truncation)
    if shortage:
        verdict = verdict.with_shortage(shortage)
        message = f"{history.message} {shortage}"
        history = replace(history, status=verdict.status, message=message)
    return history, verdict


def _again(scene: Impact, settings: Settings, model: LinearBody, tol: float) -> History:
    """The same impact on another model, by the exact method to a tolerance."""
    exact = replace(settings, tol=tol, method="exact", step=None)
    return impact(scene._replace(model=model), exact)[0]


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
        most = model.info.dofs
        beyond = most is not None and model.n + choice.missing > most
        more = "more than the mesh has" if beyond else f"about {choice.missing} more"
        shortage = (
            f"The model's {model.n} anti-oscillators leave an estimated truncation error of"
            f" {choice.error.worst:.2g}, more than tol = {tol:g}; {more} are needed."
        )
    return model.truncated(choice.n), errors, shortage
