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

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from math import log2
from typing import Any

import numpy as np

from antiosc import checks
from antiosc._types import Array
from antiosc.contact import ContactLaw, Hertz, State
from antiosc.errors import AccuracyError, InputError
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.body import LinearBody, checked_body
from antiosc.models.modal import ModalBody
from antiosc.models.motion import Motion
from antiosc.simulation.error_budget import error_budget
from antiosc.simulation.history import History, force_difference
from antiosc.simulation.integrators import (
    FIXED_STEP,
    IVP_METHODS,
    MAX_STEPS,
    Integrator,
    Problem,
    SolveIVP,
    Trajectory,
    run,
)
from antiosc.simulation.step_control import Refinement
from antiosc.simulation.truncation import Run, choose_n
from antiosc.simulation.verdict import Verdict, judge

DEFAULT_TOL = 1e-3
COARSEST = 24  # per estimated contact time, on the coarsest level
MAX_LEVELS = 24
#: Largest phase of a motion [rad]: rounding leaves some 0.1 rad of it.
LARGEST_PHASE = 1e15
LAW = "a ContactLaw such as Hertz(stiffness)"


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
        If the peak force is outside the range of validity of the contact law.
    """
    duration = checks.positive("duration", duration, "s")
    accuracy = DEFAULT_TOL if tol is None else checks.tolerance(tol)
    checks.choice("method", method, (*FIXED_STEP, *IVP_METHODS))
    max_contacts = checks.whole("max_contacts", max_contacts)
    max_steps = checks.whole("max_steps", max_steps)
    checks.instance("contact", contact, ContactLaw, LAW)

    options: dict[str, Any] = {
        "initial_velocity": initial_velocity, "gravity": gravity, "gap": gap,
        "max_contacts": max_contacts, "max_steps": max_steps,
    }  # fmt: skip

    def run_of(each: LinearBody, tol: float, method: str) -> tuple[History, Verdict]:
        return integrated(each, impactor, contact, duration, method, step=step, tol=tol, **options)

    def again(each: AntiOscillators, tol: float) -> History:
        # a model with all its mass in anti-oscillators leaves the others to the exact method
        own = "exact" if each.m0 == 0 and contact.rate_dependent else method
        return run_of(each, tol, own)[0]

    exactly = partial(
        exact_run, impactor=impactor, contact=contact, duration=duration, options=options
    )

    truncation: dict[str, float] = {}
    shortage = ""
    if n is not None:
        model, truncation, shortage = _truncated(model, n, again, accuracy)
    history, verdict = run_of(model, accuracy, method)
    verdict = verdict.with_shortage(shortage)
    history = replace(
        history,
        error={**history.error, **truncation},
        status=verdict.status,
        message=" ".join(filter(None, (history.message, shortage))),
        budget=partial(error_budget, again=exactly),
    )
    verdict.tell()
    check_range(history)
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
    return integrated(model, impactor, contact, duration, step=None, tol=tol, **options)[0]


def check_range(history: History) -> None:
    """AccuracyError if the peak force is outside the range of validity of its law."""
    law = history.problem.law
    if history.peak_force > law.valid_force:
        reason = law.out_of_range(
            history.peak_force, checked_body("model", history.model).patch_radius
        )
        raise AccuracyError(f"{reason}.")


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
) -> tuple[History, Verdict]:
    """One run of `simulate`, and its verdict, of which the caller has not been warned yet."""
    law, note = without_patch(contact, model, impactor)
    problem, bodies = assemble(model, impactor, law, initial_velocity, gravity, gap)
    check_span(problem, duration)
    problem, scale = scaled(problem, bodies, duration)
    trajectory, step, error = _integrate(
        problem, method, duration, scale, step, tol, max_contacts, max_steps
    )
    verdict = judge(
        problem,
        duration,
        touched=bool(trajectory.contacts),
        released=bool(trajectory.contacts) and trajectory.contacts[-1].released,
        failure=trajectory.failure,
        error=max(error.values(), default=0.0),
        tol=tol,
    )
    history = History(
        problem=problem,
        bodies=bodies,
        model=model,
        impactor=impactor,
        trajectory=trajectory,
        step=step,
        error=error,
        status=verdict.status,
        message=" ".join(filter(None, (verdict.message, note))),
    )
    return history, verdict


def _integrate(
    problem: Problem,
    method: str,
    duration: float,
    scale: float,
    step: float | None,
    accuracy: float,
    max_contacts: int,
    max_steps: int,
) -> tuple[Trajectory, float, dict[str, float]]:
    """The run by the named method, its step, and its estimated errors if the step is automatic.

    `scale` is the estimated contact time [s], from which the choice of the step starts.
    """
    if step is not None:
        step = checks.positive("step", step, "s")
        if step > duration:
            raise InputError(f"step must be <= the duration {duration:g} s; got {step:g} s.")

    def go(integrator: Integrator, fine: float) -> Trajectory:
        return run(problem, integrator, duration, fine, max_contacts)

    error: dict[str, float] = {}
    if method in IVP_METHODS:
        limit = scale / 10 if step is None else step
        trajectory = go(
            SolveIVP(method, max(1e-2 * accuracy, 3e-14), limit, 5 * max_steps), limit / 4
        )
        step = limit
    elif method in FIXED_STEP:
        make = FIXED_STEP[method]
        if step is None:

            def stable(h: float) -> float:
                return make.stable_step(problem, h, scale / max_steps)

            first = stable(scale / COARSEST)
            if scale / first > max_steps:
                raise InputError(
                    f"{method} needs steps of {first:.3g} s, {scale / first:.3g} of them in one"
                    f" contact, more than max_steps = {max_steps}; use method='exact'."
                )
            trajectory, step, error = _converge(
                lambda h: go(make(h, max_steps), h / 4),
                stable,
                first,
                accuracy,
                max_steps,
                max_contacts,
            )
        else:
            trajectory = go(make(step, max_steps), step / 4)
    else:
        names = ", ".join([*FIXED_STEP, *IVP_METHODS])
        raise InputError(f"method must be one of {names}; got {method!r}.")
    return trajectory, step, error


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


def assemble(
    model: LinearBody,
    impactor: LinearBody,
    law: ContactLaw,
    initial_velocity: float | Motion = 0.0,
    gravity: float | Sequence[float] = 0.0,
    gap: float | None = None,
) -> tuple[Problem, tuple[ModalBody, ModalBody]]:
    """The problem an integrator sees, and the two bodies in the order (structure, impactor)."""
    one, other = checked_body("model", model), checked_body("impactor", impactor)
    checks.instance("contact", law, ContactLaw, LAW)
    structure, striker = one.modal(), other.modal()
    decays = [np.zeros(b.omega.size) if b.decay is None else b.decay for b in (structure, striker)]
    size = structure.omega.size + striker.omega.size
    problem = Problem(
        omega=np.concatenate((structure.omega, striker.omega)),
        decay=np.concatenate(decays),
        beta=np.concatenate((-structure.b, striker.b)),
        r=structure.r + striker.r,
        load=np.concatenate(_loads(structure, striker, gravity)),
        gap=other.gap if gap is None else checks.nonnegative("gap", gap, "m"),
        q=np.zeros(size),
        v=np.concatenate(_starts(structure, striker, initial_velocity, other.velocity)),
        law=law,
        resolution=0.0,
    )
    return problem, (structure, striker)


# The model of a striking body is made like a structure's: its direction is that in which the
# contact pushes it. Its modal coordinates count here along the impact, against that direction.


def _starts(
    structure: ModalBody, striker: ModalBody, initial: float | Motion, speed: float | Motion
) -> tuple[Array, Array]:
    """Modal velocities of both bodies; numbers are > 0 when they close the gap."""
    if not isinstance(initial, Motion):
        initial = -checks.number("initial_velocity", initial, "m/s")
    own = striker.rigid_motion(speed)
    return structure.rigid_motion(initial), -own if isinstance(speed, Motion) else own


def _loads(
    structure: ModalBody, striker: ModalBody, gravity: float | Sequence[float]
) -> tuple[Array, Array]:
    """Modal forces of gravity on both bodies."""
    listed = isinstance(gravity, list | tuple)
    if not (listed or (isinstance(gravity, np.ndarray) and gravity.ndim)):
        along = checks.number("gravity", gravity, "m/s^2")
        return _pull("structure", structure, along), _pull("impactor", striker, along)
    vector = checks.array("gravity", gravity, (3,))
    if structure.direction is None:
        raise InputError(
            "gravity as a vector needs a model that knows the direction of impact: extract it from"
            " a mesh, or give gravity as a number along the impact."
        )
    along = float(vector @ structure.direction)
    loads = []
    for name, body, sign in (("structure", structure, 1.0), ("impactor", striker, -1.0)):
        if body.inertia is None:
            loads.append(_pull(name, body, along))
        else:
            loads.append(_falling(body, sign * body.inertia.momentum[:, :3] @ vector))
    return loads[0], loads[1]


def _pull(name: str, body: ModalBody, gravity: float) -> Array:
    """Modal forces of gravity along the impact."""
    if gravity == 0.0 or not np.any(body.omega == 0):
        return np.zeros(body.omega.size)
    if body.weight is None:
        raise InputError(
            f"gravity on a {name} with a rigid-body mode needs the model's participation;"
            f" extract the model anew, give participation=, or set gravity=0."
        )
    return _falling(body, gravity * body.weight)


def _falling(body: ModalBody, load: Array) -> Array:
    """`load` on free bodies; none on a body with a supported site, measured from its
    equilibrium."""
    rigid = body.omega == 0
    return load if np.any(rigid & (body.b != 0)) else np.where(rigid, load, 0.0)


def without_patch(
    law: ContactLaw, model: LinearBody, impactor: LinearBody
) -> tuple[ContactLaw, str]:
    """The law minus the half-space compliance of the patches, and a note on it."""
    bodies = checked_body("model", model), checked_body("impactor", impactor)
    local = sum(body.local_compliance for body in bodies)
    if local == 0.0:
        return law, ""
    if not isinstance(law, Hertz):
        return law, (
            f"The patch's half-space compliance {local:.4g} m/N was not subtracted:"
            f" {type(law).__name__} is not Hertz's law."
        )
    if law.compliance > 0.0:
        return law, ""
    return law.without(local), (
        f"The patch's half-space compliance {local:.4g} m/N was subtracted from Hertz's law,"
        f" so that the indentation is counted once."
    )


def check_span(problem: Problem, duration: float) -> None:
    """InputError if nothing can move, AccuracyError if rounding destroys the phase in
    `duration`."""
    if not problem.omega.size:
        raise InputError(
            "nothing can move: neither the model nor the impactor has a mass; give m0 or m > 0, or"
            " an impactor with a mass."
        )
    fastest = float(problem.omega.max())
    if fastest * duration > LARGEST_PHASE:
        raise AccuracyError(
            f"rounding destroys the phase of the fastest motion, {fastest:.3g} rad/s, over a "
            f"duration of {duration:g} s: shorten it to at most {LARGEST_PHASE / fastest:.2g} s, "
            "or take fewer anti-oscillators."
        )


def scaled(
    problem: Problem, bodies: tuple[ModalBody, ModalBody], duration: float
) -> tuple[Problem, float]:
    """The problem with its resolution and stiffness, and an estimate of the contact time [s].

    The estimate uses the effective mass of the slowest motion of each body at the contact point. It
    is only the start of the choice of the step.
    """
    mobility = sum(_mobility(body) for body in bodies)
    mass = 1 / mobility if mobility > 0 else 1.0
    push = abs(float(problem.beta @ problem.load)) * mass
    speed = abs(float(problem.beta @ problem.v))
    speed = float(np.sqrt(speed**2 + 2 * push / mass * problem.gap))
    if speed == 0.0 and push == 0.0:
        return replace(problem, resolution=1e-300), duration / 16
    law = problem.law
    state = law.touch(speed)
    farthest = speed * duration + push / mass * duration**2
    delta = _deepest(law, state, 0.5 * mass * speed**2, push, farthest)
    pace = speed + float(np.sqrt(2 * push / mass * delta))
    scale = min(3 * delta / pace, duration / 2)
    late = _pressed(problem, mass, speed, state, farthest)
    stiffness = _stiffness(law, delta + late, state)
    return replace(problem, resolution=1e-9 * delta, stiffness=stiffness), scale


def _deepest(
    law: ContactLaw, state: State, energy: float, push: float, high: float, soft: float = 0.0
) -> float:
    """Indentation [m], to 10 % and at most `high`, that absorbs an energy and the work of a force.

    The contact has a spring of compliance `soft` [m/N] in series.
    """

    def excess(delta: float) -> float:
        force = law.force(delta, 0.0, state) if soft else 0.0
        path = delta + soft * force
        return law.potential(delta, state) + 0.5 * soft * force**2 - energy - push * path

    if excess(high) <= 0:  # the law is softer than the whole run can show
        return high
    low = 0.0
    for _ in range(400):
        middle = 0.5 * (low + high) if low > 0 else 0.1 * high
        low, high = (low, middle) if excess(middle) > 0 else (middle, high)
        if high <= 1.1 * low:
            break
    return high


def _pressed(problem: Problem, mass: float, speed: float, state: State, high: float) -> float:
    """Indentation [m] of the whole impactor mass on the static compliance of both bodies.

    Under a light structure this comes after the first impact, on top of it.
    """
    rigid = problem.omega == 0
    mobility = float(np.sum(problem.beta[rigid] ** 2))
    mass = 1 / mobility if mobility > 0 else mass
    push = abs(float(problem.beta[rigid] @ problem.load[rigid])) * mass
    soft = problem.r + float(np.sum((problem.beta[~rigid] / problem.omega[~rigid]) ** 2))
    return _deepest(problem.law, state, 0.5 * mass * speed**2, push, high, soft)


def _stiffness(law: ContactLaw, delta: float, state: State) -> float:
    """Contact stiffness [N/m] at the deepest indentation: the larger of loading and unloading."""
    unloading = law.advance(delta, 0.0, state)
    slopes = law.tangent(delta, 0.0, state)[0], law.tangent((1 - 1e-9) * delta, 0.0, unloading)[0]
    return float(np.nan_to_num(max(slopes), posinf=0.0))


def _mobility(body: ModalBody) -> float:
    """Inverse [1/kg] of the effective mass of the body's slowest motion at its contact point."""
    rigid = body.omega == 0
    if np.any(body.b[rigid]):
        return float(np.sum(body.b[rigid] ** 2))
    x, b = body.omega[~rigid] ** 2, body.b[~rigid]
    inertia = float(np.sum((b / x) ** 2))
    return (float(np.sum(b**2 / x)) + body.r) ** 2 / inertia if inertia > 0 else 0.0


def _converge(
    go: Callable[[float], Trajectory],
    stable: Callable[[float], float],
    step: float,
    tol: float,
    max_steps: int,
    max_contacts: int,
) -> tuple[Trajectory, float, dict[str, float]]:
    """Refine the step until the force has converged; the finest run and its estimated error.

    A run that diverged is not used for the error of another.
    """
    coarse = go(step)
    control = Refinement(tol)
    for _ in range(MAX_LEVELS):
        share = 2**control.halvings
        if share * coarse.evaluations > max_steps or len(coarse.contacts) >= max_contacts:
            break
        finer = stable(step / share)
        fine = go(finer)
        control.halvings = log2(step / finer)
        if fine.diverged and not coarse.diverged:
            control.halvings += 1
            continue
        if not coarse.diverged:
            control.update(*force_difference(coarse, fine))
        coarse, step = fine, finer
        if control.reached and not fine.failure:
            break
    return coarse, step, control.error
