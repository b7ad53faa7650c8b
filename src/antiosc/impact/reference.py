"""Integration of scenes without friction by textbook methods, to compare with "exact".

SciPy's `solve_ivp` integrates from one touch or release to the next, for laws without memory.
Newmark's method (average acceleration) and the leapfrog (central differences) have equal steps and
order 2 for forces without jumps; touches and releases are interpolated within a step.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import ceil, log2
from typing import Any

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import InputError, NotConvergedError
from antiosc.engine import library
from antiosc.engine.contact.stepping import Contacts, StepEnd
from antiosc.engine.march import Converged, Run, difference
from antiosc.engine.system import System
from antiosc.impact.assembly import Assembly
from antiosc.impact.settings import IVP_METHODS, MAX_STEPS, Settings
from antiosc.impact.states import linear_interpolation


def integrate_reference(assembly: Assembly, duration: float, settings: Settings) -> Converged:
    """A run by `settings.method`, with its estimated errors (none for `solve_ivp`)."""
    method = settings.method
    if any(contact.friction > 0 for contact in assembly.scene.contacts):
        raise InputError(f"the method {method!r} does not take friction: use the method 'exact'.")
    if assembly.system.first is not None:
        raise InputError(
            f"{method} knows damping of each mode alone, not one that couples them (a"
            " DampingMatrix, dampers): use the method 'exact'."
        )

    run = _by_solve_ivp if method in IVP_METHODS else _by_fixed_steps
    return run(assembly, duration, settings)


def _run_of_nodes(contacts: Contacts, nodes: Sequence[Array], answer: int, steps: int) -> Run:
    """The `Run` of time nodes (time, force, depth, states), with events from `contacts`."""
    events = np.array(contacts.events, dtype=float).reshape(-1, 4)
    time, force, depth, states = nodes
    return Run(time, force, depth, states, events, answer, steps, steps, contacts.touches)


# -- fixed steps

INITIAL_STEPS_PER_CONTACT = 24  # steps in the shortest contact that is expected, at first
MAX_RUNS = 24
STABLE_STEP_SHARE = 0.9  # of the leapfrog's limit of stability, h omega = 2
#: (motion at the start of a step, forces there, loads) -> motion at its end without forces there.
StepPredictor = Callable[[Array, Array, Array, Array], tuple[Array, Array]]


def newmark(s: System, h: float) -> tuple[Array, Array, StepPredictor]:
    """Newmark's method (average acceleration) with the step h [s].

    Returns the decrease of modal displacements and of velocities (m, J) at the end of a step due to
    a unit force on each row, and a function that predicts both without these forces.
    """
    x = s.omega**2
    scale = 1 + h * s.decay + h * h * x / 4
    slower = h / 2 * s.beta / scale

    def predict(q: Array, v: Array, start_forces: Array, load: Array) -> tuple[Array, Array]:
        a = start_forces - x * q - 2 * s.decay * v
        v1 = (v + h / 2 * (a + load - x * (q + h / 2 * v))) / scale
        return q + h / 2 * (v + v1), v1

    return h / 2 * slower, slower, predict


def leapfrog(s: System, h: float) -> tuple[Array, Array, StepPredictor]:
    """As `newmark`, by central differences: a force at a step's end changes only velocities."""
    x = s.omega**2
    scale = 1 + h * s.decay

    def predict(q: Array, v: Array, start_forces: Array, load: Array) -> tuple[Array, Array]:
        half = v + h / 2 * (start_forces - x * q - 2 * s.decay * v)
        q1 = q + h * half
        return q1, (half + h / 2 * (load - x * q1)) / scale

    return np.zeros_like(s.beta), h / 2 * s.beta / scale, predict


FIXED_STEP_METHODS = {"newmark": newmark, "leapfrog": leapfrog}


def run_in_fixed_steps(s: System, step: float, duration: float, settings: Settings) -> Run:
    """A run in equal steps of at most `step` [s]."""
    count = ceil(duration / step * (1 - 1e-12))
    h = duration / count
    times = np.linspace(0.0, duration, count + 1)
    loads, gaps = (linear_interpolation(times, s.breaks, values) for values in (s.loads, s.offsets))

    less, slower, predict = FIXED_STEP_METHODS[settings.method](s, h)
    A = s.R + less @ s.beta.T
    A_rate = slower @ s.beta.T + s.R / h

    contacts = Contacts(s.laws, s.R, s.closed.tolist(), s.least_speeds)
    q, v, force = s.q, s.v, np.asarray(s.start_forces, dtype=float)
    end = StepEnd(force, s.beta @ q - gaps[0] - s.R @ force, s.beta @ v)
    nodes = [(end.force, end.delta, q, v)]
    status = library.DONE

    for k in range(count):
        if k >= settings.max_steps:
            status = library.TOO_MANY_STEPS
        if status != library.DONE:
            break

        q, v = predict(q, v, loads[k] - end.force @ s.beta, loads[k + 1])
        free = s.beta @ q - gaps[k + 1]
        end = contacts.end_of_step(times[k], h, end, free, s.beta @ v, A, A_rate)
        q, v = q - end.force @ less, v - end.force @ slower
        nodes.append((end.force, end.delta, q, v))

        if not np.isfinite(end.force).all():
            status = library.GREW
        elif contacts.touches > settings.max_contacts:
            status = library.TOO_MANY_CONTACTS

    forces, depths, *states = (np.array(column) for column in zip(*nodes, strict=True))
    number = np.arange(2 * len(nodes) - 1)
    before, after = number // 2, (number + 1) // 2  # the middle of a step has the mean of its ends
    columns = [(x[before] + x[after]) / 2 for x in (times, forces, depths)]
    return _run_of_nodes(contacts, (*columns, np.stack(states, axis=1)), status, len(nodes) - 1)


def _by_fixed_steps(assembly: Assembly, duration: float, settings: Settings) -> Converged:
    """A run with the user's step, or runs with ever shorter steps; the last change is the error."""
    s = assembly.system
    method, tol = settings.method, settings.tol
    top = float(s.omega.max(initial=0.0))
    longest = STABLE_STEP_SHARE * 2 / top if method == "leapfrog" and top > 0 else np.inf
    step = settings.step or min(
        assembly.contact_time_estimate / INITIAL_STEPS_PER_CONTACT, longest, duration / 2
    )
    if step > longest / STABLE_STEP_SHARE:
        raise InputError(
            f"leapfrog is unstable with steps above {longest / STABLE_STEP_SHARE:.3g} s, 2 over the"
            " highest frequency: take a shorter step, or the method 'exact'."
        )
    most = max(settings.max_steps, MAX_STEPS) if settings.step else settings.max_steps
    if (count := duration / step) > most:
        raise InputError(
            f"{method} needs steps of {step:.3g} s, {count:.3g} of them, more than max_steps ="
            f" {most}: take a longer step, or use the method 'exact'."
        )

    run = run_in_fixed_steps(s, step, duration, settings)
    if settings.step is not None:
        return Converged(run, step, 0.0, 0.0, duration)

    force, worst, certain, halvings = np.inf, np.inf, 0.0, 1.0

    for _ in range(MAX_RUNS):
        stopped = run.touches >= settings.max_contacts
        if worst <= tol or stopped or 2**halvings * run.steps > settings.max_steps:
            break
        step /= 2**halvings
        coarse, run = run, run_in_fixed_steps(s, step, duration, settings)
        if library.GREW not in (coarse.answer, run.answer):
            force, peak, certain = difference(coarse, run, tol)
            worst = max(force, peak)
        halvings = min(max(log2(worst / tol) / 2, 1.0), 2.0)  # of order 2

    return Converged(run, step, force, worst, certain)


# -- solve_ivp

IVP_STEP_SHARE = 1 / 10  # of the shortest contact: none is stepped over
IVP_TOL_RATIO = 1e-2  # relative tolerance, of that of the forces
MIN_IVP_TOL = 3e-14  # one that rounding permits
NODES_PER_STEP = 4  # parabolas of the forces for each step of the solver
MAX_EVALUATIONS_PER_STEP = 20  # most evaluations of the right-hand side per allowed step
SAME_TIME_SHARE = 1e-13  # of the duration
MAX_EVENTS_AT_ONE_TIME = 200  # events at the same time


def _by_solve_ivp(assembly: Assembly, duration: float, settings: Settings) -> Converged:
    """One run by a method of SciPy, with `IVP_TOL_RATIO` times the tolerance."""
    R = assembly.system.R
    for c, law in enumerate(assembly.laws):
        if law.has_memory:
            raise InputError(
                f"{settings.method} does not take {type(law).__name__}, a law that remembers how"
                " deep it was: use the method 'exact' or 'newmark'."
            )
        if law.rate_dependent and R[c, c] > 0:
            raise InputError(
                f"{settings.method} does not take a rate-dependent law at a massless contact point"
                " (m0 = 0), where a force depends on its own derivative; use the method 'exact'."
            )

    longest = settings.step or IVP_STEP_SHARE * assembly.contact_time_estimate
    run = _EventSolver(assembly.system, settings, longest).run(duration)
    return Converged(run, longest, 0.0, 0.0, duration)


class _EventSolver:
    """Integrates by `solve_ivp` from event to event: a touch, a release or a corner of a load."""

    def __init__(self, system: System, settings: Settings, longest: float) -> None:
        self.system = system
        self.settings = settings
        self.longest = longest
        self.contacts = Contacts(system.laws, system.R, system.closed.tolist(), system.least_speeds)
        self.evaluations = 0

    def run(self, duration: float) -> Run:
        """The run from 0 to `duration` [s]."""
        s, contacts, settings = self.system, self.contacts, self.settings
        t, y = 0.0, np.concatenate((s.q, s.v))
        pieces: list[tuple[Array, ...]] = []
        status = library.DONE
        steps = idle = 0

        while status == library.DONE and duration - t > SAME_TIME_SHARE * duration:
            found = self._solve_to_event(t, y, duration)
            pieces.append(self._nodes_of_steps(found.t, found.sol))
            steps += found.t.size - 1
            idle = idle + 1 if found.t[-1] - t <= SAME_TIME_SHARE * duration else 0
            t, y = float(found.t[-1]), found.y[:, -1]

            rate = self._contact_state(t, y)[1]
            for c, times in enumerate(found.t_events):
                if not times.size or times[-1] != t:
                    continue
                if contacts.closed[c]:
                    contacts.part(c, t)
                else:
                    contacts.touch(c, t, float(rate[c]))

            if contacts.touches > settings.max_contacts:
                status = library.TOO_MANY_CONTACTS
            elif steps > settings.max_steps:
                status = library.TOO_MANY_STEPS
            elif idle > MAX_EVENTS_AT_ONE_TIME:
                status = library.STUCK

        columns = zip(pieces[0], *([x[1:] for x in piece] for piece in pieces[1:]), strict=True)
        return _run_of_nodes(
            contacts, [np.concatenate(column) for column in columns], status, steps
        )

    def _contact_state(self, t: float, y: Array) -> tuple[Array, Array, Array, Array]:
        """Indentations without contact forces, their rates, the forces and the loads at time t."""
        s = self.system
        q, v = y.reshape(2, -1)
        since, (gap, drift), (load, rise) = t - self.start, self.gap, self.load
        free, rate = s.beta @ q - gap - since * drift, s.beta @ v - drift

        return free, rate, self.contacts.forces(free, s.R, rate, 0.0 * s.R), load + since * rise

    def _derivative(self, t: float, y: Array) -> Array:
        """Time derivative of the state y: the right-hand side of the equations of motion."""
        s = self.system
        self.evaluations += 1
        if self.evaluations > MAX_EVALUATIONS_PER_STEP * self.settings.max_steps:
            raise NotConvergedError(
                f"{self.settings.method} takes more than max_steps = {self.settings.max_steps}:"
                " use the method 'exact'."
            )

        q, v = y.reshape(2, -1)
        _, _, force, load = self._contact_state(t, y)
        return np.concatenate((v, load - force @ s.beta - s.omega**2 * q - 2 * s.decay * v))

    def _solve_to_event(self, t: float, y: Array, duration: float) -> Any:
        """SciPy's result up to the next event or corner of a load."""
        from scipy.integrate import solve_ivp  # loaded where it is used: it takes long

        s = self.system
        until = min(duration, *s.breaks[s.breaks > t * (1 + SAME_TIME_SHARE)].tolist(), np.inf)
        self.start = t
        ends = [
            linear_interpolation(np.array([t, until]), s.breaks, x) for x in (s.offsets, s.loads)
        ]
        self.gap, self.load = ((first, (last - first) / (until - t)) for first, last in ends)

        reach = np.abs(s.beta).max(axis=1)
        reach[reach == 0] = 1.0
        expected = s.contacts["expected_depth"], s.contacts["expected_speed"]
        sizes = [np.full(s.omega.size, np.max(motion / reach)) for motion in expected]
        rtol = max(IVP_TOL_RATIO * self.settings.tol, MIN_IVP_TOL)
        with np.errstate(all="ignore"):
            found = solve_ivp(
                self._derivative,
                (t, until),
                y,
                method=self.settings.method,
                rtol=rtol,
                atol=np.maximum(1e-3 * rtol * np.concatenate(sizes), 1e-300),
                max_step=self.longest,
                events=[self._contact_event(c) for c in range(len(self.contacts.closed))],
                dense_output=True,
            )
        if found.status < 0:
            raise NotConvergedError(f"{found.message} Use the method 'exact'.")
        return found

    def _contact_event(self, c: int) -> Callable[[float, Array], float]:
        """Event function for `solve_ivp`: its root is where contact c touches or opens."""
        R = self.system.R
        closed = self.contacts.closed[c]
        rest = 1e-300 if closed else -1e-300  # at its origin it neither touches nor parts

        def excess(t: float, y: Array) -> float:
            free, _, force, _ = self._contact_state(t, y)
            return float(free[c] - R[c] @ force + R[c, c] * force[c]) or rest

        vars(excess).update(terminal=True, direction=-1.0 if closed else 1.0)
        return excess

    def _nodes_of_steps(self, ends: Array, at: Callable[[Array], Array]) -> tuple[Array, ...]:
        """(time, force, depth, states) at the time nodes of the steps between `ends` [s]."""
        share = np.arange(2 * NODES_PER_STEP) / (2 * NODES_PER_STEP)
        t = np.append((ends[:-1, None] + np.diff(ends)[:, None] * share).ravel(), ends[-1])
        y = at(t).T
        found = [self._contact_state(float(time), row) for time, row in zip(t, y, strict=True)]
        free, _, force, _ = map(np.array, zip(*found, strict=True))
        depth = free - force @ self.system.R
        return t, force, depth, y[::2].reshape(-1, 2, self.system.omega.size)
